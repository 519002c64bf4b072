"""Similarity of patches and packing of similar ones (paper, sections 3.3.2 and 3.3.3)."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray

_RIDGE = 1e-12  # part of the trace added to the diagonal: cylinders have singular covariances
_PAIRS_AT_ONCE = 1 << 15  # keeps the work arrays of d_NPC in the processor's cache


def normal_patch_covariance(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the normal patch covariance (NPC) of each patch, Eq. 1.

    ``C(v_i) = 1/sp sum_j (n_j - n_mean)(n_j - n_mean)^T`` over all sp samples, missing normals
    entering as zero vectors, as in the paper.

    Parameters
    ----------
    values : (w, sp, 3) float64
        Normals in the frames of their patches, zero where missing.

    Returns
    -------
    means : (w, 3) float64
        Mean normals.
    covariances : (w, 3, 3) float64
        Symmetric positive semi-definite.
    """
    means = values.mean(axis=1)
    centred = values - means[:, None]
    return means, centred.transpose(0, 2, 1) @ centred / values.shape[1]


def npc_distance(
    means_a: FloatArray, covariances_a: FloatArray, means_b: FloatArray, covariances_b: FloatArray
) -> FloatArray:
    """Compute the distance d_NPC of every patch of a set a to every patch of a set b, Eq. 2.

    ``d^2 = d_n^T (C_i + C_j)^-1 d_n`` with the difference d_n of the mean normals. The special
    cases of the paper: equal mean normals give 0, whatever the covariances; two zero covariances
    (both patches planar) with different means are infinitely far apart, the limit of Eq. 2. A
    singular sum that is not zero gets 1e-12 of its trace on the diagonal.

    Parameters
    ----------
    means_a, means_b : (a, 3), (b, 3) float64
    covariances_a, covariances_b : (a, 3, 3), (b, 3, 3) float64

    Returns
    -------
    (a, b) float64
    """
    difference = means_a[:, None] - means_b[None]  # (a, b, 3)
    entries = [(0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2)]
    s00, s10, s20, s11, s21, s22 = (
        covariances_a[:, None, i, j] + covariances_b[None, :, i, j] for i, j in entries
    )
    trace = s00 + s11 + s22
    planar = trace == 0.0
    ridge = np.where(planar, 1.0, _RIDGE * trace)
    # L D L^T of the sum, written out: thousands of times faster than a solver call per pair
    d0 = s00 + ridge
    l10, l20 = s10 / d0, s20 / d0
    d1 = s11 + ridge - l10 * s10
    m21 = s21 - l20 * s10
    l21 = m21 / d1
    d2 = s22 + ridge - l20 * s20 - l21 * m21
    y0 = difference[..., 0]
    y1 = difference[..., 1] - l10 * y0
    y2 = difference[..., 2] - l20 * y0 - l21 * y1
    squared = y0**2 / d0 + y1**2 / d1 + y2**2 / d2
    return np.sqrt(np.where(planar & (squared > 0.0), np.inf, squared))


def most_similar(means: FloatArray, covariances: FloatArray, targets: IntArray, k: int) -> IntArray:
    """Find the k patches with the least d_NPC to each target, the target itself left out.

    Parameters
    ----------
    means : (w, 3) float64
    covariances : (w, 3, 3) float64
    targets : (t,) int64
    k : int
        Cut to w - 1 where there are too few patches.

    Returns
    -------
    (t, k) int64
        Nearest first, ties in the order of the patches.
    """
    w = len(means)
    k = min(k, w - 1)
    chosen = np.zeros((len(targets), k), dtype=np.int64)
    step = max(1, _PAIRS_AT_ONCE // w)
    for begin in range(0, len(targets), step):
        rows = targets[begin : begin + step]
        distance = npc_distance(means[rows], covariances[rows], means, covariances)
        distance[np.arange(len(rows)), rows] = np.nan  # sorts behind every number
        chosen[begin : begin + step] = np.argsort(distance, axis=1, kind="stable")[:, :k]
    return chosen


def global_matrix(values: FloatArray) -> FloatArray:
    """Pack patches into the global normal patch group matrix Omega_M (Fig. 7).

    Parameters
    ----------
    values : (w, sp, 3) float64

    Returns
    -------
    (3 sp, w) float64
        One patch a column: x, y, z of its first normal, then of its second, ...
    """
    return values.reshape(len(values), -1).T


def similar_groups(
    values: FloatArray, mask: BoolArray, targets: IntArray, similar: IntArray
) -> tuple[FloatArray, BoolArray]:
    """Pack the similar normal patch group matrices Omega_p of some targets (Fig. 8).

    Parameters
    ----------
    values : (w, sp, 3) float64
    mask : (w, sp) bool
        Samples that are known.
    targets : (t,) int64
    similar : (t, k) int64

    Returns
    -------
    groups : (t, 3 sp, k + 1) float64
        The target is the first column.
    observed : (t, 3 sp, k + 1) bool
        The entries that the sampling operator P of Eq. 3 keeps.
    """
    members = np.concatenate([targets[:, None], similar], axis=1)
    t, columns = members.shape
    groups = values[members].reshape(t, columns, -1).transpose(0, 2, 1)
    observed = np.repeat(mask[members], 3, axis=2).transpose(0, 2, 1)
    return groups, observed
