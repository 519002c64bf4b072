"""Stage 1, fairing: each side of joined creases is a smooth surface of its own."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.energies import harmonic_energy
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.mesh.topology import compacted
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1a_close_creases import CreasedFill, Side


def fair_sides(fill: CreasedFill) -> Region:
    """Let the sides of joined creases go on from their own known faces, and meet the creases.

    The new vertices keep their places over the plane of their side's shape. How far they are above
    the shape is the bi-harmonic continuation of how far the known surface is; on the creases it is
    given, and their tangents are free.

    Parameters
    ----------
    fill : CreasedFill

    Returns
    -------
    Region
        Known vertices and those on the creases are where they were.

    Raises
    ------
    StageError
        If a side isn't determined.
    """
    vertices = fill.region.vertices.copy()
    for side in fill.sides:
        _fair(vertices, fill.region, side)
    region = fill.region
    return Region(**{**vars(region), "vertices": vertices})


def _fair(vertices: FloatArray, region: Region, side: Side) -> None:
    """Move the new vertices of one side, in place."""
    used, near = compacted(region.faces[np.concatenate([side.known, side.new])], len(vertices))
    free = ~region.known_vertices
    free[region.creases] = False
    free = free[used]
    if not free.any():
        return
    local = side.shape.local(vertices[used])
    above = local[:, 2] - side.shape.height(local)
    energy = harmonic_energy(vertices[used], near, 2)
    above = minimise_with_fixed(energy, ~free, np.where(free, 0.0, above))
    height = side.shape.height(local) + above
    vertices[used[free]] = side.shape.lifted(local[free, :2], height[free])
