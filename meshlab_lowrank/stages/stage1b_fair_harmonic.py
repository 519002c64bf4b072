"""Stage 1, fairing: the bi- or three-harmonic surface that continues the surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.fairing import NEEDED_RINGS, fair_surfaces
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_batch import merged
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1b_fair import FairRegion

_TOGETHER = 20_000  # vertices that are faired in one go


@dataclass(frozen=True)
class HarmonicFairing(Stage):
    """The energy that predicts the surroundings best; see `Fair` and `fair_regions`.

    Parameters
    ----------
    order : {2, 3} or None
        None: chosen by prediction.
    """

    order: int | None = None

    @property
    def rings(self) -> int:
        """Rings of vertices around a hole that the two energies look at."""
        return NEEDED_RINGS

    def __call__(self, regions: Sequence[Region]) -> list[FairRegion | StageError]:
        """Move the new vertices; see `Fair`."""
        return fair_regions(regions, order=self.order)


def fair_region(region: Region, *, order: int | None = None) -> Region:
    """Move the new vertices onto a surface that continues the known one smoothly.

    See `fair_surface`; this is the case of one region of `fair_regions`.

    Raises
    ------
    StageError
        If the surroundings don't determine a smooth fill.
    """
    (result,) = fair_regions([region], order=order)
    if isinstance(result, StageError):
        raise result
    return result.region


def fair_regions(
    regions: Sequence[Region], *, order: int | None = None
) -> list[FairRegion | StageError]:
    """Move the new vertices of many regions onto surfaces that continue the known ones smoothly.

    See `fair_surfaces`.

    Parameters
    ----------
    regions : sequence of Region
        With closed loops.
    order : {2, 3}, optional
        None: chosen by prediction.

    Returns
    -------
    list of FairRegion or StageError
        Known vertices are where they were.
    """
    sizes = np.cumsum([len(region.vertices) for region in regions]) // _TOGETHER
    found: list[FairRegion | StageError] = []
    for chunk in np.unique(sizes):
        first, last = np.searchsorted(sizes, [chunk, chunk + 1])
        found += _together(regions[first:last], order)
    return found


def _together(regions: Sequence[Region], order: int | None) -> list[FairRegion | StageError]:
    """Fair regions in one go, those apart for which that fails."""
    batch = merged(regions)
    unknown = ~np.concatenate([region.known_vertices for region in regions])
    try:
        faired = fair_surfaces(batch.vertices, batch.faces, unknown, batch.part, order=order)
    except StageError as error:
        if len(regions) == 1:
            return [error]
        half = len(regions) // 2
        return _together(regions[:half], order) + _together(regions[half:], order)
    parts = np.split(faired.positions, np.searchsorted(batch.part, np.arange(1, len(batch))))
    return [
        FairRegion(replace(region, vertices=vertices), float(misfit))
        for region, vertices, misfit in zip(regions, parts, faired.misfit, strict=True)
    ]
