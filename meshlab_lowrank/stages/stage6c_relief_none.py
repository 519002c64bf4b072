"""Stage 6, relief: none of its own; all detail is recovered from normals."""

from __future__ import annotations

from dataclasses import dataclass

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.stages.stage import Stage


@dataclass(frozen=True)
class NoRelief(Stage):
    """Leave the hole to the recovered normals; see `Relief`."""

    def __call__(self, hole: Hole) -> Hole | None:  # noqa: ARG002
        """Give nothing."""
        return None

    def calmed(self, hole: Hole) -> Hole:
        """Leave it as it is."""
        return hole
