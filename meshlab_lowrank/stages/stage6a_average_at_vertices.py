"""Stage 6, averaging: weighted means at the vertices, without the blur of the interpolation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole, with_recovered
from meshlab_lowrank.mesh.geometry import FloatArray, normalized
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage4b_diffuse import Omega

_COPYING = 0.7  # see `AverageAtVertices`
_LARGEST_GAIN = 1.5  # of the lean of normals
_NEAR = 4.0  # measured normals count by their distance from the hole, over this length


@dataclass(frozen=True)
class AverageAtVertices(Stage):
    """Means of the rotated normals, weighted by the votes; see `Average`.

    Parameters
    ----------
    corrections : int
        Of the blur that interpolation to samples and back leaves; 0 for samples at vertices.
    amplify : float
        How far averages lean from the base as measured normals nearby do, as an exponent: 0 for
        as they come, 1 for as far. Averaging loses some of the lean, but measured normals at sharp
        edges, which no recovered one has, count for too much.
    at_last : float
        The same for the last pass: in all of them it would let the least rounding grow.
    """

    corrections: int = 0
    amplify: float = 0.0
    at_last: float = 0.0

    def normals(self, omega: Omega) -> tuple[FloatArray, FloatArray]:
        """Average at the vertices; see `Average`."""
        values = (omega.values @ omega.patches.frames).reshape(-1, 3)  # n^T R_i = (R_i^-1 n)^T
        votes, sampler = omega.votes.ravel(), omega.patches.sampler
        back = sparse.csr_array(sampler.T)
        weight = back @ votes
        if self.corrections == 0:
            return normalized(back @ (values * votes[:, None])), weight
        share = np.divide(1.0, weight, out=np.zeros_like(weight), where=weight > 0)[:, None]
        normals = share * (back @ (values * votes[:, None]))
        for _ in range(self.corrections):
            normals = normals + share * (back @ ((values - sampler @ normals) * votes[:, None]))
        return normalized(normals), weight

    def __call__(self, hole: Hole, omega: Omega) -> Hole:
        """Give the hole the averages; see `Average`."""
        normals, votes = self.normals(omega)
        hole = with_recovered(hole, normals, ~hole.measured & (votes > 0.0))
        return amplified(hole, self.amplify) if self.amplify > 0.0 else hole

    def for_last(self) -> AverageAtVertices:
        """Make up for some of the lean that averaging loses."""
        return replace(self, amplify=self.at_last)

    def for_copying(self) -> AverageAtVertices:
        """Make up for most of it."""
        return replace(self, amplify=_COPYING)


def amplified(hole: Hole, exponent: float) -> Hole:
    """Lean recovered normals away from the base about as far as measured ones nearby do."""
    upright = np.einsum("ij,ij->i", hole.normals, hole.base_normals)
    lean = 1.0 - np.clip(upright, 0.0, 1.0) ** 2
    recovered = ~hole.measured & (hole.weights > 0)
    if not recovered.any():
        return hole
    away = cKDTree(hole.base[hole.unknown]).query(hole.base[hole.measured])[0]
    usual = np.average(lean[hole.measured], weights=1.0 / (away + _NEAR) ** 2)
    gain = (usual / max(lean[recovered].mean(), 1e-12)) ** (0.5 * exponent)
    gain = np.clip(gain, 1.0, _LARGEST_GAIN)
    along = upright[:, None] * hole.base_normals
    leaning = normalized(along + gain * (hole.normals - along))
    return replace(hole, normals=np.where(recovered[:, None], leaning, hole.normals))
