"""Stage 6, direct vertex update: Gauss-Newton on heights along the base normals."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    corner_sum,
    cotangent_laplacian,
    face_vectors,
)
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.stage2_patches import tangent_frames


def direct_update(
    positions: FloatArray,
    faces: IntArray,
    *,
    directions: FloatArray,
    movable: BoolArray,
    normals: FloatArray,
    trusted: BoolArray,
    steps: int = 5,
    smoothness: float = 0.01,
) -> FloatArray:
    """Move vertices along given directions until their normals fit the recovered ones.

    Minimises the tangential part r of (vertex normal - recovered normal) over the heights h of
    ``x = x0 + h d``, with the damping ``(J'J + smoothness L'L) step = -J'r`` of the cotangent
    Laplacian L, which holds the checkerboard that vertex normals don't see.

    Parameters
    ----------
    positions : (n, 3) float64
        Start; in mean edge lengths.
    faces : (m, 3) int64
    directions : (n, 3) float64
        Unit vectors d, the base normals.
    movable : (n,) bool
        Vertices that may move.
    normals : (n, 3) float64
        Recovered unit normals.
    trusted : (n,) bool
        Vertices whose recovered normal is to be fitted; those away from movable ones are ignored.
    steps : int
        Gauss-Newton steps.
    smoothness : float
        Weight of the damping.

    Returns
    -------
    (n, 3) float64
        Equal to the start, bit for bit, where vertices may not move.
    """
    n = len(positions)
    free = np.flatnonzero(movable)
    column = np.full(n, -1)
    column[free] = np.arange(len(free))
    touched = np.zeros(n, dtype=np.bool_)
    touched[faces[movable[faces].any(axis=1)]] = True
    fitted = np.flatnonzero(touched & trusted)
    row = np.full(n, -1)
    row[fitted] = np.arange(len(fitted))
    near = faces[(row[faces] >= 0).any(axis=1)]
    tangents = tangent_frames(normals[fitted])[:, :2]  # (v, 2, 3)
    around = faces[touched[faces].any(axis=1)]
    laplacian = cotangent_laplacian(positions, around)[free][:, free]
    damping = smoothness * (laplacian.T @ laplacian)
    result = positions.copy()
    for _ in range(steps):
        residual, jacobian = _linearised(result, near, directions, (column, row), tangents)
        system = sparse.csr_array(jacobian.T @ jacobian + damping)
        step = factorized(system)(-(jacobian.T @ residual))
        result[free] += step[:, None] * directions[free]
    return result


def _linearised(
    positions: FloatArray,
    faces: IntArray,
    directions: FloatArray,
    numbers: tuple[IntArray, IntArray],
    tangents: FloatArray,
) -> tuple[FloatArray, sparse.csr_array]:
    """Residual r (2 v,) and Jacobian dr/dh (2 v, free) of the vertex normals.

    ``numbers`` gives each vertex its column among the free and its row among the fitted, or -1.
    """
    column, row = numbers
    n, v = len(positions), len(tangents)
    fitted = np.flatnonzero(row >= 0)
    sums = corner_sum(faces, np.repeat(face_vectors(positions, faces), 3, axis=0), n)[fitted]
    lengths = np.maximum(np.linalg.norm(sums, axis=1), 1e-12)
    units = sums / lengths[:, None]
    residual = np.einsum("vaj,vj->av", tangents, units)  # (2, v)
    gradients = tangents - residual.T[..., None] * units[:, None]
    gradients /= lengths[:, None, None]  # (v, 2, 3): residual against the sum of area vectors
    rows, columns, entries = [], [], []
    for corner in range(3):
        moved, after, before = (faces[:, (corner + i) % 3] for i in range(3))
        change = 0.5 * np.cross(directions[moved], positions[after] - positions[before])
        for seen in faces.T:
            pairs = np.flatnonzero((column[moved] >= 0) & (row[seen] >= 0))
            at = row[seen[pairs]]
            rows.append(at)
            columns.append(column[moved[pairs]])
            entries.append(np.einsum("paj,pj->ap", gradients[at], change[pairs]))
    at, to, values = np.concatenate(rows), np.concatenate(columns), np.hstack(entries)
    shape = (2 * v, int(column.max()) + 1)
    jacobian = sparse.coo_array(
        (values.ravel(), (np.concatenate([at, at + v]), np.concatenate([to, to]))), shape=shape
    )
    return residual.ravel(), sparse.csr_array(jacobian.tocsr())
