"""Stage 4, ridge completion: fill the missing samples of a patch from its group."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray, normalized


def ridge_completion(
    values: FloatArray, weights: FloatArray, groups: FloatArray, *, rank: int, ridge: float
) -> tuple[FloatArray, FloatArray]:
    """Complete patches in the span of the leading singular vectors of their groups.

    For fully known groups the low-rank completion of the paper's Eq. 3 comes down to a ridge
    regression on the right singular vectors V of the group about its mean,
    ``c = (V M V' + ridge diag(s_1^2 / s_i^2))^-1 V M (t - mean)``, with the target's weights M.

    Parameters
    ----------
    values : (t, sp, 3) float64
        Local unit normals of the targets, zero where missing.
    weights : (t, sp) float64
    groups : (t, k, 3 sp) float64
        Similar, fully known patches of each target.
    rank : int
        Singular vectors that are used.
    ridge : float
        Share of the leading singular value's weight.

    Returns
    -------
    completed : (t, sp, 3) float64
        Unit normals at every sample.
    residual : (t,) float64
        Weighted mean squared distance to the known samples.
    """
    count, size = weights.shape
    rank = min(rank, groups.shape[1] - 1)
    mean = groups.mean(axis=1, keepdims=True)
    estimate = mean[:, 0]
    if rank > 0:
        centred = groups - mean
        squared, vectors = np.linalg.eigh(centred @ centred.transpose(0, 2, 1))
        squared = np.maximum(squared[:, : -rank - 1 : -1], 1e-9)  # (t, rank)
        basis = vectors[:, :, : -rank - 1 : -1].transpose(0, 2, 1) @ centred
        basis /= np.sqrt(squared)[..., None]  # (t, rank, 3 sp)
        weighted = basis * np.repeat(weights, 3, axis=1)[:, None]
        penalty = ridge * squared[:, :1] / squared
        system = weighted @ basis.transpose(0, 2, 1) + penalty[:, :, None] * np.eye(rank)
        deviation = values.reshape(count, -1, 1) - mean.transpose(0, 2, 1)
        coefficients = np.linalg.solve(system, weighted @ deviation)
        estimate = estimate + (coefficients.transpose(0, 2, 1) @ basis)[:, 0]
    completed = normalized(estimate.reshape(count, size, 3))
    squares = np.einsum("tsi,tsi->ts", completed - values, completed - values)
    residual = np.einsum("ts,ts->t", squares, weights) / np.maximum(weights.sum(axis=1), 1e-12)
    return completed, residual
