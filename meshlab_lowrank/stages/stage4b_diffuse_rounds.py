"""Stage 4, diffusion: the paper's rounds of completion, each on what the last recovered (3.4.2)."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.batches import run_batches
from meshlab_lowrank.hole import Hole, forgotten
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2b_patches import Patches, PatchLayer, normals_in
from meshlab_lowrank.stages.stage3_similar import Columns, Search, Similar, Sources
from meshlab_lowrank.stages.stage4a_complete import Complete
from meshlab_lowrank.stages.stage4b_diffuse import Diffused, Gather, Omega

_KNOWN_PART = 0.5  # of a patch that is completed while others like it remain
_GROUPS_AT_ONCE = 16  # the groups of a batch stay in the processor's cache


@dataclass(frozen=True)
class RoundDiffusion(Stage):
    """Recover the missing normals of all patches, from the rim of the hole inwards.

    Each round is steps 1 to 3 of section 3.4.2 for a batch of patches: select similar patches
    from Omega_M, complete the groups, write the recovered columns back. The paper leaves open
    what follows:

    * A batch is all patches with missing normals of which at least half is known; where none is
      left or the last batch brought nothing, all of which anything is known. All groups of a batch
      are taken from the same Omega_M, so their order doesn't matter.
    * A normal counts as recovered where some patch of the group has it; elsewhere the completion
      can only say zero, and the normal stays missing for a later round.
    * Recovered columns keep their length: shrinkage makes doubtful normals short, and short ones
      weigh little in averages.
    * An all-missing column stays zero in any group. It becomes known through its vertices: after
      each round the recovered normals are averaged at vertices, and whatever is still missing
      there in other patches takes that average.
    * The rounds end when nothing is missing, or when a batch of all patches of which anything is
      known brings nothing.

    Every pass takes the normals of the hole as missing again; what a pass leaves for the next is
    the shape on which patches and frames are laid. See `Diffuse`.
    """

    def __call__(
        self,
        hole: Hole,
        targets: Patches,
        sources: Sources,
        layer: PatchLayer,  # noqa: ARG002
        *,
        similar: Similar,
        complete: Complete,
        gather: Gather,
        first: bool,  # noqa: ARG002
        executor: Executor | None,
    ) -> Diffused | None:
        """Recover the normals of the targets; see `Diffuse`."""
        hole = forgotten(hole)
        values, mask = normals_in(targets, hole.normals, hole.measured)
        exists = (np.diff(targets.sampler.indptr) > 0).reshape(mask.shape)
        size = np.maximum(exists.sum(axis=1), 1)
        at_vertices, started_with = hole.normals, mask.sum()
        least = _KNOWN_PART
        while True:
            missing = exists & ~mask
            share = mask.sum(axis=1) / size
            rows = np.flatnonzero(missing.any(axis=1) & (share >= least) & (share > 0.0))
            recovered, fresh = values.copy(), np.zeros_like(mask)
            if len(rows):
                columns = Columns(values, mask.astype(np.float64))
                search = similar.search(columns, sources)
                found = _completed(columns, rows, search, complete, executor)
                fresh[rows] = missing[rows] & found.supported
                recovered[rows] = found.values
            if not fresh.any():
                if least == 0.0:
                    break
                least = 0.0
                continue
            values = np.where(fresh[..., None], recovered, values)
            average, _ = gather.normals(Omega(targets, values, fresh.astype(np.float64)))
            told = np.asarray(at_vertices.any(axis=1))
            at_vertices = np.where(told[:, None], at_vertices, average)
            shared, present = normals_in(targets, at_vertices, told | average.any(axis=1))
            mask = mask | fresh
            values = np.where((present & ~mask)[..., None], shared, values)
            mask = mask | present
            least = _KNOWN_PART
        if mask.sum() == started_with:
            return None
        return Diffused(hole, Omega(targets, values, mask.astype(np.float64)))


@dataclass(frozen=True)
class _Found:
    """Completed columns, and which of their normals some patch of the group knew."""

    values: FloatArray  # (t, sp, 3)
    supported: BoolArray  # (t, sp)


def _completed(
    columns: Columns, rows: IntArray, search: Search, complete: Complete, executor: Executor | None
) -> _Found:
    """Complete the columns of some rows (t,)."""

    def complete_some(batch: slice) -> _Found:
        some = rows[batch]
        groups = search(some)
        values = complete(columns.values[some], columns.weights[some], groups).values
        supported = np.asarray(values.any(axis=2))
        if groups.observed is not None:
            supported &= groups.observed.any(axis=1)
        return _Found(values, supported)

    parts = run_batches(complete_some, len(rows), _GROUPS_AT_ONCE, executor)
    return _Found(
        np.concatenate([part.values for part in parts]),
        np.concatenate([part.supported for part in parts]),
    )
