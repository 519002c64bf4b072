"""How far detail can be believed in each place of a hole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole, depth_of
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.mesh.windows import window_means
from meshlab_lowrank.tuning.conflict import conflicts
from meshlab_lowrank.tuning.judging import Evidence

RADIUS = 7.0  # edge lengths: as wide as the largest fake holes, whose conflicts it is held against
_STEPS = 8.0  # in a factor of e of the conflict; trust changes little from one to the next
_LEAST = 1e-3  # conflict


@dataclass(frozen=True)
class LocalTrust:
    """How strongly detail is put on at some points.

    Attributes
    ----------
    points : (u, 3) float64
    strength : (u,) float64
        Factor from 0 to 1.
    """

    points: FloatArray
    strength: FloatArray

    def at(self, places: FloatArray) -> FloatArray:
        """Read the strength at the point nearest to each place (p, 3)."""
        return np.asarray(self.strength[cKDTree(self.points).query(places)[1]])


def local_trust(evidence: Evidence, solved: Hole, points: FloatArray) -> LocalTrust:
    """Judge each place of a hole; ``points`` are where its vertices are read, (n, 3)."""
    return LocalTrust(points[solved.unknown], local_strength(evidence, solved))


def local_strength(evidence: Evidence, solved: Hole) -> FloatArray:
    """Judge each place of a hole by the conflict around it.

    Parameters
    ----------
    evidence : Evidence
    solved : Hole
        After the vertex update.

    Returns
    -------
    (u,) float64
        Factor from 0 to 1 for the detail at each unknown vertex; little where detail would not be
        worthwhile with such a conflict.
    """
    unknown = solved.unknown
    step = np.rint(_STEPS * np.log(np.maximum(conflicts(solved, unknown, RADIUS), _LEAST)))
    depth = depth_of(solved)[unknown]
    factor = np.zeros(len(step))
    for each in np.unique(step):
        trust, alike = evidence.trust(float(np.exp(each / _STEPS))), step == each
        if trust.worthwhile:
            factor[alike] = trust.at(depth[alike])
    return window_means(solved.positions[unknown], factor[:, None], RADIUS)[:, 0]
