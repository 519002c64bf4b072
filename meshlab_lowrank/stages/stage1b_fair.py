"""Stage 1, fairing: the fill continues its surroundings smoothly (section 3.2).

Variant: `HarmonicFairing`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.stages.stage0_region import Region


class Fair(Protocol):
    """Gives the fill of a region its smooth shape."""

    def __call__(self, region: Region) -> Region:
        """Move the new vertices; known ones stay where they are."""
        ...
