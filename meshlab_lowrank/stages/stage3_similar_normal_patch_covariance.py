"""Stage 3, similar patches: least distance of normal patch covariances (3.3.2, 3.3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2b_patches import Patches, PatchLayer
from meshlab_lowrank.stages.stage3_similar import Columns, Groups, PatchLibrary, Sources

_RIDGE = 1e-12  # part of the trace added to the diagonal: cylinders have singular covariances
_PAIRS_AT_ONCE = 1 << 15  # keeps the work arrays of d_NPC in the processor's cache


@dataclass(frozen=True)
class NormalPatchCovariance(Stage):
    """All patches of Omega_M compared among themselves, incomplete ones too; see `Similar`.

    Parameters
    ----------
    k : int
        Similar patches per group. The paper gives no number; 20 and 40 took longer than 10 and
        were no better.
    """

    k: int = 10

    def library(self, hole: Hole, layer: PatchLayer, radius: float) -> PatchLibrary:  # noqa: ARG002
        """Pack nothing."""
        return PatchLibrary(np.zeros((0, 3 * layer.size), dtype=np.float32), np.zeros((0, 3)))

    def sources(
        self,
        hole: Hole,  # noqa: ARG002
        targets: Patches,
        library: PatchLibrary,
        radius: float,  # noqa: ARG002
    ) -> Sources | None:
        """Let every target take every other."""
        return Sources(library) if len(targets) > 1 else None

    def search(self, columns: Columns, sources: Sources) -> CovarianceSearch:  # noqa: ARG002
        """Compute the covariances of all columns."""
        means, covariances = normal_patch_covariance(columns.values)
        return CovarianceSearch(columns, means, covariances, self.k)


@dataclass(frozen=True)
class CovarianceSearch:
    """Looks for the columns nearest in d_NPC; see `Search`."""

    columns: Columns
    means: FloatArray
    covariances: FloatArray
    k: int

    def __call__(self, rows: IntArray, listed: IntArray | None = None) -> Groups:
        """Compare with all columns; a list is only taken from, as it holds no more than k."""
        similar = listed
        if similar is None:
            similar = most_similar(self.means, self.covariances, rows, self.k)
        observed = self.columns.weights[similar] > 0.0
        columns = self.columns.values[similar].reshape(*similar.shape, -1)
        return Groups(columns, observed, similar)


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
