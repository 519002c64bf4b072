"""Refinement of a patch to the density of its rim."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.edge_flips import flip_edges
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray

_SPREAD = np.sqrt(2.0)
_ROUNDS = 30
_FLAT = 1e-3  # height of a triangle over its longest side


def as_dense(
    vertices: FloatArray, around: IntArray, patch: IntArray, lengths: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Put vertices into the triangles of a patch until they are as small as is wanted.

    Parameters
    ----------
    vertices : (n, 3) float64
    around : (r, 3) int64
        Faces at the rim of the patch; they stay.
    patch : (m, 3) int64
    lengths : (n,) float64
        Edge length that is wanted at each vertex; only those of the patch are read.

    Returns
    -------
    vertices : (n + v, 3) float64
    patch : (m + 2 v, 3) int64

    References
    ----------
    Liepa, Filling holes in meshes, 2003, section 4.
    """
    for _ in range(_ROUNDS):
        corners = vertices[patch]
        centres, wanted = corners.mean(axis=1), lengths[patch].mean(axis=1)
        away = _SPREAD * np.linalg.norm(corners - centres[:, None], axis=2)  # (m, 3)
        wide = (away > np.maximum(wanted[:, None], lengths[patch])).all(axis=1)
        wide &= ~_slivers(corners)  # which flips take away, or nothing does
        if not wide.any():
            break
        split, number = patch[wide], len(vertices) + np.arange(np.count_nonzero(wide))
        fans = [np.stack([split[:, i - 1], split[:, i], number], axis=1) for i in range(3)]
        patch = np.concatenate([patch[~wide], *fans])
        vertices = np.concatenate([vertices, centres[wide]])
        lengths = np.concatenate([lengths, wanted[wide]])
        faces = np.concatenate([around, patch])
        patch = flip_edges(vertices, faces, np.arange(len(faces)) >= len(around))[len(around) :]
    return vertices, patch


def _slivers(corners: FloatArray) -> BoolArray:
    """Mark triangles (m, 3, 3) that are next to a line."""
    sides = np.roll(corners, -1, axis=1) - corners
    longest = (sides**2).sum(axis=2).max(axis=1)
    doubled = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return np.asarray(doubled <= _FLAT * longest)
