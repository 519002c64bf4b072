"""Stage 4, diffusion by fronts: recover normals from the rim inwards, then all together."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from meshlab_lowrank.hole import HoleState
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, normalized
from meshlab_lowrank.mesh.topology import vertex_adjacency, vertex_rings
from meshlab_lowrank.stages.stage2_patches import KNOWN_SHARE, Patches
from meshlab_lowrank.stages.stage3_similar_masked_distance import (
    PatchLibrary,
    run_batches,
    similar_patches,
)
from meshlab_lowrank.stages.stage4_complete_ridge import ridge_completion

RECOVERED_WEIGHT = 0.3  # of a recovered normal against a measured one
_FRONT_RINGS = 2  # rings that a front advances; all at once is less exact
_SHARE = 0.5  # known part of a patch that may advance the front
_DEBLUR = 2  # corrections of the blur that interpolation back and forth leaves
SHORTLIST = 48  # patches that a target is compared with after the first of several passes
_RESIDUAL_FLOOR = 0.02  # squared normal distance below which patches count alike


@dataclass(frozen=True)
class Completion:
    """What completes the targets of one pass.

    Attributes
    ----------
    targets : Patches
        t patches around and inside the hole.
    falloff : (sp,) float64
        Weight of each sample's estimate, falling from the centre of the patch.
    library : PatchLibrary
    k : int
        Similar patches per group.
    rank : int
    ridge : float
    barred : (t, w) bool, optional
        Patches of the library that a target may not take; at least `SHORTLIST` others are left.
    executor : Executor or None
        Threads for the batches.
    """

    targets: Patches
    falloff: FloatArray
    library: PatchLibrary
    k: int
    rank: int
    ridge: float
    barred: BoolArray | None = None
    executor: Executor | None = None


def diffuse(state: HoleState, completion: Completion) -> HoleState:
    """Recover missing normals inwards, two rings a front (paper, section 3.4.2).

    Targets that are at least half known are completed; only what lies within two rings of the
    known is accepted, and counts as known for the next front.
    """
    adjacency = vertex_adjacency(state.faces, len(state.positions))
    size = (len(completion.targets), completion.targets.size)
    while True:
        present = state.weights > 0
        share = (completion.targets.sampler @ present.astype(np.float64)).reshape(size)
        share = share.mean(axis=1)
        waiting = share < 1.0 - 1e-9
        least = min(_SHARE, 0.999 * share[waiting].max(initial=0.0))
        chosen = np.flatnonzero(waiting & (share >= least) & (share > 0))
        if len(chosen) == 0:
            return state
        recovered, votes, _ = _estimates(state, completion, chosen)
        front = vertex_rings(adjacency, np.flatnonzero(present), _FRONT_RINGS) > 0
        accepted = front & (votes > 0)
        if not accepted.any():
            return state
        state = _accept(state, recovered, accepted)


def agree(state: HoleState, completion: Completion, passes: int) -> HoleState:
    """Match every target that touches the hole again on all its samples, and average.

    Parameters
    ----------
    state : HoleState
    completion : Completion
    passes : int

    Returns
    -------
    HoleState
    """
    missing = (~state.measured).astype(np.float64)
    touching = (completion.targets.sampler @ missing).reshape(len(completion.targets), -1)
    chosen = np.flatnonzero(touching.max(axis=1) > 0)
    shortlist = None
    for _ in range(passes):
        recovered, votes, shortlist = _estimates(state, completion, chosen, shortlist)
        state = _accept(state, recovered, ~state.measured & (votes > 0))
    return state


def _accept(state: HoleState, recovered: FloatArray, accepted: BoolArray) -> HoleState:
    normals = np.where(accepted[:, None], recovered, state.normals)
    weights = np.where(accepted, RECOVERED_WEIGHT, state.weights)
    return replace(state, normals=normals, weights=weights)


def _estimates(
    state: HoleState,
    completion: Completion,
    chosen: IntArray,
    shortlist: IntArray | None = None,
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Complete the chosen targets and average the overlapping estimates at the vertices.

    With a shortlist, each target looks for similar patches in its row of it only.

    Returns
    -------
    normals : (n, 3) float64
    votes : (n,) float64
        Sum of the weights, 0 where no target says anything.
    shortlist : (c, 48) int64
        The patches of the library most similar to each chosen target.
    """
    targets, size = completion.targets, completion.targets.size
    rows = (chosen[:, None] * size + np.arange(size)).ravel()
    sampler = targets.sampler[rows]
    present = (state.weights > 0).astype(np.float64)

    def complete(batch: slice) -> tuple[FloatArray, FloatArray, IntArray]:
        part = sampler[batch.start * size : batch.stop * size]
        frames = targets.frames[chosen[batch]]
        shape = (len(frames), size)
        weights = np.where(part @ present >= KNOWN_SHARE, part @ state.weights, 0.0)
        sums = normalized(part @ (state.normals * state.weights[:, None]))
        sums *= weights[:, None] > 0
        values = sums.reshape(*shape, 3) @ frames.transpose(0, 2, 1)
        weights = weights.reshape(shape)
        library = completion.library
        if shortlist is None:
            wanted = max(SHORTLIST, completion.k)
            barred = None if completion.barred is None else completion.barred[chosen[batch]]
            listed = similar_patches(values, weights, library, wanted, barred=barred)
            nearest = listed[:, : completion.k]
        else:
            listed = shortlist[batch]
            nearest = similar_patches(values, weights, library, completion.k, among=listed)
        groups = library.rows[nearest].astype(np.float64)
        completed, residual = ridge_completion(
            values, weights, groups, rank=completion.rank, ridge=completion.ridge
        )
        vote = completion.falloff / (residual[:, None] + _RESIDUAL_FLOOR)
        return (completed @ frames).reshape(-1, 3), vote.ravel(), listed

    parts = run_batches(complete, len(chosen), completion.executor)
    values = np.concatenate([part[0] for part in parts])
    votes = np.concatenate([part[1] for part in parts])
    back = sparse.csr_array(sampler.T)
    weight = back @ votes
    share = np.divide(1.0, weight, out=np.zeros_like(weight), where=weight > 0)[:, None]
    normals = share * (back @ (values * votes[:, None]))
    for _ in range(_DEBLUR):
        normals = normals + share * (back @ ((values - sampler @ normals) * votes[:, None]))
    return normalized(normals), weight, np.concatenate([part[2] for part in parts])
