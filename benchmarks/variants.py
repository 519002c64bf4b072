"""Variants of preset auto: each switches one part back to the paper's, or off.

A variant is a function that replaces functions or settings of the package's modules, in the
process that calls it. To add one, decorate its function with `variant`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np
from meshlab_lowrank.grid_solver import GridSettings
from meshlab_lowrank.stages.stage3_similar_npc import global_matrix
from scipy import sparse

from meshlab_lowrank import grid_solver, hole_solver
from meshlab_lowrank.hole import HoleState
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, vertex_normals
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.stages import stage1_base_three_harmonic as stage1_smooth_base
from meshlab_lowrank.stages import stage4b_diffuse_fronts as stage4_front_diffusion
from meshlab_lowrank.stages.stage1b_fair_harmonic import harmonic_energy
from meshlab_lowrank.stages.stage2b_patches import Patches
from meshlab_lowrank.stages.stage2b_patches_grid import (
    HexagonalGrid,
    SurfaceLocator,
    hexagonal_grid,
)
from meshlab_lowrank.stages.stage2b_patches_rings import ring_patches
from meshlab_lowrank.stages.stage4a_complete_ridge import ridge_completion
from meshlab_lowrank.stages.stage4a_complete_svt import svt_complete
from meshlab_lowrank.stages.stage5_refine_truncated_gamma import refine
from meshlab_lowrank.stages.stage6b_update_iterative import iterative_update
from meshlab_lowrank.tuning import repeat_length
from meshlab_lowrank.tuning.fake_holes import FakeHoles, Trust, judge

Switch: TypeAlias = Callable[[], None]

FULL = "auto"
VARIANTS: dict[str, tuple[str, Switch]] = {FULL: ("auto, all parts", lambda: None)}
PAPER = InpaintParameters.paper()


def variant(name: str, title: str) -> Callable[[Switch], Switch]:
    """Enter a function into `VARIANTS`."""

    def enter(switch: Switch) -> Switch:
        VARIANTS[name] = title, switch
        return switch

    return enter


def run_variant(ms: Any, name: str) -> None:
    """Fill the selected loops of the current mesh with a variant of preset auto."""
    VARIANTS[name][1]()
    ms.meshing_inpaint_lowrank(selected=True, closerim=True, preset="auto")


def _replace(module: ModuleType, **parts: object) -> None:
    for name, part in parts.items():
        if not hasattr(module, name):
            msg = f"{module.__name__} has no {name} to replace."
            raise AttributeError(msg)
        setattr(module, name, part)


def _settings(**changes: Any) -> None:
    """Change settings in the fake holes and in the hole itself."""
    recover = grid_solver.recover_detail

    def changed(state: HoleState, settings: GridSettings, **rest: Any) -> HoleState:
        return recover(state, replace(settings, **changes), **rest)

    _replace(grid_solver, recover_detail=changed)


class _LastShape:
    """The shape that the last base was fitted to."""

    def __init__(self) -> None:
        self.state: HoleState | None = None
        with_base = grid_solver.with_base

        def remember(
            state: HoleState, settings: GridSettings, pull: FloatArray | BoolArray
        ) -> HoleState:
            self.state = state
            return with_base(state, settings, pull)

        _replace(grid_solver, with_base=remember)

    def ring_patches(self, centres: IntArray, size: int) -> Patches:
        """Patches of the paper on it."""
        if self.state is None:
            msg = "No base was fitted before the patches were laid."
            raise RuntimeError(msg)
        if len(centres) == 0:
            nothing = sparse.csr_array((0, len(self.state.positions)))
            return Patches(centres, np.zeros((0, 3, 3)), nothing, size)
        return ring_patches(self.state.positions, self.state.faces, centres, size)


@variant("faired_base", "base: the faired fill itself, frames from its own normals")
def _faired_base() -> None:
    def same(vertices: FloatArray, *_: object, cutoff: float) -> FloatArray:  # noqa: ARG001
        return vertices

    _replace(grid_solver, smooth_base=same)


@variant("biharmonic_base", "base: bi-harmonic low-pass, not three-harmonic")
def _biharmonic_base() -> None:
    low_pass = stage1_smooth_base.smooth_base

    def base(
        vertices: FloatArray, faces: IntArray, pull: FloatArray | BoolArray, *, cutoff: float
    ) -> FloatArray:
        def energy(points: FloatArray, triangles: IntArray) -> Any:
            # the same amplitude is left at the cut-off
            return (2.0 * np.pi / cutoff) ** 2 * harmonic_energy(points, triangles, 2)

        _replace(stage1_smooth_base, three_harmonic_energy=energy)
        return low_pass(vertices, faces, pull, cutoff=cutoff)

    _replace(grid_solver, smooth_base=base)
    _replace(repeat_length, smooth_base=base)


@variant("no_refits", "base fitted once, not again to the completed surface")
def _no_refits() -> None:
    _settings(refits=0)


@variant("pca_frames", "frames: principal axes of the surface (3.3.2), not of the base")
def _pca_frames() -> None:
    shape = _LastShape()

    def patches(
        locator: SurfaceLocator,
        base: FloatArray,
        _normals: FloatArray,
        centres: IntArray,
        grid: HexagonalGrid,
        *,
        angle: float = 0.0,
    ) -> Patches:
        first, second, third = shape.ring_patches(centres, grid.size).frames.transpose(1, 0, 2)
        cosine, sine = np.cos(angle), np.sin(angle)
        turned = [cosine * first + sine * second, cosine * second - sine * first, third]
        frames = np.stack(turned, axis=1)
        points = base[centres][:, None] + grid.offsets @ frames[:, :2]
        return Patches(centres, frames, locator.weights(points.reshape(-1, 3)), grid.size)

    _replace(grid_solver, grid_patches=patches)


@variant("ring_patches", "patches: rings of vertices in principal frames (3.3), no turns")
def _ring_patches() -> None:
    shape = _LastShape()

    def patches(
        _locator: SurfaceLocator,
        _base: FloatArray,
        _normals: FloatArray,
        centres: IntArray,
        grid: HexagonalGrid,
        **_: float,
    ) -> Patches:
        return shape.ring_patches(centres, grid.size)

    _no_turns()
    _replace(grid_solver, grid_patches=patches)


@variant("no_turns", "similar patches: each in one position, not in 12 turns")
def _no_turns() -> None:
    def unturned(radius: float, spacing: float) -> HexagonalGrid:
        grid = hexagonal_grid(radius, spacing)
        return HexagonalGrid(grid.offsets, grid.turns[:1])

    _settings(angles=1)
    _replace(grid_solver, hexagonal_grid=unturned)


@variant("svt", "completion: singular value thresholding (Eq. 5), not ridge")
def _svt() -> None:
    def complete(
        values: FloatArray, weights: FloatArray, groups: FloatArray, **_: float
    ) -> tuple[FloatArray, FloatArray]:
        completed = values.copy()
        partly = np.flatnonzero((weights == 0).any(axis=1))  # known entries are kept (Eq. 4)
        columns = np.concatenate([groups, values.reshape(len(values), 1, -1)], axis=1)[partly]
        observed = np.ones(columns.shape, dtype=np.bool_)
        observed[:, -1] = np.repeat(weights[partly] > 0, 3, axis=1)
        whole = svt_complete(columns, observed, tau=PAPER.tau, delta=PAPER.delta)
        completed[partly] = whole[:, -1].reshape(len(partly), *values.shape[1:])
        lengths = np.linalg.norm(completed, axis=2, keepdims=True)
        return completed / np.maximum(lengths, 1e-12), np.zeros(len(values))

    _replace(stage4_front_diffusion, ridge_completion=complete)


@variant("mean", "completion: plain mean of the group, not ridge")
def _mean() -> None:
    _settings(rank=0)


@variant("all_at_once", "diffusion: all at once, not by fronts of two rings")
def _all_at_once() -> None:
    _replace(stage4_front_diffusion, _FRONT_RINGS=10**6, _SHARE=0.0)


@variant("no_agreement", "no self-consistent passes")
def _no_agreement() -> None:
    _settings(passes=0, refit_passes=0)


@variant("no_deblurring", "averages at the vertices as they are, not deblurred")
def _no_deblurring() -> None:
    _replace(stage4_front_diffusion, _DEBLUR=0)


@variant("refinement", "in addition: truncated gamma norm (Eq. 6 to 16) after each completion")
def _refinement() -> None:
    def refined(values: FloatArray, *rest: Any, **more: Any) -> tuple[FloatArray, FloatArray]:
        completed, residual = ridge_completion(values, *rest, **more)
        omega = refine(
            global_matrix(completed), mu=PAPER.mu, beta=PAPER.beta, gamma=PAPER.gamma, m=PAPER.m
        )
        return omega.T.reshape(values.shape), residual

    _replace(stage4_front_diffusion, ridge_completion=refined)


@variant("iterative_update", "vertex update: 20 steps of the usual iteration, not direct")
def _iterative_update() -> None:
    def update(
        positions: FloatArray,
        faces: IntArray,
        *,
        directions: FloatArray,  # noqa: ARG001
        movable: BoolArray,
        normals: FloatArray,
        trusted: BoolArray,
    ) -> FloatArray:
        targets = np.where(trusted[:, None], normals, vertex_normals(positions, faces))
        return iterative_update(positions, faces, targets, movable, niter=20)

    _replace(grid_solver, direct_update=update)


@variant("fixed_length", "repeat length: 10 h, not measured and chosen by fake holes")
def _fixed_length() -> None:
    lengths = (10.0,)
    _replace(hole_solver, repeat_lengths=lambda _state, _seed: lengths, _LONG_LENGTH=np.inf)


@variant("no_trust", "detail put on whole, not scaled by what fake holes say")
def _no_trust() -> None:
    def whole(fake: FakeHoles, solved: HoleState) -> Trust:
        return replace(judge(fake, solved), strength=np.ones(3), explained=1.0)

    _replace(hole_solver, judge=whole)
