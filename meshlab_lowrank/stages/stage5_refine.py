"""Stage 5: refinement of all completed patches together (section 3.4.3).

Variants: `TruncatedGammaNorm`, `NoRefinement`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.stages.stage4b_diffuse import Omega


class Refine(Protocol):
    """Refines the completed patches."""

    def __call__(self, omega: Omega) -> Omega:
        """Give Omega_D for Omega'_M."""
        ...
