"""Stage 6, vertex update: Gauss-Newton on heights along the base normals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    cotangent_laplacian,
    face_vectors,
    normalized,
)
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2a_frames import tangent_frames

FACE_WEIGHT = 0.05  # takes the checkerboard away; from 0.3 on detail is lost


@dataclass(frozen=True)
class DirectUpdate(Stage):
    """A few Gauss-Newton steps along the base normals; see `Update` and `direct_update`."""

    steps: int = 5
    face_weight: float = FACE_WEIGHT
    damping: float = 0.01

    def __call__(self, hole: Hole) -> Hole:
        """Move the unknown vertices; see `Update`."""
        positions = direct_update(
            hole.positions,
            hole.faces,
            directions=hole.base_normals,
            movable=hole.unknown,
            normals=hole.normals,
            trusted=hole.weights > 0,
            steps=self.steps,
            face_weight=self.face_weight,
            damping=self.damping,
        )
        return replace(hole, positions=positions)


def direct_update(
    positions: FloatArray,
    faces: IntArray,
    *,
    directions: FloatArray,
    movable: BoolArray,
    normals: FloatArray,
    trusted: BoolArray,
    steps: int = 5,
    face_weight: float = FACE_WEIGHT,
    damping: float = 0.01,
) -> FloatArray:
    """Move vertices along given directions until the normals fit the recovered ones.

    Minimises the tangential parts r of (normal - recovered normal) over the heights h of
    ``x = x0 + h d``, by steps ``(J'J + damping L'L) step = -J'r`` with the cotangent Laplacian L.
    Vertex normals carry the detail exactly but don't see a checkerboard of heights; face normals,
    held against the mean recovered normal of their corners, see it but blur creases, so they
    count less.

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
    face_weight : float
        Weight of a face's residual against a vertex's.
    damping : float
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
    around = faces[touched[faces].any(axis=1)]
    laplacian = cotangent_laplacian(positions, around)[free][:, free]
    held = damping * (laplacian.T @ laplacian)
    fit = _fit(around, touched & trusted, movable, normals, face_weight)
    result = positions.copy()
    for _ in range(steps):
        residual, jacobian = _linearised(result, around, directions, column, fit)
        system = sparse.csr_array(jacobian.T @ jacobian + held)
        step = factorized(system)(-(jacobian.T @ residual))
        result[free] += step[:, None] * directions[free]
    return result


@dataclass(frozen=True)
class _Fit:
    """Normals that are fitted: each is the direction of a sum of area vectors."""

    sums: sparse.csr_array  # (v, m), which faces are summed
    tangents: FloatArray  # (v, 2, 3), plane orthogonal to the recovered normal
    weights: FloatArray  # (v,), square roots


def _fit(
    faces: IntArray, seen: BoolArray, movable: BoolArray, normals: FloatArray, face_weight: float
) -> _Fit:
    """Collect the vertices seen, and the faces that move and whose corners are all seen."""
    fitted = np.flatnonzero(seen)
    row = np.full(len(seen), -1)
    row[fitted] = np.arange(len(fitted))
    corners = row[faces].ravel()
    whole = np.flatnonzero(seen[faces].all(axis=1) & movable[faces].any(axis=1))
    rows = np.concatenate([corners[corners >= 0], len(fitted) + np.arange(len(whole))])
    columns = np.concatenate([np.flatnonzero(corners >= 0) // 3, whole])
    shape = (len(fitted) + len(whole), len(faces))
    sums = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=shape)
    middle = normalized(normals[faces[whole]].sum(axis=1))
    targets = np.concatenate([normals[fitted], middle])
    weights = np.repeat([1.0, np.sqrt(face_weight)], [len(fitted), len(whole)])
    return _Fit(sparse.csr_array(sums.tocsr()), tangent_frames(targets)[:, :2], weights)


def _linearised(
    positions: FloatArray, faces: IntArray, directions: FloatArray, column: IntArray, fit: _Fit
) -> tuple[FloatArray, sparse.csr_array]:
    """Residual r (2 v,) and Jacobian dr/dh (2 v, free) of the fitted normals."""
    v = len(fit.weights)
    sums = fit.sums @ face_vectors(positions, faces)
    lengths = np.maximum(np.linalg.norm(sums, axis=1), 1e-12)
    units = sums / lengths[:, None]
    residual = np.einsum("vaj,vj->va", fit.tangents, units)
    gradients = fit.tangents - residual[..., None] * units[:, None]
    gradients *= (fit.weights / lengths)[:, None, None]  # (v, 2, 3): r against the sums
    pairs = fit.sums.tocoo()
    rows, columns, entries = [], [], []
    for corner in range(3):
        moved, after, before = (faces[:, (corner + i) % 3] for i in range(3))
        change = 0.5 * np.cross(directions[moved], positions[after] - positions[before])
        keep = column[moved[pairs.col]] >= 0
        at, of = pairs.row[keep], pairs.col[keep]
        rows.append(at)
        columns.append(column[moved[of]])
        entries.append(np.einsum("paj,pj->ap", gradients[at], change[of]))
    at, to, values = np.concatenate(rows), np.concatenate(columns), np.hstack(entries)
    shape = (2 * v, int(column.max()) + 1)
    jacobian = sparse.coo_array(
        (values.ravel(), (np.concatenate([at, at + v]), np.concatenate([to, to]))), shape=shape
    )
    return (residual * fit.weights[:, None]).T.ravel(), sparse.csr_array(jacobian.tocsr())
