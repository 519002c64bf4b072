"""Fills of many holes: closed and faired in one go, then detail where there is evidence for it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from meshlab_lowrank.cluster_progress import FAIRED, Progress
from meshlab_lowrank.clusters import clusters
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill import Fill
from meshlab_lowrank.fill_crossings import crossings_between
from meshlab_lowrank.gap import Gap
from meshlab_lowrank.gaps import GapCloser
from meshlab_lowrank.leveling import fill_depth
from meshlab_lowrank.mesh.boundary_walk import area_vector
from meshlab_lowrank.mesh.face_grid import FaceGrid
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, normalized
from meshlab_lowrank.parameters import Continuity, Detail, InpaintParameters
from meshlab_lowrank.pipeline import Pipeline, StageReport
from meshlab_lowrank.presets import pipeline_of
from meshlab_lowrank.reporting import Reporter
from meshlab_lowrank.smooth_errors import known_surroundings, smooth_errors, with_guess
from meshlab_lowrank.solving import solve_hole
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop
from meshlab_lowrank.stages.stage0_region import Region, cut_region
from meshlab_lowrank.stages.stage0_surroundings import faces_of_fills, with_fills_of
from meshlab_lowrank.stages.stage1b_fair import FairRegion
from meshlab_lowrank.threads import thread_count, worker_threads

_Result = TypeVar("_Result")

_CUT = "It is a cut: its rim is flat and met steeply all round, so it is capped flat."
_CAPPED = "It is capped flat, as asked."
_RING = "It is a ring round an island, filled between the boundary loops {}."
_CREASED = "Detail is not brought across creases."
_OUTGROWN = "The detail made the fill outgrow the smooth one, so it is taken back."
_CROSSING = "The detail made the fill cross the surface around it, so it is taken back."
_NEAR = 0.5  # of the reach, to which holes are worked on together
_OUTGROWTH = 0.1  # diameters of the hole that detail may add to its fill, beside its own height
_GRID_FROM = 8  # clusters; sorting all faces costs as much as cutting out about so many


@dataclass(frozen=True)
class _Cluster:
    """Holes that get their detail together, and how to cut them out with their fills."""

    holes: list[int]
    cut: Callable[[float], Region]  # with surroundings so many times as wide


@dataclass(frozen=True)
class Filler:
    """What is the same for all holes of a run.

    Attributes
    ----------
    pipeline : Pipeline
    detail : {"calibrated", "full", "none"}
    edge_length : float or None
        Of new triangles, in the units of the mesh.
    continuity : {"auto", "crease", "flat", "tangent", "smooth"}
    reporter : Reporter
    executor : Executor
    threads : int
    """

    pipeline: Pipeline
    detail: Detail
    edge_length: float | None
    continuity: Continuity
    reporter: Reporter
    executor: Executor
    threads: int

    def fill(
        self,
        vertices: FloatArray,
        faces: IntArray,
        holes: Sequence[BoundaryLoop],
        *,
        loops: Sequence[BoundaryLoop],
        measured: IntArray,
    ) -> list[Fill | StageError]:
        """Fill holes; an error for each that stays open.

        Parameters
        ----------
        vertices : (n, 3) float64
        faces : (m, 3) int64
            That can be worked with.
        holes : sequence of BoundaryLoop
        loops : sequence of BoundaryLoop
            All that can be walked.
        measured : (f, 3) int64
            All faces of the mesh.
        """
        if not holes:
            return []
        errors: dict[int, StageError] = {}
        closer = GapCloser(
            vertices,
            faces,
            measured,
            pipeline=self.pipeline,
            edge_length=self.edge_length,
            squared_edges=sum(len(hole.vertices) ** 2 for hole in holes),
            continuity=self.continuity,
            report=self._begin,
        )
        gaps, found, crossed = closer.close(holes, loops)
        faired = _apart(range(len(holes)), found, errors)
        chains, rims = [gap.vertices for gap in gaps], [gap.faces for gap in gaps]
        fills, wanted = self._smooth(faired, errors)
        fills = {i: replace(fill, crossings=crossed[i]) for i, fill in fills.items()}

        def widened(holes: Sequence[int], widths: FloatArray) -> list[Region]:
            around = [chains[i] for i in holes], [rims[i] for i in holes]
            return known_surroundings(vertices, faces, *around, widths)

        _tell_errors(fills, faired, widened)
        grouped = clusters(
            [vertices[chains[i]] for i in wanted],
            [faired[i].region.scale for i in wanted],
            [len(fills[i].positions) for i in wanted],
            _NEAR * self.pipeline.reach,
        )
        grid = FaceGrid(vertices, faces) if len(grouped) > _GRID_FROM else None

        def around(holes: list[int]) -> _Cluster:
            def cut(width: float) -> Region:
                region = cut_region(
                    vertices,
                    faces,
                    np.concatenate([chains[i] for i in holes]),
                    np.concatenate([rims[i] for i in holes]),
                    reach=width * self.pipeline.reach,
                    rings=self.pipeline.patches.rings,
                    grid=grid,
                )
                return with_fills_of(region, [faired[i].region for i in holes])

            return _Cluster(holes, cut)

        smooth = {i: replace(fills[i], gap=gaps[i]) for i in wanted}
        fills.update(smooth)
        self._bring_detail([around([wanted[i] for i in group]) for group in grouped], fills)
        fills.update(self._clear_of_others(closer, smooth, fills))
        between = crossings_between(vertices, [fill.final() for fill in fills.values()])
        for (i, fill), count in zip(list(fills.items()), between, strict=True):
            fills[i] = replace(fill, crossings=fill.crossings + count)
        return [errors[i] if i in errors else _of(gap, fills[i]) for i, gap in enumerate(gaps)]

    def restore(
        self, regions: Sequence[Region], recut: Callable[[Region, float], Region]
    ) -> list[Fill | StageError]:
        """Fair regions, and bring detail onto what is not known of each.

        Parameters
        ----------
        regions : sequence of Region
        recut : callable
            Gives a faired region with surroundings so many times as wide.
        """
        self.reporter.stage("fairing", 0.0)
        errors: dict[int, StageError] = {}
        faired = _apart(range(len(regions)), self.pipeline.fair(regions), errors)
        fills, wanted = self._smooth(faired, errors)
        _tell_errors(fills, faired, lambda patches, _: [regions[i] for i in patches])

        def around(hole: int) -> _Cluster:
            region = faired[hole].region
            return _Cluster([hole], lambda width: region if width == 1.0 else recut(region, width))

        self._bring_detail([around(i) for i in wanted], fills)
        return [errors[i] if i in errors else fills[i] for i in range(len(regions))]

    def _begin(self, stage: str) -> None:
        self.reporter.stage(stage, 0.5 * FAIRED * (stage == "fairing"))

    def _smooth(
        self, faired: dict[int, FairRegion], errors: dict[int, StageError]
    ) -> tuple[dict[int, Fill], list[int]]:
        """Give the smooth fills, and the numbers of those that may get detail."""
        fills, wanted = {}, []
        for i, fair in faired.items():
            region = fair.region
            new = region.vertices[~region.known_vertices]
            if not np.isfinite(new).all():
                errors[i] = StageError("The fill has coordinates that are not finite.")
                continue
            reason, note = "", fair.note
            creased = fair.creases > 0
            is_cut = not creased and region.continuity == "flat" and self.continuity != "flat"
            if creased:
                reason = "" if self.detail == "none" else _CREASED
            elif region.continuity == "flat":
                note = " ".join([_CUT if is_cut else _CAPPED, *note.split()])
            elif len(new) and self.detail == "calibrated":
                reason = self.pipeline.tune.rules_out(fair.misfit, fill_depth(region))
            plain = not creased and region.continuity != "flat"
            if len(new) and self.detail != "none" and not reason and plain:
                wanted.append(i)
            fills[i] = Fill(
                region,
                region.to_global(new),
                0.0,
                reason,
                trusts=np.zeros(len(new)),
                errors=np.full(len(new), np.nan),
                note=note,
                is_cut=is_cut,
                creases=fair.creases,
            )
        self.reporter.done(len(errors) + len(fills) - len(wanted))
        return fills, wanted

    def _bring_detail(self, jobs: Sequence[_Cluster], fills: dict[int, Fill]) -> None:
        """Replace the smooth fills of clusters by what comes of them."""
        progress = Progress(self.reporter, [len(job.holes) for job in jobs])
        if len(jobs) == 1 or self.threads == 1:
            for number, job in enumerate(jobs):
                fills.update(self._solved(job, fills, progress.reports(number), self.executor))
                progress.done(number)
            return
        progress.share()
        futures = [
            self.executor.submit(self._solved, job, fills, progress.reports(number), None)
            for number, job in enumerate(jobs)
        ]
        try:
            for number in progress.as_completed(futures):
                fills.update(futures[number].result())
                progress.done(number)
        finally:
            progress.stop()
            for future in futures:
                future.cancel()

    def _solved(
        self,
        job: _Cluster,
        smooth: dict[int, Fill],
        report: StageReport,
        executor: Executor | None,
    ) -> dict[int, Fill]:
        """Work on one cluster; where that fails, the fills stay smooth."""
        try:
            region = job.cut(1.0)
            solution = solve_hole(
                region,
                self.pipeline,
                detail=self.detail,
                report=report,
                executor=executor,
                widen=job.cut,
            )
        except StageError as error:
            reason = f"The detail could not be worked out, so the fill is smooth. {error}"
            return {i: replace(smooth[i], reason=reason) for i in job.holes}
        positions = region.to_global(solution.positions[~region.known_vertices])
        if not np.isfinite(positions).all():
            reason = "The detail has coordinates that are not finite, so the fill is smooth."
            return {i: replace(smooth[i], reason=reason) for i in job.holes}
        ends = np.cumsum([len(smooth[i].positions) for i in job.holes])
        parts = np.split(positions, ends[:-1])
        trusts, shares = (np.split(each, ends[:-1]) for each in (solution.trusts, solution.shares))
        closed = [smooth[i].region for i in job.holes]
        faces = faces_of_fills(replace(region, faces=solution.faces), closed)
        found = {}
        for number, (i, part, own) in enumerate(zip(job.holes, parts, faces, strict=True)):
            found[i] = replace(
                smooth[i],
                region=replace(smooth[i].region, faces=own),
                positions=part,
                trust=solution.trust,
                reason=solution.reason,
                trusts=trusts[number],
                errors=shares[number] * smooth[i].errors,
            )
            if solution.guessed:
                moves = np.linalg.norm(part - smooth[i].positions, axis=1)
                found[i] = replace(found[i], errors=with_guess(smooth[i].errors, moves))
            relief = solution.relief * region.scale
            if self.detail == "calibrated" and _outgrows(smooth[i], found[i], relief):
                found[i] = replace(smooth[i], reason=_OUTGROWN)
        return found

    def _clear_of_others(
        self, closer: GapCloser, smooth: dict[int, Fill], fills: dict[int, Fill]
    ) -> dict[int, Fill]:
        """Give smooth fills where detail makes one cross more, and others with what they cross."""
        numbers = [i for i in smooth if fills[i].trust != 0.0]  # NaN too
        detailed = closer.crossings([fills[i].final() for i in numbers])
        clear = {}
        for i, rows in zip(numbers, detailed, strict=True):
            if len(rows) > smooth[i].crossings:
                clear[i] = replace(smooth[i], reason=_CROSSING)
            else:
                clear[i] = replace(fills[i], crossings=len(rows))
        return clear


@contextmanager
def filler(
    parameters: InpaintParameters,
    pipeline: Pipeline | None,
    reporter: Reporter,
    *,
    edge_length: float | None = None,
) -> Iterator[Filler]:
    """Choose the stages and start the threads; the edge length is in the units of the mesh."""
    if pipeline is not None:
        parameters.refuse_stages()
    with worker_threads() as executor:
        yield Filler(
            pipeline=pipeline or pipeline_of(parameters),
            detail=parameters.detail or "calibrated",
            edge_length=edge_length,
            continuity=parameters.continuity,
            reporter=reporter,
            executor=executor,
            threads=thread_count(),
        )


def _tell_errors(
    fills: dict[int, Fill],
    faired: dict[int, FairRegion],
    widened: Callable[[Sequence[int], FloatArray], Sequence[Region]],
) -> None:
    """Say of smooth fills how wrong they may be, in place; see `smooth_errors`."""
    holes = list(fills)
    found = smooth_errors(
        [faired[i] for i in holes],
        lambda rows, widths: widened([holes[row] for row in rows], widths),
    )
    for i, errors in zip(holes, found, strict=True):
        fills[i] = replace(fills[i], errors=errors)


def _apart(
    numbers: Iterable[int], results: Sequence[_Result | StageError], errors: dict[int, StageError]
) -> dict[int, _Result]:
    """Put errors aside under their numbers; give the others."""
    good = {}
    for number, result in zip(list(numbers), results, strict=True):
        if isinstance(result, StageError):
            errors[number] = result
        else:
            good[number] = result
    return good


def _of(gap: Gap, fill: Fill) -> Fill:
    """Say of a fill what it closes."""
    if not gap.islands:
        return replace(fill, gap=gap)
    numbers = [str(loop.id) for loop in gap.loops]
    note = _RING.format(f"{', '.join(numbers[:-1])} and {numbers[-1]}")
    return replace(fill, gap=gap, note=" ".join([note, *fill.note.split()]))


def _outgrows(smooth: Fill, detailed: Fill, relief: float) -> bool:
    """Whether a fill rises above, or falls below, the smooth one by more than detail may."""
    if smooth.gap is None:
        return False
    region = smooth.region
    rim = region.to_global(region.vertices[region.loops()[0]])
    normal = normalized(area_vector(rim)[None])[0]
    allowed = np.concatenate([rim, smooth.positions]) @ normal
    heights = detailed.positions @ normal
    beyond = max(heights.max() - allowed.max(), allowed.min() - heights.min())
    return bool(beyond > relief + _OUTGROWTH * smooth.gap.loop.diameter)
