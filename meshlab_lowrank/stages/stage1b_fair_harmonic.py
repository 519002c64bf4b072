"""Stage 1, fairing: the bi- or three-harmonic surface that continues the surroundings."""

from __future__ import annotations

from dataclasses import dataclass, replace

from meshlab_lowrank.mesh.fairing import fair_surface
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_region import Region


@dataclass(frozen=True)
class HarmonicFairing(Stage):
    """The energy that predicts the surroundings best; see `Fair` and `fair_region`.

    Parameters
    ----------
    order : {2, 3} or None
        None: chosen by prediction.
    """

    order: int | None = None

    def __call__(self, region: Region) -> Region:
        """Move the new vertices; see `Fair`."""
        return fair_region(region, order=self.order)


def fair_region(region: Region, *, order: int | None = None) -> Region:
    """Move the new vertices onto a surface that continues the known one smoothly.

    See `fair_surface`.

    Parameters
    ----------
    region : Region
        With a closed loop.
    order : {2, 3}, optional
        None: chosen by prediction.

    Returns
    -------
    Region
        Known vertices are where they were.
    """
    vertices = fair_surface(region.vertices, region.faces, ~region.known_vertices, order=order)
    return replace(region, vertices=vertices)
