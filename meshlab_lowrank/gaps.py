"""The gaps of a mesh, each a hole with the pieces of surface that lie in it, and smooth fills."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import compress
from typing import TypeAlias

import numpy as np

from meshlab_lowrank.closing import explained, flaws, otherwise, smooth_fills
from meshlab_lowrank.edged_closing import edged_fills
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill_crossings import crossings_of
from meshlab_lowrank.gap import Gap
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.topology import vertex_components
from meshlab_lowrank.parameters import Continuity
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop
from meshlab_lowrank.stages.stage0_islands import islands_in, reaches_into
from meshlab_lowrank.stages.stage0_region import Region, cut_rings
from meshlab_lowrank.stages.stage0_shape import is_cut
from meshlab_lowrank.stages.stage1b_fair import FairRegion

_FACES_PER_FACE, _SPARE_FACES = 4, 2000  # of all fills, for each face of the mesh
_LEAST_FACES = 100
_CROSSES = "runs through measured surface"
_OWN = "Its faces cross one another or the measured surface around it ({} pairs)."
_OTHER = "Another part of the mesh passes through it ({} pairs of faces cross)."
_RING_LEFT = "A piece of measured surface lies in it, and the ring between can't be filled: {}"
_LEFT = (
    "Measured surface lies in it (boundary loop {}), and what bounds the gap between the two can't "
    "be told."
)
_FillRegions: TypeAlias = Callable[
    [Sequence[Region], Sequence[float | None], Pipeline, Callable[[str], object]],
    list[FairRegion | StageError],
]
_NONE = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class _Loops:
    """The boundary loops of a mesh by the components that they bound, which few meshes ask for."""

    loops: Sequence[BoundaryLoop]
    closer: GapCloser

    @cached_property
    def component(self) -> IntArray:
        """Number of the component of each."""
        first = np.array([each.vertices[0] for each in self.loops], dtype=np.int64)
        return self.closer.component[first]

    def at(self, components: IntArray) -> list[BoundaryLoop]:
        """Give those of some components."""
        chosen = np.isin(self.component, components).tolist()
        return list(compress(self.loops, chosen))


@dataclass(frozen=True)
class GapCloser:
    """Closes the gaps of one mesh smoothly.

    Attributes
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        That can be worked with.
    measured : (f, 3) int64
        All of the mesh; fills keep clear of them.
    pipeline : Pipeline
    edge_length : float or None
        Of new triangles, in the units of the mesh.
    squared_edges : int
        Squares of the numbers of edges around what is to be closed, summed.
    continuity : {"auto", "crease", "flat", "tangent", "smooth"}
    report : callable
        Called with the name of each stage that begins.
    """

    vertices: FloatArray
    faces: IntArray
    measured: IntArray
    pipeline: Pipeline
    edge_length: float | None
    squared_edges: int
    continuity: Continuity
    report: Callable[[str], object]

    def close(
        self, holes: Sequence[BoundaryLoop], loops: Sequence[BoundaryLoop]
    ) -> tuple[list[Gap], list[FairRegion | StageError], list[int]]:
        """Close holes, and where pieces of surface lie in one, what is between.

        A fill that crosses measured surface, or itself, is made in other ways; the one with the
        fewest crossings and other flaws counts.

        Parameters
        ----------
        holes : sequence of BoundaryLoop
        loops : sequence of BoundaryLoop
            All of the mesh.

        Returns
        -------
        gaps : list of Gap
        fills : list of FairRegion or StageError
            One for each hole.
        crossings : list of int
            Pairs of faces of each fill, or of it and the measured surface, that cross.
        """
        gaps = [Gap(hole) for hole in holes]
        regions = self._cut(gaps)
        fills = self._closed(regions, self.report)
        news = {i: _new(fill) for i, fill in enumerate(fills) if isinstance(fill, FairRegion)}
        crossed = self._crossed(holes, fills)
        self._without_creases(holes, regions, fills, crossed)
        table = _Loops(loops, self)
        others = {i: table.at(self._others(rows, holes[i])) for i, rows in crossed.items()}
        for i, islands in islands_in(self.vertices, holes, news, loops, others).items():
            gap = Gap(holes[i], tuple(islands))
            (region,) = self._cut([gap])
            (fill,) = self._closed([region], lambda _: self.report("fairing"))
            if isinstance(fill, StageError) and i not in crossed:
                continue  # the fill of the hole alone does no harm
            gaps[i], regions[i], fills[i] = gap, region, fill
            crossed[i] = self._crossed([holes[i]], [fill]).get(0, _NONE)
        counts = self._over_sheets(holes, fills)
        mended = [i for i, fill in enumerate(fills) if counts[i]]
        crossing = sorted({*crossed, *mended})
        left = {i: region for i in crossing if isinstance(region := regions[i], Region)}
        cleared = self._kept_clear(
            [gaps[i] for i in left], list(left.values()), [fills[i] for i in left], table
        )
        for i, (fill, count) in zip(left, cleared, strict=True):
            fills[i], counts[i] = fill, count
        return gaps, [explained(fill) for fill in fills], counts

    def _without_creases(
        self,
        holes: Sequence[BoundaryLoop],
        regions: Sequence[Region | StageError],
        fills: list[FairRegion | StageError],
        crossed: dict[int, IntArray],
    ) -> None:
        """Close holes smoothly, in place, whose fills cross something with joined creases."""
        again = [i for i in crossed if isinstance(fill := fills[i], FairRegion) and fill.creases]
        if not again:
            return
        closed = self._smooth([regions[i] for i in again], lambda _: None)
        for i, fill in zip(again, closed, strict=True):
            fills[i] = fill
            del crossed[i]
        found = self._crossed([holes[i] for i in again], closed)
        crossed.update({again[i]: rows for i, rows in found.items()})

    def _crossed(
        self, holes: Sequence[BoundaryLoop], fills: Sequence[FairRegion | StageError]
    ) -> dict[int, IntArray]:
        """Give what `crossings` gives of the fills that cross something."""
        found = self.crossings(
            [  # the fill of a rim, as the user wants it, may lie over its sheet
                fill.region if isinstance(fill, FairRegion) and not hole.is_rim else None
                for hole, fill in zip(holes, fills, strict=True)
            ]
        )
        return {i: rows for i, rows in enumerate(found) if len(rows)}

    def _over_sheets(
        self, holes: Sequence[BoundaryLoop], fills: Sequence[FairRegion | StageError]
    ) -> list[int]:
        """Count what fills of rims cross, which `_crossed` passes over; 0 for others."""
        if not any(hole.is_rim for hole in holes):
            return [0] * len(holes)
        found = self.crossings(
            [
                fill.region if isinstance(fill, FairRegion) and hole.is_rim else None
                for hole, fill in zip(holes, fills, strict=True)
            ]
        )
        return [len(rows) for rows in found]

    @cached_property
    def component(self) -> IntArray:
        """Number of the component of each vertex, (n,)."""
        return vertex_components(self.faces, len(self.vertices))

    def _others(self, rows: IntArray, hole: BoundaryLoop) -> IntArray:
        """Give the components, but the hole's own, of measured faces."""
        through = np.unique(self.component[self.measured[rows[rows >= 0]]])
        return np.asarray(through[through != self.component[hole.vertices[0]]])

    def _kept_clear(
        self,
        gaps: Sequence[Gap],
        regions: Sequence[Region],
        fills: Sequence[FairRegion | StageError],
        loops: _Loops,
    ) -> list[tuple[FairRegion | StageError, int]]:
        """Close gaps, whose fills cross something, otherwise; say what still does, and count."""
        seen: dict[int, IntArray] = {}  # what fills cross, to look once

        def faults(fills: Sequence[FairRegion | StageError]) -> list[float]:
            counts, crossed = self._faults(fills)
            seen.update(zip(map(id, fills), crossed, strict=True))
            return counts

        best = otherwise(
            regions,
            [self._length(region) for region in regions],
            self.pipeline,
            fills,
            count=faults,
            fault=_CROSSES,
        )
        return [
            (self._judged(gap, fill, seen[id(fill)], loops), len(seen[id(fill)]))
            for gap, fill in zip(gaps, best, strict=True)
        ]

    def _judged(
        self,
        gap: Gap,
        fill: FairRegion | StageError,
        rows: IntArray,
        loops: _Loops,
    ) -> FairRegion | StageError:
        """Say of a fill what it crosses, see `crossings`; an error if it must not be."""
        if isinstance(fill, StageError):
            return StageError(_RING_LEFT.format(fill)) if gap.islands else fill
        if len(rows) == 0 or gap.loop.is_rim:  # which may lie over its sheet
            return fill
        others = self._others(rows, gap.loop)
        inside = [
            str(each.id) for each in loops.at(others) if reaches_into(self.vertices, gap.loop, each)
        ]
        if inside:
            return StageError(_LEFT.format(", ".join(inside)))
        note = (_OTHER if len(others) else _OWN).format(len(rows))
        return replace(fill, note=" ".join([*fill.note.split(), *note.split()]))

    def crossings(self, regions: Sequence[Region | None]) -> list[IntArray]:
        """Find what fills cross; see `crossings_of`."""
        return crossings_of(self.vertices, self.measured, regions)

    def _faults(
        self, fills: Sequence[FairRegion | StageError]
    ) -> tuple[list[float], list[IntArray]]:
        """Count crossings and flaws of fills, infinite where there is none; see `crossings`."""
        counts = flaws(fills)
        crossed = self.crossings(
            [
                fill.region if isinstance(fill, FairRegion) and np.isfinite(count) else None
                for fill, count in zip(fills, counts, strict=True)
            ]
        )
        total = [count + len(rows) for count, rows in zip(counts, crossed, strict=True)]
        return total, crossed

    def _length(self, region: Region) -> float | None:
        """Edge length of new triangles in local units."""
        return None if self.edge_length is None else self.edge_length / region.scale

    def _cut(self, gaps: Sequence[Gap]) -> list[Region | StageError]:
        """Cut out the surroundings of gaps, and say how their fills shall go on."""
        found = cut_rings(
            self.vertices,
            self.faces,
            [gap.vertices for gap in gaps],
            [gap.faces for gap in gaps],
            rings=self.pipeline.fair.rings,
        )
        return [
            self._continued(
                replace(each, islands=gap.starts, most_faces=self._most_faces(len(gap.vertices)))
            )
            if isinstance(each, Region)
            else each
            for gap, each in zip(gaps, found, strict=True)
        ]

    def _most_faces(self, edges: int) -> float:
        """Faces that the fill of a gap may get, for so many edges around it.

        A flat disc needs a fifth of their square. More than that takes a rim that is drawn out or
        crosses itself; and fills that are much larger than the mesh would take their time from
        nothing that is known.
        """
        together = _SPARE_FACES + _FACES_PER_FACE * len(self.measured)
        own = edges**2
        return min(together * own / self.squared_edges, own) + _LEAST_FACES

    def _continued(self, region: Region) -> Region:
        if self.continuity == "crease":
            return region
        if self.continuity != "auto":
            return replace(region, continuity=self.continuity)
        outer = replace(region, loop=region.loops()[0], islands=())
        return replace(region, continuity="flat") if is_cut(outer) else region

    def _closed(
        self, regions: Sequence[Region | StageError], report: Callable[[str], object]
    ) -> list[FairRegion | StageError]:
        """Close and fair regions, along creases where they go on across; errors stay."""
        return self._filled(regions, partial(edged_fills, continuity=self.continuity), report)

    def _smooth(
        self, regions: Sequence[Region | StageError], report: Callable[[str], object]
    ) -> list[FairRegion | StageError]:
        """Close and fair regions without regard to creases; errors stay."""
        return self._filled(regions, smooth_fills, report)

    def _filled(
        self,
        regions: Sequence[Region | StageError],
        fill: _FillRegions,
        report: Callable[[str], object],
    ) -> list[FairRegion | StageError]:
        open_regions = [each for each in regions if isinstance(each, Region)]
        lengths = [self._length(region) for region in open_regions]
        fills = iter(fill(open_regions, lengths, self.pipeline, report))
        return [next(fills) if isinstance(each, Region) else each for each in regions]


def _new(fill: FairRegion) -> FloatArray:
    """Give the new vertices in the units of the mesh."""
    region = fill.region
    return region.to_global(region.vertices[~region.known_vertices])
