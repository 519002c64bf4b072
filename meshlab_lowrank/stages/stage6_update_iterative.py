"""Stage 6 of the paper: move vertices so that edges become orthogonal to recovered normals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    corner_sum,
    edge_lengths,
    normalized,
)


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
