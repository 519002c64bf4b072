"""Moves of vertices taken back where they fold a surface."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_normals
from meshlab_lowrank.mesh.topology import edges_of, half_edge_pairs

_FOLDED = -0.2  # cosine between the normals of two neighbouring faces
_HALVINGS = 12


def unfolded(
    start: FloatArray, moved: FloatArray, faces: IntArray, counted: BoolArray
) -> FloatArray:
    """Halve the moves of the corners of faces that lie folded onto one another, again and again.

    Parameters
    ----------
    start : (n, 3) float64
        Positions at which nothing or little is folded.
    moved : (n, 3) float64
    faces : (m, 3) int64
    counted : (m,) bool
        Two neighbours may be folded if neither is among these.

    Returns
    -------
    (n, 3) float64
        Vertices away from folds are where they were moved.
    """
    one, other = half_edge_pairs(edges_of(faces)) // 3
    told = counted[one] | counted[other]
    one, other = one[told], other[told]
    result = moved
    for _ in range(_HALVINGS):
        normals = face_normals(result, faces)
        folded = np.einsum("ij,ij->i", normals[one], normals[other]) < _FOLDED
        if not folded.any():
            break
        corners = np.unique(faces[np.concatenate([one[folded], other[folded]])])
        result = result.copy()
        result[corners] = start[corners] + 0.5 * (result[corners] - start[corners])
    return result
