"""Smooth fills of regions: closed and faired, and in another way where that has flaws."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill_shape import shapes_of
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.mesh.unfolding import unfolded
from meshlab_lowrank.parameters import Continuation
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1a_close import Close
from meshlab_lowrank.stages.stage1b_fair import FairRegion
from meshlab_lowrank.stages.stage7_finish_without_flaws import without_crossings

_FOLDS = "folds"
_COARSER = 1.1
_COARSENED = (
    "Its edges are {:.1f} times as long as those around, as it would have too many faces for its "
    "rim or the mesh otherwise; refineedgelen sets their length."
)
_IN_PLANE = "It was triangulated in the plane of its rim, as its usual closing {}."
_LEAST_BEND = (
    "It was triangulated between the vertices of its rim, bent as little as can be, as its usual "
    "closing {}."
)
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
    """Give ways to close a region: smooth ones, then flatter ones, and one with few faces.

    The last is no better for having fewer folds than another if it crosses more, so it is tried
    only where nothing else closes the region, or crossings count.
    """
    told = "" if region.islands else fault
    laid: list[_Way] = []
    closings = [(close, _LEAST_BEND) for close in pipeline.close_last]
    usual = [(pipeline.close, "")] if isinstance(first, FairRegion) and first.note else []
    for close, note in (*usual, (pipeline.close_again, _IN_PLANE), *closings[:-1]):
        found = _laid(region, length, close, note.format(told) if told else "")
        if isinstance(found, _Way):
            laid.append(found)
            yield found
        elif close is pipeline.close_again:  # of several errors that one counts
            yield found
    if isinstance(first, FairRegion):
        laid.append(_Way(first.region, region.continuity, ""))
    for continuity, note in _flatter(region.continuity).items():
        for way in laid:
            yield replace(way, continuity=continuity, note=f"{way.note} {note.format(fault)}")
    for close, note in closings[-1:] if fault != _FOLDS or isinstance(first, StageError) else ():
        found = _laid(region, length, close, note.format(fault))
        if isinstance(found, _Way):
            yield found


def _laid(region: Region, length: float | None, close: Close, note: str) -> _Way | StageError:
    """Close a region in one way."""
    (closed,) = close([region], edge_lengths=[length])
    return _Way(closed, region.continuity, note) if isinstance(closed, Region) else closed


def _flatter(continuity: Continuation) -> dict[Continuation, str]:
    """Give what is flatter than a continuity, and the notes on that."""
    if continuity == "smooth":
        return {"tangent": _TANGENT, "flat": _CAPPED}
    return {"flat": _CAPPED} if continuity == "tangent" else {}


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
    kept = replace(_unfolded(way, result.region), continuity=way.closed.continuity)
    return replace(result, region=kept, note=" ".join([*way.note.split(), *result.note.split()]))


def _unfolded(way: _Way, faired: Region) -> Region:
    """Take the fairing back where it folds triangles, or makes them cross, that did not before."""
    counted = ~faired.known_faces
    if way.continuity == "flat":  # whose rim may be an edge
        inner = ~faired.known_vertices
        counted = faces_at(inner, faired.faces)
    start, faces = way.closed.vertices, faired.faces
    vertices = unfolded(start, faired.vertices, faces, counted)
    vertices = without_crossings(start, vertices, faces, ~faired.known_vertices)
    return replace(faired, vertices=unfolded(start, vertices, faces, counted))
