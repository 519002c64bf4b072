"""Smooth fills of holes: closed and faired, and in another way where that folds the surface."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.edge_flips import count_folds
from meshlab_lowrank.mesh.geometry import face_vectors
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1b_fair import FairRegion

_FLAT = 1e-9  # area of a face that has none, in squared mean edge lengths
_IN_PLANE = "It was triangulated in the plane of its rim, as its usual closing folds."
_TANGENT = "It goes on with tangents only, as more folds it."
_CAPPED = "It is closed flat, as a smooth continuation folds it."


def smooth_fills(
    regions: Sequence[Region],
    lengths: Sequence[float | None],
    pipeline: Pipeline,
    report: Callable[[str], object],
) -> list[FairRegion | StageError]:
    """Close and fair regions, all together; those that fold or stay open once more, otherwise.

    Of the ways to close a region, the first without folded edges and faces without area counts;
    if there is none, that with the fewest.

    Parameters
    ----------
    regions : sequence of Region
        Open at their loops.
    lengths : sequence of float or None
        Edge lengths of the fills, see `Close`.
    pipeline : Pipeline
    report : callable
        Called with the name of each stage that begins.

    Returns
    -------
    list of FairRegion or StageError
        The error where no way closes it.
    """
    report("closing")
    closed = pipeline.close(regions, edge_lengths=lengths)
    report("fairing")
    whole = [each for each in closed if isinstance(each, Region)]
    faired = iter(pipeline.fair(whole))
    found = [next(faired) if isinstance(each, Region) else each for each in closed]
    return [
        result if flaws(result) == 0 else _otherwise(region, length, pipeline, result)
        for region, length, result in zip(regions, lengths, found, strict=True)
    ]


def flaws(result: FairRegion | StageError) -> float:
    """Count folded edges and faces without area of a fill; infinite if there is none."""
    if isinstance(result, StageError):
        return np.inf
    region = result.region
    if not np.isfinite(region.vertices).all():
        return np.inf
    return sum(flaws_of(region))


def flaws_of(region: Region) -> tuple[int, int]:
    """Count the folded edges and the faces without area of the fill of a region."""
    new = ~region.known_faces
    areas = np.linalg.norm(face_vectors(region.vertices, region.faces[new]), axis=1)
    folds = count_folds(region.vertices, region.faces, new)
    return folds, int(np.count_nonzero(areas < _FLAT))


def _otherwise(
    region: Region, length: float | None, pipeline: Pipeline, first: FairRegion | StageError
) -> FairRegion | StageError:
    best, least = first, flaws(first)
    for result in _other_ways(region, length, pipeline):
        count = flaws(result)
        if count < least:
            best, least = result, count
        if least == 0:
            break
    return best


def _other_ways(
    region: Region, length: float | None, pipeline: Pipeline
) -> Iterator[FairRegion | StageError]:
    (closed,) = pipeline.close_again([region], edge_lengths=[length])
    if isinstance(closed, StageError):
        yield closed
        return
    ways = {region.continuity: "", "tangent": _TANGENT, "flat": _CAPPED}
    for continuity, note in ways.items():
        (result,) = pipeline.fair([replace(closed, continuity=continuity)])
        if isinstance(result, FairRegion):
            notes = filter(None, (_IN_PLANE, note, result.note))
            kept = replace(result.region, continuity=region.continuity)
            result = replace(result, region=kept, note=" ".join(notes))
        yield result
