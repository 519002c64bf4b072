"""Moves of vertices taken back where they fold a surface."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_normals
from meshlab_lowrank.mesh.topology import edges_of, half_edge_pairs

_FOLDED = -0.2  # cosine between the normals of two neighbouring faces
_HALVINGS = 12


def folded_pairs(positions: FloatArray, faces: IntArray) -> IntArray:
    """Pairs (p, 2) of neighbouring faces, by their rows, that lie folded onto one another."""
    pairs = half_edge_pairs(edges_of(faces)).T // 3  # (e, 2)
    return np.asarray(pairs[_lie_folded(positions, faces, pairs)])


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
    pairs = half_edge_pairs(edges_of(faces)).T // 3  # (e, 2)
    pairs = pairs[counted[pairs].any(axis=1)]
    result = moved
    for _ in range(_HALVINGS):
        folded = _lie_folded(result, faces, pairs)
        if not folded.any():
            break
        corners = np.unique(faces[pairs[folded]])
        result = result.copy()
        result[corners] = start[corners] + 0.5 * (result[corners] - start[corners])
    return result


def _lie_folded(positions: FloatArray, faces: IntArray, pairs: IntArray) -> BoolArray:
    """Tell which pairs (p, 2) of neighbouring faces lie folded onto one another, (p,) bool."""
    one, other = face_normals(positions, faces)[pairs].transpose(1, 0, 2)
    return np.asarray(np.einsum("ij,ij->i", one, other) < _FOLDED)
