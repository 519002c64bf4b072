"""The stages of one hole, in their order."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from meshlab_lowrank import grid_solver, ring_solver
from meshlab_lowrank.hole_state import start_state
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.stage0_region import Region

StageReport: TypeAlias = Callable[[str, float], None]


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
    if parameters.preset == "paper":
        state = ring_solver.recover_detail(
            state,
            parameters,
            report=lambda stage, part: report(stage, 0.1 + 0.9 * part),
            executor=executor,
        )
    else:
        report("detail", 0.1)
        settings = grid_solver.GridSettings(seed=parameters.seed)
        state = grid_solver.recover_detail(state, settings, executor=executor)
    if np.array_equal(state.positions, region.vertices):
        reason = "The surroundings are too small for a patch, so the fill is smooth."
        return Solution(region.vertices, 0.0, reason)
    return Solution(state.positions, 0.0, "")
