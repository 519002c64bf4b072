"""How far recovered detail can be believed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray

DEPTHS = np.array([1.0, 3.0, 6.0])  # mean edge lengths from the rim
_LEAST_EXPLAINED = 0.25  # below it, detail did harm as often as good where nothing repeats


@dataclass(frozen=True)
class Trust:
    """How far recovered detail can be believed.

    Attributes
    ----------
    strength : (3,) float64
        Factors from 0 to 1 for the recovered detail at `DEPTHS`.
    explained : float
        Part of the variance of the true detail that was recovered, from 0 to 1.
    left : (3,) float64, optional
        Part of it that is missed at `DEPTHS` where the detail is put on with this strength; above 1
        where it does harm. By default what is not explained.
    left_by_whole : (3,) float64, optional
        Likewise where all of it is put on.
    """

    strength: FloatArray
    explained: float
    left: FloatArray | None = None
    left_by_whole: FloatArray | None = None

    @property
    def worthwhile(self) -> bool:
        """Whether detail is likelier to help than to harm.

        A quarter of the variance has to be recovered, and what comes next to the rim, where most
        is known, must not be wrong.
        """
        return bool(self.explained >= _LEAST_EXPLAINED and self.strength[0] > 0.0)

    def at(self, depth: FloatArray) -> FloatArray:
        """Factor at distances from the rim, (n,) float64 in mean edge lengths."""
        return np.interp(depth, DEPTHS, self.strength)

    def missed(self, depth: FloatArray, *, whole: bool) -> FloatArray:
        """Part of the variance that is missed at distances from the rim, (n,) float64.

        Deeper than trials go it grows with the depth, up to all of it: detail is recovered from
        the rim inwards, and what is wrong is handed on.
        """
        left = self.left_by_whole if whole else self.left
        if left is None:
            return np.full(len(depth), 1.0 - self.explained)
        near = np.interp(depth, DEPTHS, left)
        grown = near * np.maximum(depth / DEPTHS[-1], 1.0)
        return np.asarray(np.maximum(np.minimum(grown, 1.0), near))
