"""Stage 4, completion: what is missing in a patch follows from patches like it (Eq. 3).

Variants: `RidgeCompletion`, `SingularValueThresholding`, `GroupMean`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage3_similar import Groups


@dataclass(frozen=True)
class Completed:
    """Targets with their missing normals recovered.

    Attributes
    ----------
    values : (t, sp, 3) float64
        Local normals. A length below 1 tells doubt.
    residual : (t,) float64
        Mean squared distance to the normals that were known: how badly the group fits.
    """

    values: FloatArray
    residual: FloatArray


class Complete(Protocol):
    """Completes targets."""

    def __call__(self, values: FloatArray, weights: FloatArray, groups: Groups) -> Completed:
        """Complete some targets.

        Parameters
        ----------
        values : (t, sp, 3) float64
            Local normals of the targets, zero where missing.
        weights : (t, sp) float64
            0 where missing.
        groups : Groups
            Of these targets.

        Returns
        -------
        Completed
        """
        ...
