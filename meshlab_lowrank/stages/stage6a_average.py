"""Stage 6, averaging: the normals of overlapping patches become one at each vertex (3.4.3).

Variant: `AverageAtVertices`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage4b_diffuse import Omega


class Average(Protocol):
    """Brings the normals of patches to the vertices."""

    def normals(self, omega: Omega) -> tuple[FloatArray, FloatArray]:
        """Average at the vertices.

        Parameters
        ----------
        omega : Omega
            Patches over n vertices.

        Returns
        -------
        normals : (n, 3) float64
            Unit normals; zero where nothing votes.
        votes : (n,) float64
            Sum of the weights.
        """
        ...

    def __call__(self, hole: Hole, omega: Omega) -> Hole:
        """Give the hole the averages where its normals were not measured."""
        ...
