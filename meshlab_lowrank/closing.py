"""Smooth fills of regions: closed and faired, and in another way where that has flaws."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill_shape import shapes_of
from meshlab_lowrank.parameters import Continuation
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1b_fair import FairRegion

_FOLDS = "folds"
_COARSER = 1.1
_COARSENED = (
    "Its edges are {:.1f} times as long as those around, as it would have too many faces for its "
    "rim or the mesh otherwise; refineedgelen sets their length."
)
_IN_PLANE = "It was triangulated in the plane of its rim, as its usual closing {}."
_TANGENT = "It goes on with tangents only, as a smoother fill {}."
_CAPPED = "It is closed flat, as a smooth continuation {}."


def smooth_fills(
    regions: Sequence[Region],
    lengths: Sequence[float | None],
    pipeline: Pipeline,
    report: Callable[[str], object],
) -> list[FairRegion | StageError]:
    """Close and fair regions, all together; those that fold or stay open once more, otherwise.

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
    return otherwise(
        regions,
        lengths,
        pipeline,
        found,
        count=flaws,
        fault=_FOLDS,
    )


def explained(fill: FairRegion | StageError) -> FairRegion | StageError:
    """Say of a fill that its triangles are longer than those around."""
    if isinstance(fill, StageError):
        return fill
    ratio = fill.region.coarsening
    if ratio < _COARSER:
        return fill
    return replace(fill, note=" ".join([*fill.note.split(), _COARSENED.format(ratio)]))


def flaws(results: Sequence[FairRegion | StageError]) -> list[float]:
    """Count folded edges and faces without area of fills; infinite where there is none."""
    regions = {
        i: result.region
        for i, result in enumerate(results)
        if isinstance(result, FairRegion) and np.isfinite(result.region.vertices).all()
    }
    counts = [np.inf] * len(results)
    for i, shape in zip(regions, shapes_of(list(regions.values())), strict=True):
        counts[i] = shape.folded_edges + shape.flat_faces
    return counts


def otherwise(
    regions: Sequence[Region],
    lengths: Sequence[float | None],
    pipeline: Pipeline,
    first: Sequence[FairRegion | StageError],
    *,
    count: Callable[[Sequence[FairRegion | StageError]], Sequence[float]],
    fault: str,
) -> list[FairRegion | StageError]:
    """Close and fair regions in other ways than the usual one, and choose among all.

    Parameters
    ----------
    regions : sequence of Region
        Open.
    lengths : sequence of float or None
        Edge lengths of the fills.
    pipeline : Pipeline
    first : sequence of FairRegion or StageError
        What the usual way made.
    count : callable
        Numbers of the flaws of fills; of all at once, as that is cheaper.
    fault : str
        What the usual way does wrong, for the note.

    Returns
    -------
    list of FairRegion or StageError
        Of each region the first without flaws, or if there is none that with the fewest.
    """
    best, least = list(first), list(count(first))
    ways = [
        _other_ways(region, length, pipeline, result, fault)
        for region, length, result in zip(regions, lengths, first, strict=True)
    ]
    left = [i for i, number in enumerate(least) if number > 0]
    while left:
        chosen = {i: way for i in left if (way := next(ways[i], None)) is not None}
        tried = _faired(list(chosen.values()), pipeline)
        for i, fill, number in zip(chosen, tried, count(tried), strict=True):
            if number < least[i] or np.isinf(least[i]):  # of several errors the last
                best[i], least[i] = fill, number
        left = [i for i in chosen if least[i] > 0]
    return best


@dataclass(frozen=True)
class _Way:
    """A closed region, how it is to be faired, and what is to be said of it."""

    closed: Region
    continuity: Continuation
    note: str


def _other_ways(
    region: Region,
    length: float | None,
    pipeline: Pipeline,
    first: FairRegion | StageError,
    fault: str,
) -> Iterator[_Way | StageError]:
    flatter: dict[Continuation, str] = {
        "tangent": _TANGENT.format(fault),
        "flat": _CAPPED.format(fault),
    }
    if region.continuity != "smooth":
        flatter.pop("tangent")
    if region.continuity == "flat":
        flatter.clear()
    (closed,) = pipeline.close_again([region], edge_lengths=[length])
    if isinstance(closed, StageError):
        yield closed
    else:
        laid = "" if region.islands else _IN_PLANE.format(fault)
        ways: dict[Continuation, str] = {region.continuity: "", **flatter}
        for continuity, note in ways.items():
            yield _Way(closed, continuity, f"{laid} {note}")
    if isinstance(first, FairRegion):
        for continuity, note in flatter.items():
            yield _Way(first.region, continuity, note)


def _faired(ways: Sequence[_Way | StageError], pipeline: Pipeline) -> list[FairRegion | StageError]:
    """Fair regions with another continuity than they ask for, all together; errors stay."""
    asked = [
        replace(way.closed, continuity=way.continuity) for way in ways if isinstance(way, _Way)
    ]
    faired = iter(pipeline.fair(asked))
    return [_noted(next(faired), way) if isinstance(way, _Way) else way for way in ways]


def _noted(result: FairRegion | StageError, way: _Way) -> FairRegion | StageError:
    if isinstance(result, StageError):
        return result
    kept = replace(result.region, continuity=way.closed.continuity)
    return replace(result, region=kept, note=" ".join([*way.note.split(), *result.note.split()]))
