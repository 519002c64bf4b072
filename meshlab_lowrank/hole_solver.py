"""The stages of one hole, in their order."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from meshlab_lowrank import grid_solver, ring_solver
from meshlab_lowrank.grid_solver import GridSettings
from meshlab_lowrank.hole import HoleState, start_state
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage6_update_direct import without_folds
from meshlab_lowrank.tuning.fake_holes import Trust, depth_of, judge, make_fake_holes
from meshlab_lowrank.tuning.repeat_length import SHORTEST, repeat_lengths

StageReport: TypeAlias = Callable[[str, float], None]

_TOO_SMALL = "The surroundings are too small for a patch, so the fill is smooth."
_NO_REPEAT = "The detail of the surroundings doesn't predict itself, so the fill is smooth."
_TRIAL: dict[str, Any] = {
    "refits": 1,
    "passes": 2,
    "target_spacing": 2.0,
    "sources": 500,
}
_LONG_LENGTH, _SHORTER = 10.0, 0.7  # shorter patches are tried too: they find more that is alike
_ALIKE = 0.15  # relative difference of two lengths, only one of which is tried
_DEEP = 1.8  # wavelengths from the rim, from which short patches lose the phase
_LONG: dict[str, Any] = {"radius": 1.0, "angles": 4, "refits": 1, "passes": 2}


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
        Why the fill has no detail; empty otherwise.
    """

    positions: FloatArray
    trust: float
    reason: str


def solve_hole(
    region: Region, parameters: InpaintParameters, report: StageReport, executor: Executor
) -> Solution:
    """Bring detail onto the faired fill of one hole (Algorithm 1, stages 2 to 6).

    Parameters
    ----------
    region : Region
        Closed and faired.
    parameters : InpaintParameters
    report : callable
        Called with the name of each stage and the part of this hole that is done.
    executor : Executor
        Threads for batches of linear algebra.

    Returns
    -------
    Solution
    """
    unknown = ~region.known_vertices
    if not unknown.any() or parameters.detail == "none":
        return Solution(region.vertices, 0.0, "")
    state = start_state(region.vertices, region.faces, unknown)
    if parameters.preset == "auto":
        return _solve_auto(state, parameters, report, executor)
    solved = ring_solver.recover_detail(
        state,
        parameters,
        report=lambda stage, part: report(stage, 0.1 + 0.9 * part),
        executor=executor,
    )
    if np.array_equal(solved.positions, state.positions):
        return Solution(state.positions, 0.0, _TOO_SMALL)
    return Solution(solved.positions, 0.0, "")


def _solve_auto(
    state: HoleState, parameters: InpaintParameters, report: StageReport, executor: Executor
) -> Solution:
    """Choose the settings by fake holes, recover the detail, and scale it by its trust."""
    if not state.measured.any():
        return Solution(state.positions, 0.0, _TOO_SMALL)
    report("choosing settings", 0.1)
    settings, trust = _chosen(state, parameters, report, executor)
    full = parameters.detail == "full"
    if trust is None and not full:
        return Solution(state.positions, 0.0, _TOO_SMALL)
    if trust is not None and not full and not trust.worthwhile:
        return Solution(state.positions, 0.0, _NO_REPEAT)
    begun, done = state, 0.3
    if depth_of(state).max() > _DEEP * settings.wavelength:
        report("long patches", done)
        long = replace(settings, **_LONG)
        begun = grid_solver.recover_detail(state, long, executor=executor)
        settings, done = replace(settings, refits=min(settings.refits, 1)), 0.6
    solved = grid_solver.recover_detail(
        begun,
        replace(settings, sharp=full),
        report=lambda stage, part: report(stage, done + (1.0 - done) * part),
        executor=executor,
    )
    if solved is state:
        return Solution(state.positions, 0.0, _TOO_SMALL)
    positions, explained = solved.positions, 0.0
    if trust is not None:
        explained = trust.explained
        if not full:
            strength = np.where(state.unknown, trust.at(depth_of(state)), 0.0)
            detail = positions - state.positions
            positions = state.positions + strength[:, None] * detail
    positions = without_folds(state.positions, positions, state.faces, solved.base_normals)
    return Solution(positions, explained, "")


def _chosen(
    state: HoleState, parameters: InpaintParameters, report: StageReport, executor: Executor
) -> tuple[GridSettings, Trust | None]:
    """Try the candidates in fake holes; no trust where there is no room for any."""
    candidates = _candidates(state, parameters)
    chosen: tuple[GridSettings, Trust | None] = candidates[0], None
    fake = make_fake_holes(state, parameters.seed)
    if fake is None:
        return chosen
    for candidate in candidates:
        trying = replace(candidate, **_TRIAL)
        trial = grid_solver.recover_detail(
            fake.state,
            trying,
            library=grid_solver.library_around(state, trying),
            parts=fake.disc,
            executor=executor,
        )
        report("choosing settings", 0.2)
        if trial is fake.state:  # no room for whole patches; shorter ones may do
            if chosen[1] is None and candidate.wavelength >= 2.0 * SHORTEST:
                candidates.append(replace(candidate, wavelength=0.5 * candidate.wavelength))
            continue
        trust = judge(fake, trial)
        if chosen[1] is None or trust.error < chosen[1].error:
            chosen = candidate, trust
            shorter = _SHORTER * candidate.wavelength
            if candidate.wavelength >= _LONG_LENGTH and not _has(candidates, shorter):
                candidates.append(replace(candidate, wavelength=shorter))
    return chosen


def _has(candidates: list[GridSettings], wavelength: float) -> bool:
    return any(abs(each.wavelength / wavelength - 1.0) < _ALIKE for each in candidates)


def _candidates(state: HoleState, parameters: InpaintParameters) -> list[GridSettings]:
    """One setting for each repeat length, with what the user fixed."""
    fixed: dict[str, Any] = {"seed": parameters.seed}
    if parameters.patchsize is not None:
        fixed["across"] = float(np.sqrt(parameters.patchsize * np.sqrt(3.0) / (2.0 * np.pi)))
    if parameters.similarpatches is not None:
        fixed["k"] = parameters.similarpatches
    if parameters.iterations is not None:
        fixed["refits"] = parameters.iterations - 1
    lengths = repeat_lengths(state, parameters.seed)
    return [GridSettings(wavelength=length, **fixed) for length in lengths]
