"""Stage 1, fairing: the fills continue their surroundings smoothly (section 3.2).

Variants: `HarmonicFairing`, `SplineFairing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.stages.stage0_region import Region


@dataclass(frozen=True)
class FairRegion:
    """A region whose fill has its smooth shape.

    Attributes
    ----------
    region : Region
    misfit : float
        How far a smooth surface misses known vertices around the hole that it is not given: root
        mean square, in local units. NaN where that is not known.
    note : str
        What was done instead where the surroundings don't determine a smooth fill; else empty.
    creases : int
        How many creases of the surroundings were joined across it.
    order : {2, 3}
        Of the harmonic energy that gave the fill its shape.
    """

    region: Region
    misfit: float
    note: str = ""
    creases: int = 0
    order: int = 2


class Fair(Protocol):
    """Gives the fills of regions their smooth shape."""

    @property
    def rings(self) -> int:
        """Rings of vertices around a hole that are looked at."""
        ...

    def __call__(self, regions: Sequence[Region]) -> list[FairRegion | StageError]:
        """Move the new vertices as the regions' continuity asks; known ones stay where they are.

        Returns
        -------
        list of FairRegion or StageError
            The error where no shape can be found.
        """
        ...
