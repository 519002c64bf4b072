"""Stage 4, diffusion: fronts of two rings from the rim inwards, then passes until patches agree."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.batches import run_batches
from meshlab_lowrank.hole import Hole, with_recovered
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, normalized
from meshlab_lowrank.mesh.topology import vertex_adjacency, vertex_rings
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2b_patches import KNOWN_SHARE, Patches, PatchLayer
from meshlab_lowrank.stages.stage3_similar import Columns, Search, Similar, Sources
from meshlab_lowrank.stages.stage4a_complete import Complete
from meshlab_lowrank.stages.stage4b_diffuse import Diffused, Gather, Omega

_BATCH = 256  # targets at once; fixed, so that results don't depend on the number of threads
_RESIDUAL_FLOOR = 0.02  # squared normal distance below which patches count alike


@dataclass(frozen=True)
class FrontDiffusion(Stage):
    """Fronts, then self-consistent passes; see `Diffuse`.

    Targets that are at least half known are completed, but only what lies within two rings of the
    known is accepted, and counts as known for the next front. Then every target that touches the
    hole is matched again on all its samples, completed and averaged.

    Parameters
    ----------
    rings : int
        Rings of vertices that a front advances. All at once is less exact.
    share : float
        Known part of a patch that may advance the front.
    passes : int
        Self-consistent passes after the fronts.
    refit_passes : int
        The same after the base was fitted again.
    falloff : float
        Width of the Gaussian weight of a patch's samples, in radii.
    """

    rings: int = 2
    share: float = 0.5
    passes: int = 3
    refit_passes: int = 2
    falloff: float = 0.5

    def __call__(
        self,
        hole: Hole,
        targets: Patches,
        sources: Sources,
        layer: PatchLayer,
        *,
        similar: Similar,
        complete: Complete,
        gather: Gather,
        first: bool,
        executor: Executor | None,
    ) -> Diffused | None:
        """Recover the normals of the targets; see `Diffuse`."""
        run = _Run(
            targets=targets,
            sources=sources,
            falloff=np.exp(-((layer.distances / self.falloff) ** 2)),
            similar=similar,
            complete=complete,
            executor=executor,
        )
        if first:
            hole = self._fronts(hole, run, gather)
        missing = (~hole.measured).astype(np.float64)
        touching = (targets.sampler @ missing).reshape(len(targets), -1)
        chosen = np.flatnonzero(touching.max(axis=1) > 0)
        if not (hole.weights[~hole.measured] > 0.0).any():
            return None
        omega = run.as_it_is(hole, chosen)
        listed = None
        for number in range(self.passes if first else self.refit_passes):
            if number:
                hole = _met(hole, omega, gather)
            omega, listed = run.estimates(hole, chosen, listed)
        return Diffused(hole, omega)

    def _fronts(self, hole: Hole, run: _Run, gather: Gather) -> Hole:
        """Recover missing normals inwards."""
        adjacency = vertex_adjacency(hole.faces, len(hole.positions))
        size = (len(run.targets), run.targets.size)
        while True:
            present = hole.weights > 0
            share = (run.targets.sampler @ present.astype(np.float64)).reshape(size).mean(axis=1)
            waiting = share < 1.0 - 1e-9
            least = min(self.share, 0.999 * share[waiting].max(initial=0.0))
            chosen = np.flatnonzero(waiting & (share >= least) & (share > 0))
            if len(chosen) == 0:
                return hole
            normals, votes = gather.normals(run.estimates(hole, chosen)[0])
            front = vertex_rings(adjacency, np.flatnonzero(present), self.rings) > 0
            accepted = front & (votes > 0)
            if not accepted.any():
                return hole
            hole = with_recovered(hole, normals, accepted)

    def for_trial(self) -> FrontDiffusion:
        """Fewer passes."""
        return replace(self, passes=2)

    def for_depth(self) -> FrontDiffusion:
        """Fewer passes, as another run follows."""
        return replace(self, passes=2)

    def for_copying(self) -> FrontDiffusion:
        """Count little but the centres of patches."""
        return replace(self, falloff=0.3)


@dataclass(frozen=True)
class _Run:
    """What stays the same for all fronts and passes."""

    targets: Patches
    sources: Sources
    falloff: FloatArray  # (sp,)
    similar: Similar
    complete: Complete
    executor: Executor | None

    def estimates(
        self, hole: Hole, rows: IntArray, listed: IntArray | None = None
    ) -> tuple[Omega, IntArray]:
        """Complete some targets; give the list that their similar patches were taken from."""
        columns = columns_of(hole, self.targets)
        search: Search = self.similar.search(columns, self.sources)

        def complete(batch: slice) -> tuple[FloatArray, FloatArray, IntArray]:
            some = rows[batch]
            groups = search(some, None if listed is None else listed[batch])
            found = self.complete(columns.values[some], columns.weights[some], groups)
            votes = self.falloff / (found.residual[:, None] + _RESIDUAL_FLOOR)
            return found.values, votes, groups.listed

        parts = run_batches(complete, len(rows), _BATCH, self.executor)
        values, votes, lists = (np.concatenate(part) for part in zip(*parts, strict=True))
        return Omega(self.targets[rows], values, votes), lists

    def as_it_is(self, hole: Hole, rows: IntArray) -> Omega:
        """Read the normals of some targets, each sample with the weight of its place."""
        targets = self.targets[rows]
        columns = columns_of(hole, targets)
        return Omega(targets, columns.values, self.falloff * (columns.weights > 0.0))


def columns_of(hole: Hole, targets: Patches) -> Columns:
    """Read the known and recovered normals of patches, weighted."""
    present = (hole.weights > 0).astype(np.float64)
    sampler, shape = targets.sampler, (len(targets), targets.size)
    weights = np.where(sampler @ present >= KNOWN_SHARE, sampler @ hole.weights, 0.0)
    sums = normalized(sampler @ (hole.normals * hole.weights[:, None]))
    sums *= weights[:, None] > 0
    values = sums.reshape(*shape, 3) @ targets.frames.transpose(0, 2, 1)
    return Columns(values, weights.reshape(shape))


def _met(hole: Hole, omega: Omega, gather: Gather) -> Hole:
    normals, votes = gather.normals(omega)
    return with_recovered(hole, normals, ~hole.measured & (votes > 0))
