"""Smooth fills of regions: closed and faired, and in another way where that has flaws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from meshlab_lowrank.closing_ways import FOLDS, Tried, Way, other_ways
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill_shape import beyond_surroundings, shapes_of
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.mesh.unfolding import unfolded
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1b_fair import FairRegion
from meshlab_lowrank.stages.stage7_finish_without_flaws import without_crossings

_COARSER = 1.1
_FAR = 0.3  # of the hole's size, from which on a bulge counts
_MOST_BULGE = 0.9  # so that it counts for less than a flaw
_COARSENED = (
    "Its edges are {:.1f} times as long as those around, as it would have too many faces for its "
    "rim or the mesh otherwise; refineedgelen sets their length."
)


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
        fault=FOLDS,
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
    tried = [Tried(fill, [number]) for fill, number in zip(first, least, strict=True)]
    ways = [
        other_ways(region, length, pipeline, fault, each)
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


def _bulge(fill: FairRegion | StageError) -> float:
    """Say by how much of the hole's size a fill leaves its surroundings, if by far; below one."""
    if isinstance(fill, StageError):
        return 0.0
    rim = fill.region.vertices[np.concatenate(fill.region.loops())]
    size = 2.0 * float(np.linalg.norm(rim - rim.mean(axis=0), axis=1).max())
    share = beyond_surroundings(fill.region) / size if size > 0.0 else 0.0
    return min(share, _MOST_BULGE) if share > _FAR else 0.0


def _faired(ways: Sequence[Way | StageError], pipeline: Pipeline) -> list[FairRegion | StageError]:
    """Fair regions with another continuity than they ask for, all together; errors stay.

    After all of them come the same with what the fairing spoils taken back.
    """
    asked = [replace(way.closed, continuity=way.continuity) for way in ways if isinstance(way, Way)]
    fair = iter(pipeline.fair(asked))
    fills = [_noted(next(fair), way) if isinstance(way, Way) else way for way in ways]
    return [*fills, *map(_taken_back, ways, fills)]


def _noted(result: FairRegion | StageError, way: Way) -> FairRegion | StageError:
    if isinstance(result, StageError):
        return result
    kept = replace(result.region, continuity=way.closed.continuity)
    return replace(result, region=kept, note=" ".join([*way.note.split(), *result.note.split()]))


def _taken_back(way: Way | StageError, fill: FairRegion | StageError) -> FairRegion | StageError:
    if isinstance(way, StageError) or isinstance(fill, StageError):
        return fill
    return replace(fill, region=_unfolded(way, fill.region))


def _unfolded(way: Way, faired: Region) -> Region:
    """Take the fairing back where it folds triangles, or makes them cross, that did not before."""
    counted = ~faired.known_faces
    if way.continuity == "flat":  # whose rim may be an edge
        inner = ~faired.known_vertices
        counted = faces_at(inner, faired.faces)
    start, faces = way.closed.vertices, faired.faces
    vertices = unfolded(start, faired.vertices, faces, counted)
    vertices = without_crossings(start, vertices, faces, ~faired.known_vertices)
    return replace(faired, vertices=unfolded(start, vertices, faces, counted))
