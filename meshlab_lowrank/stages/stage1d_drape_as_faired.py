"""Stage 1, drape: the fill stays where the fairing put it."""

from __future__ import annotations

from dataclasses import dataclass

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.stages.stage import Stage


@dataclass(frozen=True)
class AsFaired(Stage):
    """Leave the fill; see `Drape`."""

    def __call__(self, hole: Hole) -> Hole:
        """Give the same hole."""
        return hole
