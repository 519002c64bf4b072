"""Interpolation from scattered points of a surface, smooth and exact on quadratic functions."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import FloatArray, normalized

NEIGHBOURS = 20  # sources that a point is interpolated from
_LEAST_REACH = 1e-9


def interpolation(
    points: FloatArray, normals: FloatArray, sources: FloatArray, source_normals: FloatArray
) -> sparse.csr_array:
    """Interpolate from sources to points of one surface by moving least squares.

    Parameters
    ----------
    points, normals : (n, 3) float64
    sources, source_normals : (s, 3) float64
        At least one; those that face away from a point count for nothing there, as they lie on
        the other side of a thin sheet.

    Returns
    -------
    (n, s) csr_array of float64
        Rows that sum to 1.
    """
    n, k = len(points), NEIGHBOURS
    found = cKDTree(sources).query(points, k=min(k + 1, len(sources)))
    distance, near = np.asarray(found[0]), np.asarray(found[1])
    reach = np.maximum(distance[:, -1:], _LEAST_REACH)  # many points may lie at one place
    distance, near = distance[:, :k] / reach, near[:, :k]
    weights = (1.0 - distance) ** 4 * (4.0 * distance + 1.0)
    facing = np.einsum("ij,ikj->ik", normals, source_normals[near])
    weights *= np.clip(facing, 1e-6, 1.0) ** 2
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = normalized(np.cross(helper, normals))
    offsets = (sources[near] - points[:, None]) / reach[..., None]
    u = np.einsum("ikj,ij->ik", offsets, first)
    v = np.einsum("ikj,ij->ik", offsets, np.cross(normals, first))
    monomials = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=2)  # (n, k, 6)
    weighted = monomials * weights[..., None]
    moments = weighted.transpose(0, 2, 1) @ monomials + 1e-9 * np.eye(6)
    unit = np.zeros((n, 6, 1))
    unit[:, 0] = 1.0
    values = (weighted @ np.linalg.solve(moments, unit))[..., 0]  # (n, k)
    values /= values.sum(axis=1, keepdims=True)
    starts = np.arange(0, n * near.shape[1] + 1, near.shape[1])
    return sparse.csr_array((values.ravel(), near.ravel(), starts), shape=(n, len(sources)))
