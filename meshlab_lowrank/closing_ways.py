"""Other ways to close a region than the usual one, for fills that fold or cross something."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.parameters import Continuation
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1a_close import Close
from meshlab_lowrank.stages.stage1b_fair import FairRegion

FOLDS = "folds"
_FLATTENED = 3  # ways to close a region that are tried with less continuity too
_MOST_FACES = 10_000  # of fills of a region that are tried, from which on few more are
_COARSE_EDGES = (1.0, 1.4, 2.0, 3.0)  # in mean edges of the rim
_IN_PLANE = "It was triangulated in the plane of its rim, as its usual closing {}."
_LEAST_BEND = (
    "It was triangulated between the vertices of its rim, bent as little as can be, as its usual "
    "closing {}."
)
_TANGENT = "It goes on with tangents only, as a smoother fill {}."
_COARSE = "Its edges are {:.1f} times as long as those of its rim, as a finer fill {}."
_CAPPED = "It is closed flat, as a smooth continuation {}."


@dataclass(frozen=True)
class Tried:
    """What the usual way made of a region, and how that of each way since went.

    Attributes
    ----------
    first : FairRegion or StageError
    flaws : list of float
        Numbers of the flaws of the first, and of all that were tried after it.
    """

    first: FairRegion | StageError
    flaws: list[float]


@dataclass(frozen=True)
class Way:
    """A closed region, how it is to be faired, and what is to be said of it.

    Attributes
    ----------
    closed : Region
    continuity : {"flat", "tangent", "smooth"}
    note : str
    """

    closed: Region
    continuity: Continuation
    note: str


def other_ways(
    region: Region,
    length: float | None,
    pipeline: Pipeline,
    fault: str,
    tried: Tried,
) -> Iterator[Way | StageError]:
    """Give ways to close a region: smooth ones, flatter ones, and ones with few faces.

    Those with few faces are no better for having fewer folds than another if they cross more, so
    they are tried only where crossings count, or nothing else closes the region.

    Parameters
    ----------
    region : Region
        Open.
    length : float or None
        Edge length of the fill.
    pipeline : Pipeline
    fault : str
        What the usual way does wrong.
    tried : Tried
        The number of flaws of each way has to be added to it before the next one is asked for.

    Yields
    ------
    Way or StageError
        The error of a way that doesn't close it.
    """
    laid: list[tuple[float, Way]] = []
    if isinstance(tried.first, FairRegion):
        note = _on_closing(tried.first.note)
        laid.append((tried.flaws[0], Way(tried.first.region, region.continuity, note)))
    again = isinstance(tried.first, FairRegion) and bool(tried.first.note)
    told = "" if region.islands else fault
    dense = _dense_ways(region, length, pipeline, told, again=again)
    for way in dense if fault == FOLDS or _cost(laid) <= _MOST_FACES else ():
        yield way
        if isinstance(way, Way):
            laid.append((tried.flaws[-1], way))
            if _cost(laid) > _MOST_FACES:
                break
    yield from _flatter_ways(laid, region.continuity, fault)
    if fault != FOLDS or isinstance(tried.first, StageError):
        yield from _coarse_ways(region, length, pipeline, fault)


def _on_closing(note: str) -> str:
    """Leave out of a note what it says of the continuity, which another may replace."""
    for said in (_TANGENT, _CAPPED):
        note = note.split(said.partition(",")[0], maxsplit=1)[0]
    return note


def _dense_ways(
    region: Region, length: float | None, pipeline: Pipeline, fault: str, *, again: bool
) -> Iterator[Way | StageError]:
    """Close a region in the usual way, where that isn't what was tried first, and in others."""
    bent = [(close, _LEAST_BEND) for close in pipeline.close_last[:-1]]
    usual = [(pipeline.close, "")] if again else []
    for close, note in (*usual, (pipeline.close_again, _IN_PLANE), *bent):
        found = _laid(region, length, close, note.format(fault) if fault else "")
        if isinstance(found, Way) or close is pipeline.close_again:  # whose error counts
            yield found


def _flatter_ways(
    laid: Sequence[tuple[float, Way]], continuity: Continuation, fault: str
) -> Iterator[Way]:
    """Give the best ways, by their numbers of flaws, with less continuity."""
    best = [way for _, way in sorted(laid, key=lambda each: each[0])]
    several = _cost(laid) <= _MOST_FACES
    for flatter, note in _flatter(continuity).items():
        for way in best[: _FLATTENED if several else 1]:
            yield replace(way, continuity=flatter, note=f"{way.note} {note.format(fault)}")


def _coarse_ways(
    region: Region, length: float | None, pipeline: Pipeline, fault: str
) -> Iterator[Way]:
    """Close a region with edges as long as those of its rim or longer, and with no more."""
    edge = _rim_edge(region)
    ways = [
        (pipeline.close, ratio * edge, _COARSE.format(ratio, fault))
        for ratio in (() if length is not None else _COARSE_EDGES)
    ]
    few = [(close, length, _LEAST_BEND.format(fault)) for close in pipeline.close_last[-1:]]
    for close, wanted, note in (*ways, *few):
        found = _laid(region, wanted, close, note)
        if isinstance(found, Way):
            yield found


def _cost(laid: Sequence[tuple[float, Way]]) -> int:
    """Count the faces of fills."""
    return sum(int((~way.closed.known_faces).sum()) for _, way in laid)


def _laid(region: Region, length: float | None, close: Close, note: str) -> Way | StageError:
    """Close a region in one way."""
    (closed,) = close([region], edge_lengths=[length])
    return Way(closed, region.continuity, note) if isinstance(closed, Region) else closed


def _flatter(continuity: Continuation) -> dict[Continuation, str]:
    """Give what is flatter than a continuity, and the notes on that."""
    if continuity == "smooth":
        return {"tangent": _TANGENT, "flat": _CAPPED}
    return {"flat": _CAPPED} if continuity == "tangent" else {}


def _rim_edge(region: Region) -> float:
    """Give the mean length of the edges at the rim."""
    ends = np.concatenate([np.roll(loop, -1) for loop in region.loops()])
    sides = region.vertices[np.concatenate(region.loops())] - region.vertices[ends]
    return float(np.linalg.norm(sides, axis=1).mean())
