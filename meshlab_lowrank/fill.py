"""What fills one hole."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.gap import Gap
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage0_region import Region


@dataclass(frozen=True)
class Fill:
    """What fills one hole.

    Attributes
    ----------
    region : Region
        Closed.
    positions : (v, 3) float64
        Of its new vertices, in the units of the mesh.
    trust : float
    reason : str
        See `HoleRecord`.
    trusts, errors : (v,) float64
        Of its new vertices, see `InpaintResult`.
    note : str
        What is to be said of its shape.
    is_cut : bool
        Whether it was capped flat for its own shape.
    gap : Gap or None
        Which loops it closes; None for a selected patch.
    crossings, creases : int
        See `HoleRecord`.
    """

    region: Region
    positions: FloatArray
    trust: float
    reason: str
    trusts: FloatArray
    errors: FloatArray
    note: str = ""
    is_cut: bool = False
    gap: Gap | None = None
    crossings: int = 0
    creases: int = 0

    def final(self) -> Region:
        """Give the region with these positions."""
        vertices = self.region.vertices.copy()
        local = (self.positions - self.region.centre) / self.region.scale
        vertices[~self.region.known_vertices] = local
        return replace(self.region, vertices=vertices)

    @property
    def median_error(self) -> float:
        """Median of its error bars; NaN where they are not known."""
        known = len(self.errors) > 0 and np.isfinite(self.errors).all()
        return float(np.median(self.errors)) if known else math.nan

    @property
    def largest_error(self) -> float:
        """Largest of its error bars; NaN where they are not known."""
        return float(self.errors.max()) if len(self.errors) else math.nan

    @property
    def hole(self) -> int:
        """Number of the hole."""
        return -1 if self.gap is None else self.gap.loop.id

    @property
    def islands(self) -> tuple[int, ...]:
        """Numbers of the loops within it that it was closed with."""
        return () if self.gap is None else tuple(loop.id for loop in self.gap.islands)
