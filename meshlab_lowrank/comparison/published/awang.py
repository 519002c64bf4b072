"""Awang and others: a front advances from the rim, and conflicts within it are solved.

Written from the published idea, not the authors' code. Chosen where the idea leaves it open:

- The front advances in the plane that the rim is unfolded into, where conflicts can be told for
  certain; see `awang_front.Front` for its rules, whose angles are those of Zhao, Gao and Lin.
- The new vertices get their places as there: normals of the rim, carried into the hole by a
  harmonic function, turn the triangles of a membrane, and the surface whose gradients come nearest
  to those of the turned triangles is that of a Poisson equation.

References
----------
Awang et al., Filling simple holes of triangular mesh by using enhanced advancing front mesh (EAFM)
method, 2018.
Zhao, Gao and Lin, A robust hole-filling algorithm for triangular mesh, 2007.
"""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.comparison.published.awang_front import advanced
from meshlab_lowrank.comparison.published.holes import closed, rim_normals
from meshlab_lowrank.comparison.published.rim_unfolding import unfolded
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import (
    FloatArray,
    IntArray,
    corner_sum,
    cotangent_laplacian,
    face_normals,
    normalized,
)
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.stages.stage0_region import Region


def fill(region: Region) -> Region:
    """Fill the loop of a region.

    Raises
    ------
    StageError
        If the rim can't be unfolded, or the fronts can't be closed.
    """
    rim, normals = region.vertices[region.loop], rim_normals(region)
    front = advanced(unfolded(rim, normals))
    flat = np.array(front.points)
    faces = np.array(front.triangles, dtype=np.int64)
    points = placed(flat, faces, rim, normals)
    return closed(region, points[len(rim) :], faces)


def placed(flat: FloatArray, faces: IntArray, rim: FloatArray, normals: FloatArray) -> FloatArray:
    """Place a flat triangulation in space, given its rim and the normals there.

    Parameters
    ----------
    flat : (v, 2) float64
        Those of the rim first.
    faces : (f, 3) int64
    rim, normals : (k, 3) float64

    Returns
    -------
    (v, 3) float64
    """
    v, k = len(flat), len(rim)
    if v == k:
        return rim
    held = np.arange(v) < k
    laplacian = cotangent_laplacian(np.column_stack([flat, np.zeros(v)]), faces)
    start = np.zeros((2, v, 3))
    start[0, :k], start[1, :k] = rim, normals
    membrane, carried = (minimise_with_fixed(laplacian, held, each) for each in start)
    wanted = normalized(carried[faces].sum(axis=1))
    turned = _turned(membrane[faces], face_normals(membrane, faces), wanted)
    laplacian = cotangent_laplacian(membrane, faces)
    free = laplacian[k:]
    right = _divergence(membrane, faces, turned, v)[k:] - free[:, :k] @ rim
    return np.concatenate([rim, factorized(free[:, k:])(np.asarray(right))])


def _turned(corners: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Turn triangles (f, 3, 3) as their normals (f, 3) turn into others, the short way."""
    axis = np.cross(before, after)[:, None]
    cosine = np.einsum("ij,ij->i", before, after)[:, None, None]
    share = (axis * corners).sum(axis=2, keepdims=True) / np.maximum(1.0 + cosine, 1e-6)
    return np.asarray(cosine * corners + np.cross(axis, corners) + share * axis)


def _divergence(vertices: FloatArray, faces: IntArray, turned: FloatArray, n: int) -> FloatArray:
    """Cotangent Laplacian (n, 3) of triangles that don't hang together, summed at the vertices."""
    total = np.zeros_like(turned)
    for corner in range(3):
        one, other = (corner + 1) % 3, (corner + 2) % 3
        u = vertices[faces[:, one]] - vertices[faces[:, corner]]
        w = vertices[faces[:, other]] - vertices[faces[:, corner]]
        area = np.maximum(np.linalg.norm(np.cross(u, w), axis=1), 1e-12)
        cotangent = np.clip((u * w).sum(axis=1) / area, 0.0, 20.0)  # as in the Laplacian
        change = 0.5 * cotangent[:, None] * (turned[:, one] - turned[:, other])
        total[:, one] += change
        total[:, other] -= change
    return corner_sum(faces, total.reshape(-1, 3), n)
