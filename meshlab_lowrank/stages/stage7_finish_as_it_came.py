"""Stage 7: nothing is taken back."""

from __future__ import annotations

from dataclasses import dataclass

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage import Stage


@dataclass(frozen=True)
class AsItCame(Stage):
    """The positions of the vertex update; see `Finish`."""

    def __call__(
        self,
        start: Hole,  # noqa: ARG002
        positions: FloatArray,
        base_normals: FloatArray,  # noqa: ARG002
    ) -> FloatArray:
        """Give the positions back."""
        return positions
