"""Fills of narrow regions, moved into a wider one around the same loops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
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
        count = int(np.count_nonzero(new))
        number = _numbers_in(region, narrow, len(region.vertices) + np.arange(count))
        faces = number[narrow.faces[~narrow.known_faces]]
        region = with_fill(region, _in_units_of(region, narrow)[new], faces)
    return region


def faces_of_fills(region: Region, closed: Sequence[Region]) -> list[IntArray]:
    """Give the narrower regions the faces that a region has in their place.

    Parameters
    ----------
    region : Region
        With the fills of all, as `with_fills_of` puts them; they may have other faces by now, as
        many and between the same vertices.
    closed : sequence of Region

    Returns
    -------
    list of (m, 3) int64
        The faces of each of them, known ones as they are.
    """
    new = np.flatnonzero(~region.known_vertices)
    filled = region.faces[~region.known_faces]
    vertex = face = 0
    faces = []
    for narrow in closed:
        own = ~narrow.known_faces
        count = int(np.count_nonzero(own))
        inner = int(np.count_nonzero(~narrow.known_vertices))
        number = _numbers_in(region, narrow, new[vertex : vertex + inner])
        back = np.full(len(region.vertices), -1)
        there = number >= 0
        back[number[there]] = np.flatnonzero(there)
        result = narrow.faces.copy()
        result[own] = back[filled[face : face + count]]
        faces.append(result)
        vertex += inner
        face += count
    return faces


def _numbers_in(region: Region, narrow: Region, numbers: IntArray) -> IntArray:
    """Numbers in a region of the vertices of a fill, given those of new ones; -1 for others."""
    new = ~narrow.known_vertices
    number = np.full(len(narrow.vertices), -1)
    number[new] = numbers
    rim = np.setdiff1d(narrow.faces[~narrow.known_faces], np.flatnonzero(new))
    known = region.vertex_ids[region.known_vertices]  # ascending
    number[rim] = np.flatnonzero(region.known_vertices)[
        np.searchsorted(known, narrow.vertex_ids[rim])
    ]
    return number


def _in_units_of(region: Region, other: Region) -> FloatArray:
    """Give the vertices of another region in the local units of this one."""
    if region.scale == other.scale and np.array_equal(region.centre, other.centre):
        return other.vertices
    return (other.to_global(other.vertices) - region.centre) / region.scale
