"""Stage 6, vertex update: steps that turn edges orthogonal to the recovered normals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    corner_sum,
    edge_lengths,
    normalized,
    vertex_normals,
)
from meshlab_lowrank.stages.stage import Stage


@dataclass(frozen=True)
class IterativeUpdate(Stage):
    """The usual iteration; see `Update` and `iterative_update`.

    Parameters
    ----------
    niter : int
        Steps.
    """

    niter: int = 20

    def __call__(self, hole: Hole) -> Hole:
        """Move the unknown vertices; where no normal was recovered, to that of the smooth fill."""
        smooth = vertex_normals(hole.positions, hole.faces)
        found = hole.normals.any(axis=1, keepdims=True)
        normals = np.where(found, hole.normals, smooth)
        positions = iterative_update(
            hole.positions, hole.faces, normals, hole.unknown, niter=self.niter
        )
        return replace(hole, positions=positions, normals=normals)


def iterative_update(
    positions: FloatArray,
    faces: IntArray,
    normals: FloatArray,
    movable: BoolArray,
    *,
    niter: int = 20,
    tol: float = 1e-6,
    callback: Callable[[FloatArray], object] | None = None,
) -> FloatArray:
    """Update vertex positions from vertex normals by the usual fixed-step iteration.

    The normal n_f of a face is the mean of the normals at its corners; with the face's centre c_f,
    every vertex that may move goes by the mean over its faces::

        v <- v + 1 / |F(v)| sum_f n_f (n_f . (c_f - v))

    which is gradient descent on ``sum (n_f . (v_i - v_j))^2`` over the edges of all faces. The
    number of steps regularises: detail comes first, the errors of the normals add up later.

    Parameters
    ----------
    positions : (n, 3) float64
        Start, the base structure.
    faces : (m, 3) int64
    normals : (n, 3) float64
        Unit normals; zero where not known.
    movable : (n,) bool
        All other vertices keep their positions bit for bit.
    niter : int
        Steps.
    tol : float
        Done when no vertex moves further than this part of the mean edge length.
    callback : callable, optional
        Called with the positions after every step.

    Returns
    -------
    (n, 3) float64

    References
    ----------
    Sun, Rosin, Martin and Langbein, Fast and effective feature-preserving mesh denoising, 2007.
    """
    around = faces[movable[faces].any(axis=1)]
    result = positions.copy()
    if len(around) == 0:
        return result
    used, corners = np.unique(around, return_inverse=True)
    corners = corners.reshape(-1, 3)
    local, free = positions[used], movable[used]
    targets = normalized(normals[around].sum(axis=1))[:, None]  # (m', 1, 3)
    count = np.bincount(corners.ravel(), minlength=len(used))[free, None]
    limit = tol * edge_lengths(local, corners).mean()
    for _ in range(niter):
        offsets = local[corners].mean(axis=1, keepdims=True) - local[corners]
        pulls = (offsets * targets).sum(axis=2, keepdims=True) * targets
        step = corner_sum(corners, pulls.reshape(-1, 3), len(used))[free] / count
        local[free] += step
        if callback is not None:
            result[used[free]] = local[free]
            callback(result)
        if np.abs(step).max() <= limit:
            break
    result[used[free]] = local[free]
    return result
