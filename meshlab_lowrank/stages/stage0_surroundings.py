"""Fills of narrow regions, moved into a wider one around the same loops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage0_batch import with_fill
from meshlab_lowrank.stages.stage0_region import Region


def with_fills_of(region: Region, closed: Sequence[Region]) -> Region:
    """Close the loops of a region with fills that were made in narrower ones.

    Parameters
    ----------
    region : Region
        Open at all the loops.
    closed : sequence of Region
        Cut out of the same mesh, each closed at one loop.

    Returns
    -------
    Region
        With the fills one after the other.
    """
    for narrow in closed:
        new = ~narrow.known_vertices
        faces = narrow.faces[~narrow.known_faces]
        number = np.full(len(narrow.vertices), -1)
        number[new] = len(region.vertices) + np.arange(np.count_nonzero(new))
        rim = np.setdiff1d(faces, np.flatnonzero(new))
        known = region.vertex_ids[region.known_vertices]  # ascending
        number[rim] = np.searchsorted(known, narrow.vertex_ids[rim])
        region = with_fill(region, _in_units_of(region, narrow)[new], number[faces])
    return region


def _in_units_of(region: Region, other: Region) -> FloatArray:
    """Give the vertices of another region in the local units of this one."""
    if region.scale == other.scale and np.array_equal(region.centre, other.centre):
        return other.vertices
    return (other.to_global(other.vertices) - region.centre) / region.scale
