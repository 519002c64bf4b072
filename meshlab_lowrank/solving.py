"""One hole from its faired fill to its final shape: tune, recover, trust, finish."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.hole import Hole, depth_of, with_recovered
from meshlab_lowrank.leveling import Widen, choose_level, fill_depths, finer_level
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, vertex_normals
from meshlab_lowrank.parameters import Detail
from meshlab_lowrank.pipeline import Pipeline, StageReport, library_around, recover
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1c_level import Level, carried, carried_onto
from meshlab_lowrank.stages.stage1c_level_mesh_itself import mesh_itself
from meshlab_lowrank.tuning.conflict import UNRECOVERED, conflict
from meshlab_lowrank.tuning.local_trust import local_trust
from meshlab_lowrank.tuning.trust import Trust
from meshlab_lowrank.tuning.tune import NO_REPEAT, Look, Tuned

_TOO_SMALL = "The surroundings are too small for a patch, so the fill is smooth."
_UNTRIED = "The detail was not tried out nearby, so how far it can be trusted is not known."
_LEAST_LEFT = 0.01
_NO_GAIN = 1.0  # of the variance of the detail in fake holes is left by the smooth fill
_LEAST_STRENGTH = 1e-6
_TUNED, _BEGUN, _FINER = 0.3, 0.6, 0.995  # parts of the work that are done


@dataclass(frozen=True)
class Solution:
    """Positions and faces of one hole's region, what is known as it was.

    Attributes
    ----------
    positions : (n, 3) float64
        Local coordinates.
    faces : (m, 3) int64
        As many as the region has; faces of the mesh stay, also those of a selected patch.
    trust : float
        See `HoleRecord`.
    reason : str
        Why the fill has no detail, or why its trust is not known; empty otherwise.
    trusts : (v,) float64
        Of the new vertices, see `InpaintResult`.
    shares : (v,) float64
        Their error over that of the smooth fill.
    guessed : bool
        Whether the detail only looks right: what it moves adds to that error.
    relief : float
        How far the known surface rises above its base or falls below it at most, and that lies
        from the smooth fill, in local units.
    """

    positions: FloatArray
    faces: IntArray
    trust: float
    reason: str
    trusts: FloatArray
    shares: FloatArray
    relief: float = 0.0
    guessed: bool = False

    @classmethod
    def smooth(cls, region: Region, reason: str) -> Solution:
        """Leave the fill as it is."""
        count = int(np.count_nonzero(~region.known_vertices))
        trusts, shares = np.zeros(count), np.ones(count)
        return cls(region.vertices, region.faces, 0.0, reason, trusts, shares)


@dataclass(frozen=True)
class _Detailed:
    """A hole with detail, if it has any, and how far that can be believed, if anything tells.

    It is worked on at ``level``, and ``laid`` has the smooth fill that the detail is put on.
    ``left`` is the part of the variance of what a smooth fill misses that is missed at each new
    vertex, (v,); None where no trial tells it. ``copied`` tells whether it has copied relief.
    """

    level: Level
    laid: Hole
    solved: Hole | None
    trust: Trust | None
    left: FloatArray | None
    copied: bool = False


def solve_hole(
    region: Region,
    pipeline: Pipeline,
    *,
    detail: Detail,
    report: StageReport,
    executor: Executor | None = None,
    widen: Widen | None = None,
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
    widen : callable, optional
        Gives the region with surroundings so many times as wide; by default these are all.

    Returns
    -------
    Solution
    """
    unknown = ~region.known_vertices
    if not unknown.any() or detail == "none":
        return Solution.smooth(region, "")
    level, look = choose_level(region, widen, pipeline)
    full, reason = detail == "full", look.reason
    if not level.hole.measured.any():
        reason = _TOO_SMALL
    elif full:
        reason = ""
    if reason:
        return Solution.smooth(region, reason)
    detailed = _detailed(
        region, level, look, pipeline, report, executor=executor, widen=widen, full=full
    )
    level, trust = detailed.level, detailed.trust
    laid, solved = detailed.laid, detailed.solved
    if solved is None:
        return Solution.smooth(region, _TOO_SMALL if trust is None else NO_REPEAT)
    calm = full and not detailed.copied
    finished = _finished(region, level, laid, solved, pipeline, calm=calm)
    faces = pipeline.edges(finished, region.faces, ~region.known_faces & (region.face_ids < 0))
    relief = (_relief(solved) + _moved(level.hole, laid)) * level.spacing
    explained, reason = (math.nan, _UNTRIED) if trust is None else (trust.explained, "")
    left = detailed.left
    if left is None:
        trusts = np.full(int(np.count_nonzero(unknown)), explained)
        shares = np.ones(len(trusts))
        return Solution(finished, faces, explained, reason, trusts, shares, relief, guessed=True)
    trusts, shares = 1.0 - np.minimum(left, 1.0), np.sqrt(np.maximum(left, _LEAST_LEFT))
    return Solution(finished, faces, explained, reason, trusts, shares, relief)


def _detailed(
    region: Region,
    level: Level,
    look: Look,
    pipeline: Pipeline,
    report: StageReport,
    *,
    executor: Executor | None,
    widen: Widen | None,
    full: bool,
) -> _Detailed:
    """Give a hole detail, and tell how far it can be believed, where anything tells that."""
    level, tuned = _tuned_where_best(
        region, level, look, pipeline, report, executor=executor, widen=widen
    )
    laid, solved = tuned.hole, None
    if tuned.evidence is not None and tuned.evidence.promising:
        laid = pipeline.drape(laid)
        solved = _recovered(laid, pipeline, full, report, executor)
    trust = _judged(solved, tuned)
    if trust is not None and not trust.worthwhile:
        solved = None
    if full and solved is None:
        report("relief", _BEGUN)
        own = mesh_itself(region, rim_normals=pipeline.rim_normals)  # others round what they carry
        solved = pipeline.relief(own.hole)
        if solved is not None:
            return _Detailed(own, own.hole, solved, _judged(None, tuned), None, copied=True)
        laid = pipeline.drape(tuned.hole)
        solved = _recovered(laid, pipeline, full, report, executor)
        return _Detailed(level, laid, solved, _judged(solved, tuned), None)
    if trust is None or tuned.evidence is None:
        return _Detailed(level, laid, solved, None, None)
    depths = fill_depths(region) / level.spacing  # trials were made in its edges
    left = trust.missed(depths, whole=full)
    if solved is None:
        return _Detailed(level, laid, None, trust, left)
    local = None
    if not full:
        local = local_trust(tuned.evidence, solved, laid.positions * level.spacing)
    finer = finer_level(level, widen, pipeline)
    if finer is not None:
        report("finer surface", _FINER)
        laid, solved = _recovered_again(
            level, finer, laid, solved, pipeline, full=full, executor=executor
        )
        level = finer
    if local is not None:
        strength = local.at(laid.positions * level.spacing)
        solved = replace(solved, positions=_scaled(laid, solved.positions, strength))
        here = local.at(region.vertices[~region.known_vertices])
        kept = here / np.maximum(np.maximum(trust.at(depths), here), _LEAST_STRENGTH)
        left = 1.0 - kept * (1.0 - left)
    return _Detailed(level, laid, solved, trust, left)


def _judged(solved: Hole | None, tuned: Tuned) -> Trust | None:
    """Tell how far what was recovered can be believed; None where nothing tells."""
    if tuned.evidence is None:
        return None
    told = UNRECOVERED if solved is None else conflict(solved, solved.unknown)
    return tuned.evidence.trust(told)


def _finished(
    region: Region, level: Level, laid: Hole, solved: Hole, pipeline: Pipeline, *, calm: bool
) -> FloatArray:
    """Bring what was solved on a level onto the mesh, and look at it there."""
    smooth = replace(region, vertices=carried(region, level, laid.positions))
    start = mesh_itself(smooth, rim_normals=pipeline.rim_normals).hole
    normals = solved.base_normals if level.is_mesh else start.base_normals
    moved = carried(region, level, solved.positions)
    if calm:
        moved = pipeline.relief.calmed(replace(start, positions=moved)).positions
    return pipeline.finish(start, moved, normals)


def _tuned_where_best(
    region: Region,
    level: Level,
    look: Look,
    pipeline: Pipeline,
    report: StageReport,
    *,
    executor: Executor | None,
    widen: Widen | None,
) -> tuple[Level, Tuned]:
    """Tune on a level; on an even surface too where trials on the mesh itself gain nothing."""
    tuned = _tuned(level.hole, look, pipeline, report, executor)
    told = tuned.evidence
    if not level.is_mesh or told is None or told.hopeless or told.error < _NO_GAIN:
        return level, tuned
    other, look = choose_level(region, widen, pipeline.for_even())
    if other.is_mesh or look.reason:
        return level, tuned
    again = _tuned(other.hole, look, pipeline, report, executor)
    if again.evidence is None or again.evidence.error >= told.error:
        return level, tuned
    return other, again


def _tuned(
    hole: Hole, look: Look, pipeline: Pipeline, report: StageReport, executor: Executor | None
) -> Tuned:
    """Tune to the surroundings with a cheaper copy of the pipeline."""
    trial = pipeline.for_trial()

    def attempt(fake: Hole, around: Hole) -> Hole | None:
        return recover(fake, trial, library=library_around(around, trial), executor=executor)

    def tell(part: float) -> None:
        report("choosing settings", 0.1 + (_TUNED - 0.1) * part)

    tell(0.0)
    return pipeline.tune(hole, look, attempt, tell)


def _recovered(
    hole: Hole, pipeline: Pipeline, full: bool, report: StageReport, executor: Executor | None
) -> Hole | None:
    """Recover the detail; deep holes are begun with patches that see more at once."""
    begun, done = None, _TUNED
    if depth_of(hole).max() > pipeline.depth * hole.patch_wavelength:
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


def _recovered_again(
    level: Level,
    finer: Level,
    laid: Hole,
    solved: Hole,
    pipeline: Pipeline,
    *,
    full: bool,
    executor: Executor | None,
) -> tuple[Hole, Hole]:
    """Recover once more on a finer surface; give it the smooth fill, and with the detail.

    What the coarse one gave is start and base there. It has the phase, but its edges cut creases.
    """
    own = finer.hole
    points, known = own.positions * finer.spacing, ~own.unknown
    wavelength = laid.wavelength * level.spacing / finer.spacing
    smooth, begun = (
        replace(
            own,
            positions=carried_onto(points, own.faces, known, level, positions) / finer.spacing,
            wavelength=wavelength,
            shortening=laid.shortening,
            draped=True,
        )
        for positions in (laid.positions, solved.positions)
    )
    begun = with_recovered(begun, vertex_normals(begun.positions, own.faces), ~own.measured)
    once = replace(pipeline.for_finer(), copying=full and pipeline.copying)
    return smooth, recover(begun, once, executor=executor) or begun


def _moved(faired: Hole, laid: Hole) -> float:
    """How far the smooth fill was moved at most."""
    return float(np.linalg.norm(laid.positions - faired.positions, axis=1).max(initial=0.0))


def _relief(hole: Hole) -> float:
    """Largest distance of the known surface from its base along the normals of that."""
    known = hole.measured & ~hole.unknown
    above = np.einsum("ij,ij->i", hole.positions - hole.base, hole.base_normals)
    return float(np.abs(above[known]).max(initial=0.0))


def _scaled(hole: Hole, positions: FloatArray, strength: FloatArray) -> FloatArray:
    """Scale the detail by how far it can be trusted at each vertex, (n,)."""
    strength = np.where(hole.unknown, strength, 0.0)
    return hole.positions + strength[:, None] * (positions - hole.positions)
