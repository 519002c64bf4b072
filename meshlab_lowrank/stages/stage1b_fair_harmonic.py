"""Stage 1, fairing: the bi- or three-harmonic surface that continues the surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.fairing import NEEDED_RINGS, fair_surfaces, membrane
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_batch import merged
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1b_fair import FairRegion

_TOGETHER = 20_000  # vertices that are faired in one go
_TANGENT = "Its surroundings are too few to foretell a curvature, so only their tangents go on."
_FLAT = "Its surroundings don't determine a smooth fill, so it is closed flat."


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
    """Move the new vertices of many regions onto surfaces that continue the known ones.

    Smoothly, see `fair_surfaces`, or as the continuity of a region asks: flat ones span the rim,
    see `membrane`, those with the tangents of the surroundings are bi-harmonic. Where the
    surroundings don't determine a smooth surface, it is the bi-harmonic one, and where they don't
    determine that, the flat one.

    Parameters
    ----------
    regions : sequence of Region
        With closed loops.
    order : {2, 3}, optional
        Of smooth ones. None: chosen by prediction.

    Returns
    -------
    list of FairRegion or StageError
        Known vertices are where they were.
    """
    sizes = np.cumsum([len(region.vertices) for region in regions]) // _TOGETHER
    kinds = [region.continuity for region in regions]
    found: list[FairRegion | StageError] = [StageError("Nothing was tried.")] * len(regions)
    for chunk, kind in sorted(set(zip(sizes.tolist(), kinds, strict=True))):
        chosen = [i for i, kin in enumerate(kinds) if kin == kind and sizes[i] == chunk]
        alike = [regions[i] for i in chosen]
        if kind == "flat":
            faired: Sequence[FairRegion | StageError] = _flat(alike)
        else:
            faired = _together(alike, 2 if kind == "tangent" else order)
        for i, result in zip(chosen, faired, strict=True):
            found[i] = result
    return found


def _together(regions: Sequence[Region], order: int | None) -> list[FairRegion | StageError]:
    """Fair regions in one go, those apart for which that fails."""
    batch = merged(regions)
    unknown = ~np.concatenate([region.known_vertices for region in regions])
    try:
        faired = fair_surfaces(batch.vertices, batch.faces, unknown, batch.part, order=order)
    except StageError:
        if len(regions) == 1:
            return [_simpler(regions[0], order)]
        half = len(regions) // 2
        return _together(regions[:half], order) + _together(regions[half:], order)
    parts = np.split(faired.positions, np.searchsorted(batch.part, np.arange(1, len(batch))))
    return [
        FairRegion(replace(region, vertices=vertices), float(misfit), order=3 if cubic else 2)
        for region, vertices, misfit, cubic in zip(
            regions, parts, faired.misfit, faired.cubic, strict=True
        )
    ]


def _simpler(region: Region, order: int | None) -> FairRegion | StageError:
    """Fair a region for which the energy of an order has no minimum."""
    if order == 2:
        (faired,) = _flat([region])
        note = _FLAT
    else:
        (faired,) = _together([region], 2)
        note = _TANGENT
    if isinstance(faired, StageError):
        return faired
    return replace(faired, note=faired.note or note)


def _flat(regions: Sequence[Region]) -> list[FairRegion | StageError]:
    """Span regions in one go, those apart for which that fails."""
    batch = merged(regions)
    unknown = ~np.concatenate([region.known_vertices for region in regions])
    try:
        spanned = membrane(batch.vertices, batch.faces, unknown)
    except StageError as error:
        if len(regions) == 1:
            return [error]
        half = len(regions) // 2
        return _flat(regions[:half]) + _flat(regions[half:])
    parts = np.split(spanned, np.searchsorted(batch.part, np.arange(1, len(batch))))
    return [
        FairRegion(replace(region, vertices=vertices), np.nan)
        for region, vertices in zip(regions, parts, strict=True)
    ]
