"""Smooth fills of regions: closed and faired, and in another way where that has flaws."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill_shape import beyond_surroundings, shapes_of
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
_FLATTENED = 3  # ways to close a region that are tried with less continuity too
_MOST_FACES = 10_000  # of fills of a region that are tried, from which on few more are
_FAR = 0.3  # of the hole's size; caps of spheres leave their surroundings by less
_MOST_BULGE = 0.9  # so that it counts for less than a flaw
_COARSE_EDGES = (1.0, 1.4, 2.0, 3.0)  # in mean edges of the rim
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
_COARSE = "Its edges are {:.1f} times as long as those of its rim, as a finer fill {}."
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
        Of each region the first without flaws, or if there is none that with the fewest; of equal
        ones that which bulges far out of its surroundings least.
    """

    def cost(fills: Sequence[FairRegion | StageError]) -> list[float]:
        return [number + _bulge(fill) for number, fill in zip(count(fills), fills, strict=True)]

    best, least = list(first), cost(first)
    tried = [_Tried(fill, [number]) for fill, number in zip(first, least, strict=True)]
    ways = [
        _other_ways(region, length, pipeline, fault, each)
        for region, length, each in zip(regions, lengths, tried, strict=True)
    ]
    left = [i for i, number in enumerate(least) if number >= 1.0]
    while left:
        chosen = {i: way for i in left if (way := next(ways[i], None)) is not None}
        fills = _faired(list(chosen.values()), pipeline)
        counts = cost(fills)
        for i, fill, number in zip([*chosen, *chosen], fills, counts, strict=True):
            if number < least[i] or np.isinf(least[i]):  # of several errors the last
                best[i], least[i] = fill, number
        for i, *pair in zip(chosen, counts, counts[len(chosen) :], strict=False):
            tried[i].flaws.append(min(pair))
        left = [i for i in chosen if least[i] > 0.0]
    return best


@dataclass(frozen=True)
class _Tried:
    """What the usual way made of a region, and the flaws of that and of each way tried since."""

    first: FairRegion | StageError
    flaws: list[float]


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
    fault: str,
    tried: _Tried,
) -> Iterator[_Way | StageError]:
    """Give ways to close a region: smooth ones, flatter ones, and ones with few faces.

    Those with few faces are no better for having fewer folds than another if they cross more, so
    they are tried only where crossings count, or nothing else closes the region.
    """
    laid: list[tuple[float, _Way]] = []
    if isinstance(tried.first, FairRegion):
        note = _on_closing(tried.first.note)
        laid.append((tried.flaws[0], _Way(tried.first.region, region.continuity, note)))
    again = isinstance(tried.first, FairRegion) and bool(tried.first.note)
    told = "" if region.islands else fault
    dense = _dense_ways(region, length, pipeline, told, again=again)
    for way in dense if fault == _FOLDS or _cost(laid) <= _MOST_FACES else ():
        yield way
        if isinstance(way, _Way):
            laid.append((tried.flaws[-1], way))
            if _cost(laid) > _MOST_FACES:
                break
    yield from _flatter_ways(laid, region.continuity, fault)
    if fault != _FOLDS or isinstance(tried.first, StageError):
        yield from _coarse_ways(region, length, pipeline, fault)


def _on_closing(note: str) -> str:
    """Leave out of a note what it says of the continuity, which another may replace."""
    for said in (_TANGENT, _CAPPED):
        note = note.split(said.partition(",")[0], maxsplit=1)[0]
    return note


def _dense_ways(
    region: Region, length: float | None, pipeline: Pipeline, fault: str, *, again: bool
) -> Iterator[_Way | StageError]:
    """Close a region in the usual way, where that isn't what was tried first, and in others."""
    bent = [(close, _LEAST_BEND) for close in pipeline.close_last[:-1]]
    usual = [(pipeline.close, "")] if again else []
    for close, note in (*usual, (pipeline.close_again, _IN_PLANE), *bent):
        found = _laid(region, length, close, note.format(fault) if fault else "")
        if isinstance(found, _Way) or close is pipeline.close_again:  # whose error counts
            yield found


def _flatter_ways(
    laid: Sequence[tuple[float, _Way]], continuity: Continuation, fault: str
) -> Iterator[_Way]:
    """Give the best ways, by their numbers of flaws, with less continuity."""
    best = [way for _, way in sorted(laid, key=lambda each: each[0])]
    several = _cost(laid) <= _MOST_FACES
    for flatter, note in _flatter(continuity).items():
        for way in best[: _FLATTENED if several else 1]:
            yield replace(way, continuity=flatter, note=f"{way.note} {note.format(fault)}")


def _coarse_ways(
    region: Region, length: float | None, pipeline: Pipeline, fault: str
) -> Iterator[_Way]:
    """Close a region with edges as long as those of its rim or longer, and with no more."""
    edge = _rim_edge(region)
    ways = [
        (pipeline.close, ratio * edge, _COARSE.format(ratio, fault))
        for ratio in (() if length is not None else _COARSE_EDGES)
    ]
    few = [(close, length, _LEAST_BEND.format(fault)) for close in pipeline.close_last[-1:]]
    for close, wanted, note in (*ways, *few):
        found = _laid(region, wanted, close, note)
        if isinstance(found, _Way):
            yield found


def _bulge(fill: FairRegion | StageError) -> float:
    """Say by how much of the hole's size a fill leaves its surroundings, if by far; below one."""
    if isinstance(fill, StageError):
        return 0.0
    rim = fill.region.vertices[np.concatenate(fill.region.loops())]
    size = 2.0 * float(np.linalg.norm(rim - rim.mean(axis=0), axis=1).max())
    share = beyond_surroundings(fill.region) / size if size > 0.0 else 0.0
    return min(share, _MOST_BULGE) if share > _FAR else 0.0


def _cost(laid: Sequence[tuple[float, _Way]]) -> int:
    """Count the faces of fills."""
    return sum(int((~way.closed.known_faces).sum()) for _, way in laid)


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
    """Fair regions with another continuity than they ask for, all together; errors stay.

    After all of them come the same with what the fairing spoils taken back.
    """
    asked = [
        replace(way.closed, continuity=way.continuity) for way in ways if isinstance(way, _Way)
    ]
    fair = iter(pipeline.fair(asked))
    fills = [_noted(next(fair), way) if isinstance(way, _Way) else way for way in ways]
    return [*fills, *map(_taken_back, ways, fills)]


def _noted(result: FairRegion | StageError, way: _Way) -> FairRegion | StageError:
    if isinstance(result, StageError):
        return result
    kept = replace(result.region, continuity=way.closed.continuity)
    return replace(result, region=kept, note=" ".join([*way.note.split(), *result.note.split()]))


def _taken_back(way: _Way | StageError, fill: FairRegion | StageError) -> FairRegion | StageError:
    if isinstance(way, StageError) or isinstance(fill, StageError):
        return fill
    return replace(fill, region=_unfolded(way, fill.region))


def _rim_edge(region: Region) -> float:
    """Give the mean length of the edges at the rim."""
    ends = np.concatenate([np.roll(loop, -1) for loop in region.loops()])
    sides = region.vertices[np.concatenate(region.loops())] - region.vertices[ends]
    return float(np.linalg.norm(sides, axis=1).mean())


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
