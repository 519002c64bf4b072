"""The stages of the paper preset for one hole: Algorithm 1 as written, stages 2 to 6."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np

from meshlab_lowrank.hole import HoleState
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, vertex_normals
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.stages.stage2_patches import Patches
from meshlab_lowrank.stages.stage2_patches_rings import ring_centres, ring_patches
from meshlab_lowrank.stages.stage3_similar_npc import global_matrix
from meshlab_lowrank.stages.stage4_complete_svt import svt_complete
from meshlab_lowrank.stages.stage4_diffuse_rounds import average_at_vertices, iterative_diffusion
from meshlab_lowrank.stages.stage5_refine_truncated_gamma import refine
from meshlab_lowrank.stages.stage6_update_iterative import iterative_update

StageReport = Callable[[str, float], object]


def recover_detail(
    state: HoleState,
    parameters: InpaintParameters,
    *,
    report: StageReport | None = None,
    executor: Executor | None = None,
) -> HoleState:
    """Repeat stages 2 to 6 of Algorithm 1, S_iter times.

    Every pass takes the normals of the hole as missing again; what a pass leaves for the next is
    the shape on which patches and frames are laid.

    Parameters
    ----------
    state : HoleState
        Closed and smooth; the unknown vertices are those of M^1 - M^0.
    parameters : InpaintParameters
    report : callable, optional
        Called with the name of each stage before it begins, and the part of all that is done.
    executor : Executor, optional
        Threads for the completion of patch groups.

    Returns
    -------
    HoleState
        New positions of the unknown vertices and the normals that they were moved to.
    """
    passes = parameters.s_iter
    for number in range(passes):

        def tell(stage: str, part: float, number: int = number) -> None:
            if report is not None:
                report(stage, (number + part) / passes)

        tell("patches", 0.0)
        normals = observed_normals(state)
        patches = hole_patches(state, parameters)
        tell("completion", 0.1)
        values, mask = completed(patches, normals, ~state.unknown, parameters, executor=executor)
        tell("refinement", 0.9)
        recovered = average_at_vertices(patches, refined(values, parameters), mask)
        tell("vertex update", 0.95)
        normals = np.where(state.unknown[:, None], recovered, normals)
        state = moved(state, normals, parameters)
    return state


def observed_normals(state: HoleState) -> FloatArray:
    """Compute the normals of M^0, (n, 3), from known faces alone: the rim HB has them too."""
    known_faces = ~state.unknown[state.faces].any(axis=1)
    return vertex_normals(state.positions, state.faces[known_faces])


def hole_patches(state: HoleState, parameters: InpaintParameters) -> Patches:
    """Extract the patches of the r-ring neighbourhood of the rim (stage 2)."""
    inside = np.flatnonzero(state.unknown)
    filled = state.faces[state.unknown[state.faces].any(axis=1)]
    rim = np.setdiff1d(filled, inside)
    centres = ring_centres(state.faces, len(state.positions), rim, inside, parameters.r)
    return ring_patches(state.positions, state.faces, centres, parameters.sp)


def completed(
    patches: Patches,
    normals: FloatArray,
    known: BoolArray,
    parameters: InpaintParameters,
    *,
    executor: Executor | None = None,
) -> tuple[FloatArray, BoolArray]:
    """Recover the missing normals of all patches (stages 3 and 4); see `iterative_diffusion`."""
    complete = partial(
        svt_complete,
        tau=parameters.tau,
        delta=parameters.delta,
        niter=parameters.completioniterations,
        tol=parameters.completiontolerance,
    )
    return iterative_diffusion(
        patches, normals, known, k=parameters.k, complete=complete, executor=executor
    )


def refined(values: FloatArray, parameters: InpaintParameters) -> FloatArray:
    """Refine the normals (w, sp, 3) of all patches together (stage 5)."""
    omega = refine(
        global_matrix(values),
        mu=parameters.mu,
        beta=parameters.beta,
        gamma=parameters.gamma,
        m=parameters.m,
        niter=parameters.refinementiterations,
        tol=parameters.refinementtolerance,
    )
    return omega.T.reshape(values.shape)


def moved(state: HoleState, normals: FloatArray, parameters: InpaintParameters) -> HoleState:
    """Move the unknown vertices to their normals (stage 6).

    Vertices whose normal no patch could recover take that of the smooth fill.
    """
    smooth = vertex_normals(state.positions, state.faces)
    normals = np.where(normals.any(axis=1, keepdims=True), normals, smooth)
    positions = iterative_update(
        state.positions,
        state.faces,
        normals,
        state.unknown,
        niter=parameters.updateiterations,
    )
    return replace(state, positions=positions, normals=normals)
