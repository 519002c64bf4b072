"""What a fill says of itself: whether the recovered normals fit a surface that meets the rim."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import BoolArray, vertex_normals

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
    asked, base = solved.normals[told], solved.base_normals[told]
    given = vertex_normals(solved.positions, solved.faces)[told]
    missed = ((given - asked) ** 2).sum(axis=1).mean()
    upright = np.clip(np.einsum("ij,ij->i", asked, base), 0.0, 1.0)
    return float(missed / max(float((1.0 - upright**2).mean()), _LEAST_LEAN))
