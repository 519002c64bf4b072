"""One hole from its faired fill to its final shape: tune, recover, trust, finish."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.hole import Hole, depth_of, start_hole
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.parameters import Detail
from meshlab_lowrank.pipeline import Pipeline, StageReport, library_around, recover
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.tuning.trust import Trust
from meshlab_lowrank.tuning.tune import NO_REPEAT, Tuned

_TOO_SMALL = "The surroundings are too small for a patch, so the fill is smooth."
_UNTRIED = "The detail was not tried out nearby, so how far it can be trusted is not known."
_TUNED, _BEGUN = 0.3, 0.6  # parts of the work that are done


@dataclass(frozen=True)
class Solution:
    """Positions of one hole's region, known vertices as they were.

    Attributes
    ----------
    positions : (n, 3) float64
        Local coordinates.
    trust : float
        See `HoleRecord`.
    reason : str
        Why the fill has no detail, or why its trust is not known; empty otherwise.
    relief : float
        How far the known surface rises above its base or falls below it at most, in local units.
    """

    positions: FloatArray
    trust: float
    reason: str
    relief: float = 0.0


def solve_hole(
    region: Region,
    pipeline: Pipeline,
    *,
    detail: Detail,
    report: StageReport,
    executor: Executor | None = None,
) -> Solution:
    """Bring detail onto the faired fill of one hole (Algorithm 1, stages 2 to 6).

    Parameters
    ----------
    region : Region
        Closed and faired.
    pipeline : Pipeline
    detail : {"calibrated", "full", "none"}
        See `InpaintParameters`.
    report : callable
        Called with the name of each stage and the part of this hole that is done.
    executor : Executor, optional
        Threads for batches of linear algebra.

    Returns
    -------
    Solution
    """
    unknown = ~region.known_vertices
    if not unknown.any() or detail == "none":
        return Solution(region.vertices, 0.0, "")
    hole = start_hole(
        region.vertices,
        region.faces,
        unknown=unknown,
        known_faces=region.known_faces,
        loop=region.loop,
        rim_normals=pipeline.rim_normals,
    )
    if not hole.measured.any():
        return Solution(hole.positions, 0.0, _TOO_SMALL)
    full = detail == "full"
    reason = "" if full else pipeline.tune.rules_out_around(hole)
    if reason:
        return Solution(hole.positions, 0.0, reason)
    tuned = _tuned(hole, pipeline, report, executor)
    if not (full or _repeats(tuned)):
        reason = _TOO_SMALL if tuned.trust is None else NO_REPEAT
        return Solution(hole.positions, 0.0, reason)
    solved = _with_detail(tuned, pipeline, full, report, executor)
    if solved is None:
        return Solution(hole.positions, 0.0, _TOO_SMALL)
    positions, trust, reason = solved.positions, math.nan, _UNTRIED
    if tuned.trust is not None:
        trust, reason = tuned.trust.explained, ""
        if not full:
            positions = _scaled(hole, positions, tuned.trust)
    finished = pipeline.finish(hole, positions, solved.base_normals)
    return Solution(finished, trust, reason, _relief(solved))


def _tuned(hole: Hole, pipeline: Pipeline, report: StageReport, executor: Executor | None) -> Tuned:
    """Tune to the surroundings with a cheaper copy of the pipeline."""
    trial = pipeline.for_trial()

    def attempt(fake: Hole, around: Hole) -> Hole | None:
        return recover(fake, trial, library=library_around(around, trial), executor=executor)

    def tell(part: float) -> None:
        report("choosing settings", 0.1 + (_TUNED - 0.1) * part)

    tell(0.0)
    return pipeline.tune(hole, attempt, tell)


def _repeats(tuned: Tuned) -> bool:
    return tuned.trust is not None and tuned.trust.worthwhile


def _with_detail(
    tuned: Tuned, pipeline: Pipeline, full: bool, report: StageReport, executor: Executor | None
) -> Hole | None:
    """Recover the detail, or copy relief where all is wanted and it doesn't predict itself."""
    if full and not _repeats(tuned):
        report("relief", _TUNED)
        copied = pipeline.relief(tuned.hole)
        if copied is not None:
            return copied
    solved = _recovered(tuned.hole, pipeline, full, report, executor)
    return pipeline.relief.calmed(solved) if full and solved is not None else solved


def _recovered(
    hole: Hole, pipeline: Pipeline, full: bool, report: StageReport, executor: Executor | None
) -> Hole | None:
    """Recover the detail; deep holes are begun with patches that see more at once."""
    begun, done = None, _TUNED
    if depth_of(hole).max() > pipeline.depth * hole.wavelength:
        report("long patches", done)
        deep = pipeline.for_depth()
        begun, done = recover(hole, deep, executor=executor), _BEGUN
        pipeline = replace(pipeline, passes=min(pipeline.passes, deep.passes))
    solved = recover(
        hole if begun is None else begun,
        replace(pipeline, copying=full and pipeline.copying),
        report=lambda stage, part: report(stage, done + (1.0 - done) * part),
        executor=executor,
    )
    return begun if solved is None else solved


def _relief(hole: Hole) -> float:
    """Largest distance of the known surface from its base along the normals of that."""
    known = hole.measured & ~hole.unknown
    above = np.einsum("ij,ij->i", hole.positions - hole.base, hole.base_normals)
    return float(np.abs(above[known]).max(initial=0.0))


def _scaled(hole: Hole, positions: FloatArray, trust: Trust) -> FloatArray:
    """Scale the detail by how far it can be trusted at each depth."""
    strength = np.where(hole.unknown, trust.at(depth_of(hole)), 0.0)
    return hole.positions + strength[:, None] * (positions - hole.positions)
