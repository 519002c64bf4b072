"""Iterative diffusion: patches recovered near the rim carry on inwards (paper, section 3.4.2)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from typing import TypeAlias

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, normalized
from meshlab_lowrank.stages.stage2_patches import Patches, normals_in
from meshlab_lowrank.stages.stage3_similar_npc import (
    most_similar,
    normal_patch_covariance,
    similar_groups,
)

CompleteGroups: TypeAlias = Callable[[FloatArray, BoolArray], FloatArray]

_KNOWN_PART = 0.5  # of a patch that is completed while others like it remain
_GROUPS_AT_ONCE = 16  # the groups of a batch stay in the processor's cache


def iterative_diffusion(
    patches: Patches,
    normals: FloatArray,
    known: BoolArray,
    *,
    k: int,
    complete: CompleteGroups,
    executor: Executor | None = None,
    callback: Callable[[int], object] | None = None,
) -> tuple[FloatArray, BoolArray]:
    """Recover the missing normals of all patches, from the rim of the hole inwards.

    Each round is steps 1 to 3 of section 3.4.2 for a batch of patches: select similar patches
    from Omega_M (all of it, incomplete patches too), complete the groups, write the recovered
    columns back. The paper leaves open what follows:

    * A batch is all patches with missing normals of which at least half is known; where none is
      left or the last batch brought nothing, all of which anything is known. All groups of a batch
      are taken from the same Omega_M, so their order doesn't matter.
    * A normal counts as recovered where some patch of the group has it; elsewhere the completion
      can only say zero, and the normal stays missing for a later round.
    * Recovered columns keep their length: shrinkage makes doubtful normals short, and short ones
      weigh little in averages.
    * An all-missing column stays zero in any group. It becomes known through its vertices: after
      each round the recovered normals are rotated back and averaged at vertices, and whatever is
      still missing there in other patches takes that average.
    * The rounds end when nothing is missing, or when a batch of all patches of which anything is
      known brings nothing.

    Parameters
    ----------
    patches : Patches
        w patches of sp samples over n vertices.
    normals : (n, 3) float64
        Unit normals, read where known.
    known : (n,) bool
    k : int
        Similar patches per group.
    complete : callable
        Takes groups (t, 3 sp, k + 1) and what is observed in them, returns the completed groups.
    executor : Executor, optional
        Threads for the groups of a batch; the result doesn't depend on them.
    callback : callable, optional
        Called with the number of missing normals before every round.

    Returns
    -------
    values : (w, sp, 3) float64
        Normals in the frames of their patches, Omega'_M; zero where still missing.
    mask : (w, sp) bool
        Normals that are known or recovered.
    """
    values, mask = normals_in(patches, normals, known)
    exists = (np.diff(patches.sampler.indptr) > 0).reshape(mask.shape)
    size = np.maximum(exists.sum(axis=1), 1)
    at_vertices = np.where(known[:, None], normals, 0.0)
    least = _KNOWN_PART
    while True:
        missing = exists & ~mask
        share = mask.sum(axis=1) / size
        targets = np.flatnonzero(missing.any(axis=1) & (share >= least) & (share > 0.0))
        recovered, fresh = _complete_columns(
            values, mask, missing, targets, k=k, complete=complete, executor=executor
        )
        if not fresh.any():
            if least == 0.0:
                return values, mask
            least = 0.0
            continue
        if callback is not None:
            callback(int(missing.sum()))
        values = np.where(fresh[..., None], recovered, values)
        average = average_at_vertices(patches, values, fresh)
        told = np.asarray(at_vertices.any(axis=1))
        at_vertices = np.where(told[:, None], at_vertices, average)
        shared, present = normals_in(patches, at_vertices, told | average.any(axis=1))
        mask |= fresh
        values = np.where((present & ~mask)[..., None], shared, values)
        mask |= present
        least = _KNOWN_PART


def average_at_vertices(patches: Patches, values: FloatArray, mask: BoolArray) -> FloatArray:
    """Rotate the normals of all patches back and average them at each vertex (section 3.4.3).

    Parameters
    ----------
    patches : Patches
    values : (w, sp, 3) float64
        In the frames of the patches.
    mask : (w, sp) bool
        Samples that count.

    Returns
    -------
    (n, 3) float64
        Unit normals; zero at vertices of no such sample.
    """
    back = np.where(mask[..., None], values, 0.0) @ patches.frames  # rows n^T R_i = (R_i^-1 n)^T
    return normalized(patches.sampler.T @ back.reshape(-1, 3))


def _complete_columns(
    values: FloatArray,
    mask: BoolArray,
    missing: BoolArray,
    targets: IntArray,
    *,
    k: int,
    complete: CompleteGroups,
    executor: Executor | None,
) -> tuple[FloatArray, BoolArray]:
    """Complete the columns of the targets.

    Returns Omega_M with their recovered normals, (w, sp, 3), and a mask (w, sp) of these.
    """
    recovered, fresh = values.copy(), np.zeros_like(mask)
    if len(targets) == 0:
        return recovered, fresh
    similar = most_similar(*normal_patch_covariance(values), targets, k)

    def complete_some(begin: int) -> None:
        batch = targets[begin : begin + _GROUPS_AT_ONCE]
        chosen = similar[begin : begin + _GROUPS_AT_ONCE]
        groups, observed = similar_groups(values, mask, batch, chosen)
        columns = complete(groups, observed)[:, :, 0].reshape(len(batch), -1, 3)
        supported = observed[:, ::3].any(axis=2) & columns.any(axis=2)
        fresh[batch] = missing[batch] & supported
        recovered[batch] = np.where(fresh[batch][..., None], columns, values[batch])

    begins = range(0, len(targets), _GROUPS_AT_ONCE)
    list(executor.map(complete_some, begins) if executor else map(complete_some, begins))
    return recovered, fresh
