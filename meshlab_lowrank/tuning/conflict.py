"""What a fill says of itself: whether the recovered normals fit a surface that meets the rim."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, vertex_normals
from meshlab_lowrank.mesh.windows import window_means

_LEAST_LEAN = 1e-6
UNRECOVERED = 1.0


def conflict(solved: Hole, chosen: BoolArray) -> float:
    """Tell how far recovered normals contradict the surface that was fitted to them.

    Detail that is true fits the rim on all sides of a hole. Copies of the wrong detail, or of the
    right one out of step, can't all be met by one surface that is held at its rim, and the normals
    of the compromise differ from those asked for. No truth is needed to see that.

    Parameters
    ----------
    solved : Hole
        After the vertex update.
    chosen : (n,) bool
        Vertices that are looked at; those without a recovered normal tell nothing.

    Returns
    -------
    float
        Mean squared difference of the normals, over the mean squared lean of the recovered ones
        from the base: below 0.05 where detail is right, 0.2 and more where most of it is wrong.
        1 where nothing was recovered.
    """
    told = chosen & (solved.weights > 0.0)
    if not told.any():
        return UNRECOVERED
    missed, lean = _missed_and_lean(solved, told).mean(axis=0)
    return float(missed / max(float(lean), _LEAST_LEAN))


def conflicts(solved: Hole, chosen: BoolArray, radius: float) -> FloatArray:
    """Give the `conflict` of what lies around each of the chosen vertices.

    Detail may be right in one half of a hole and not in the other, and where it is strong it hides
    the conflict of the other half.

    Parameters
    ----------
    solved : Hole
        After the vertex update.
    chosen : (n,) bool
    radius : float
        How far around a vertex is looked, in mean edge lengths.

    Returns
    -------
    (c,) float64
        Of the chosen vertices.
    """
    told = chosen & (solved.weights > 0.0)
    both = np.zeros((len(chosen), 2))
    both[told] = _missed_and_lean(solved, told)
    missed, lean = window_means(solved.positions[chosen], both[chosen], radius).T
    return np.where(lean > 0.0, missed / np.maximum(lean, _LEAST_LEAN), UNRECOVERED)


def _missed_and_lean(solved: Hole, chosen: BoolArray) -> FloatArray:
    """Squared difference of normals, and squared lean of those asked for, (c, 2)."""
    asked, base = solved.normals[chosen], solved.base_normals[chosen]
    given = vertex_normals(solved.positions, solved.faces)[chosen]
    upright = np.clip(np.einsum("ij,ij->i", asked, base), 0.0, 1.0)
    return np.stack([((given - asked) ** 2).sum(axis=1), 1.0 - upright**2], axis=1)
