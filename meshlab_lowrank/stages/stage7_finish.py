"""Stage 7: the last look at a fill, with the fill without detail beside it.

Variants: `WithoutFlaws`, `AsItCame`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray


class Finish(Protocol):
    """Takes back what the detail made worse."""

    def __call__(self, start: Hole, positions: FloatArray, base_normals: FloatArray) -> FloatArray:
        """Give the final positions.

        Parameters
        ----------
        start : Hole
            The smooth fill.
        positions : (n, 3) float64
            With the detail.
        base_normals : (n, 3) float64
            Of the base that carried it.

        Returns
        -------
        (n, 3) float64
        """
        ...
