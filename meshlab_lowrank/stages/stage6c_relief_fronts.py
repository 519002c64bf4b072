"""Stage 6, relief: whole patches copied from the rim inwards, each by what is there before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.stages.stage3_similar import Float32Array
from meshlab_lowrank.stages.stage6c_relief_patches import PatchMaker, SourcePatches, TargetPatches

_COPIED = 0.5  # weight of a copied height against a measured one
_PRESENT = 0.6  # share of a sample's weight from which on it is known
_SHARE = 0.5  # part of a patch that is known before it is put, where there is one
_APART = 1.0  # patch radii between patches that are put at the same time
_BATCH = 64  # targets compared at once, for the memory
_TINY = 1e-9


@dataclass(frozen=True)
class Copy:
    """What one patch was given.

    Attributes
    ----------
    centre : int
        Vertex at the centre of the patch.
    vertices : (v,) int64
    heights : (v,) float64
        Of the source there; another constant may be added to all.
    """

    centre: int
    vertices: IntArray
    heights: FloatArray


def copy_inwards(
    maker: PatchMaker,
    targets: TargetPatches,
    sources: SourcePatches,
    strength: FloatArray,
    *,
    shortlist: int,
) -> list[Copy]:
    """Put a source patch on every target, in fronts from the rim.

    Of the sources that fit best to what is there, up to a constant, the one is taken whose detail
    is about as strong as expected: the best fit alone is too smooth, as what differs is punished
    and what is missing is not.

    Parameters
    ----------
    maker : PatchMaker
    targets : TargetPatches
    sources : SourcePatches
    strength : (n,) float64
        Mean size of the detail that is expected around each vertex.
    shortlist : int
        Sources among which the strength decides.

    Returns
    -------
    list of Copy
    """
    known = ~maker.field.hole.unknown
    heights = np.where(known, maker.field.heights, 0.0)
    weight = known.astype(np.float64)
    waiting = np.ones(len(targets), dtype=np.bool_)
    search = _Search.among(sources, strength[targets.centres], shortlist)
    copies: list[Copy] = []
    while True:
        present = (targets.sampler @ (weight > 0.0).astype(np.float64)).reshape(len(targets), -1)
        share = present.mean(axis=1)
        waiting &= share < 1.0 - _TINY
        if not share[waiting].any():
            return copies
        least = min(_SHARE, 0.999 * float(share[waiting].max()))
        ready = np.flatnonzero(waiting & (share >= least))
        chosen = _apart(maker, targets, ready[np.argsort(-share[ready], kind="stable")])
        known_weight = (targets.sampler @ weight).reshape(len(targets), -1)
        sums = (targets.sampler @ heights).reshape(len(targets), -1)
        values = sums / np.maximum(present, _TINY)
        weights = np.where(present > _PRESENT, known_weight, 0.0)
        for target, source in zip(chosen, search(chosen, values, weights), strict=True):
            vertices, copied = maker.copied(targets, int(target), sources, int(source))
            old = weight[vertices] > 0.0
            offset = float((heights[vertices] - copied)[old].mean()) if old.any() else 0.0
            heights[vertices[~old]] = copied[~old] + offset
            weight[vertices[~old]] = _COPIED
            copies.append(Copy(int(targets.centres[target]), vertices, copied))
        waiting[chosen] = False


def _apart(maker: PatchMaker, targets: TargetPatches, rows: IntArray) -> IntArray:
    """Keep those of the targets, the first first, that don't lie near an earlier one."""
    places = maker.field.base[targets.centres]
    kept: list[int] = []
    for row in rows.tolist():
        gaps = np.linalg.norm(places[kept] - places[row], axis=1)
        if gaps.min(initial=np.inf) > _APART * maker.radius:
            kept.append(row)
    return np.asarray(kept, dtype=np.int64)


@dataclass(frozen=True)
class _Search:
    """Finds sources by their weighted squared distance, whatever constant lies between."""

    values: Float32Array  # (w, s)
    squares: Float32Array
    strength: FloatArray  # (w,)
    wanted: FloatArray  # (t,)
    shortlist: int

    @classmethod
    def among(cls, sources: SourcePatches, wanted: FloatArray, shortlist: int) -> _Search:
        values = sources.values
        return cls(values, values * values, sources.strength, wanted, min(shortlist, len(values)))

    def __call__(self, rows: IntArray, values: FloatArray, weights: FloatArray) -> IntArray:
        """Give the source of each target row; values and weights (t, s) are those of all."""
        found = [
            self._nearest(some, values[some], weights[some])
            for some in np.split(rows, np.arange(_BATCH, len(rows), _BATCH))
        ]
        return np.concatenate(found)

    def _nearest(self, rows: IntArray, values: FloatArray, weights: FloatArray) -> IntArray:
        total = np.maximum(weights.sum(axis=1, keepdims=True), _TINY)
        centred = values - (weights * values).sum(axis=1, keepdims=True) / total
        light = weights.astype(np.float32)
        product = (weights * centred).astype(np.float32) @ self.values.T
        distance = light @ self.squares.T - 2.0 * product
        distance -= (light @ self.values.T) ** 2 / total.astype(np.float32)
        listed = np.argpartition(distance, self.shortlist - 1, axis=1)[:, : self.shortlist]
        listed.sort(axis=1)
        lack = np.abs(self.strength[listed] - self.wanted[rows, None])
        best = lack.argmin(axis=1)
        return np.asarray(np.take_along_axis(listed, best[:, None], axis=1)[:, 0])
