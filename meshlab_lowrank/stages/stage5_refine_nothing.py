"""Stage 5: no refinement."""

from __future__ import annotations

from dataclasses import dataclass

from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage4b_diffuse import Omega


@dataclass(frozen=True)
class NoRefinement(Stage):
    """Patches stay as they were completed; see `Refine`."""

    def __call__(self, omega: Omega) -> Omega:
        """Give the patches back."""
        return omega
