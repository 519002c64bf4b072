"""Set the vertex positions of the current mesh, in place and to the last bit."""

from __future__ import annotations

import numpy as np
import pymeshlab

from meshlab_lowrank.mesh.geometry import FloatArray


def place(ms: pymeshlab.MeshSet, positions: FloatArray, *, from_zero: bool = True) -> None:
    """Move the vertices of the current mesh.

    MeshLab's linear morphing is the one filter that takes positions from another layer by index.
    It computes p + (t - p), which gives t itself only from p = 0, or where p and t are whole
    numbers; it never gives -0, so those are set afterwards.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh is compact.
    positions : (n, 3) float64
        Finite, one row a vertex.
    from_zero : bool
        Leave the step over zero out only if old and new positions are whole numbers.
    """
    negative_zero = (positions == 0.0) & np.signbit(positions)
    if not negative_zero.any():
        _morph(ms, positions, from_zero)
        return
    limit = 1.0 + float(np.abs(positions).max())
    _morph(ms, np.where(negative_zero, 2.0 * limit, positions), from_zero)
    ms.compute_coord_by_function(
        **{axis: f"{axis} > {limit!r} ? -0.0 : {axis}" for axis in "xyz"}, onselected=False
    )


def _morph(ms: pymeshlab.MeshSet, positions: FloatArray, from_zero: bool) -> None:
    if from_zero:
        _morph(ms, np.zeros_like(positions), from_zero=False)
    current = ms.current_mesh_id()
    ms.add_mesh(pymeshlab.Mesh(vertex_matrix=positions), "positions", set_as_current=True)
    target = ms.current_mesh_id()
    try:
        ms.set_current_mesh(current)
        ms.compute_coord_linear_morphing(targetmesh=target, percentmorph=100.0)
    finally:
        ms.set_current_mesh(target)
        ms.delete_current_mesh()
        ms.set_current_mesh(current)
