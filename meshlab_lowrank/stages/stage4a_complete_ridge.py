"""Stage 4, completion: ridge regression on the leading singular vectors of the group."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray, normalized
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage3_similar import Groups
from meshlab_lowrank.stages.stage4a_complete import Completed


@dataclass(frozen=True)
class RidgeCompletion(Stage):
    """Least squares in the span of the group, for fully known groups; see `Complete`.

    Parameters
    ----------
    rank : int
        Singular vectors that are used.
    ridge : float
        Share of the leading singular value's weight.
    """

    rank: int = 6
    ridge: float = 0.01

    def __call__(self, values: FloatArray, weights: FloatArray, groups: Groups) -> Completed:
        """Regress the known normals of each target on its group."""
        columns = without_gaps(groups)
        return ridge_completion(values, weights, columns, rank=self.rank, ridge=self.ridge)


def without_gaps(groups: Groups) -> FloatArray:
    """Put the mean of the others where a column of a group, (t, k, 3 sp), has a normal missing."""
    if groups.observed is None:
        return groups.columns
    known = np.repeat(groups.observed, 3, axis=2)
    sums = np.where(known, groups.columns, 0.0).sum(axis=1, keepdims=True)
    mean = sums / np.maximum(known.sum(axis=1, keepdims=True), 1)
    return np.where(known, groups.columns, mean)


def ridge_completion(
    values: FloatArray, weights: FloatArray, groups: FloatArray, *, rank: int, ridge: float
) -> Completed:
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
    Completed
        Unit normals at every sample; the residual is weighted.
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
    return Completed(completed, residual)
