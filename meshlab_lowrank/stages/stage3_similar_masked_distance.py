"""Stage 3, similar patches: distance of the normals known to both, searched by one product."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2b_patches import Patches, PatchLayer, normals_in
from meshlab_lowrank.stages.stage3_similar import (
    Columns,
    Float32Array,
    Groups,
    PatchLibrary,
    Sources,
)

_BLOCK = 16  # products of which the largest is found first
_SHORTLIST = 48  # patches that a target is compared with after the first of several passes
_CLEAR = 0.95  # patch radii from a patch's centre to the nearest missing normal
_DENSER = 1.5  # times the centres of library patches, on a finer surface
_NEAR = 4.0  # library patches are taken with a density that falls from the hole over this length


@dataclass(frozen=True)
class MaskedDistance(Stage):
    """Fully known patches of the surroundings, in many turns; see `Similar`.

    Parameters
    ----------
    k : int
        Similar patches per group.
    patches : int
        Most centres of library patches.
    angles : int
        Turns of each library patch are this many times those of the layer; 0: no turns.
    seed : int
        Choice of the centres.
    """

    k: int = 8
    patches: int = 2000
    angles: int = 4
    seed: int = 0

    def library(self, hole: Hole, layer: PatchLayer, radius: float) -> PatchLibrary:
        """Pack fully known patches, each in every turn, more of them near the hole.

        Parameters
        ----------
        hole : Hole
        layer : PatchLayer
        radius : float
            Of a patch, in mean edge lengths.
        """
        centres = self._centres(hole, radius)
        turns = layer.turns if self.angles else layer.turns[:1]
        angles = max(1, self.angles) if len(turns) > 1 else 1
        rows, places = [], []  # of every turn
        for index in range(angles):
            angle = index * 2.0 * np.pi / len(turns) / angles
            patches = layer.at(centres, angle)
            full = _fully_known(patches, hole)
            values, _ = normals_in(patches, hole.normals, hole.measured)
            rows.append(turned_patches(values[full], turns))
            places.append(np.tile(hole.base[centres[full]], (len(turns), 1)))
        return PatchLibrary(np.concatenate(rows), np.concatenate(places))

    def _centres(self, hole: Hole, radius: float) -> IntArray:
        """Choose places for library patches, clear of what is missing."""
        centres = np.flatnonzero(hole.measured)
        missing = hole.base[~hole.measured]
        away = cKDTree(missing).query(hole.base[centres])[0]
        centres = centres[away > _CLEAR * radius]
        if len(centres) <= self.patches:
            return centres
        far = np.asarray(cKDTree(hole.base[hole.unknown]).query(hole.base[centres])[0])
        rarity = np.random.default_rng(self.seed).exponential(size=len(centres))
        order = np.argsort((far - far.min() + _NEAR) ** 2 * rarity, kind="stable")
        return np.sort(centres[order[: self.patches]])

    def sources(
        self, hole: Hole, targets: Patches, library: PatchLibrary, radius: float
    ) -> Sources | None:
        """Bar each target near a part from the patches that touch the same part."""
        barred, free = None, len(library)
        if hole.parts is not None:
            inside = np.flatnonzero(hole.parts >= 0)
            _, nearest = cKDTree(hole.base[inside]).query(hole.base[targets.centres])
            touching = []
            for number in range(int(hole.parts.max()) + 1):
                gap = cKDTree(hole.base[hole.parts == number]).query(library.places)[0]
                touching.append(gap < _CLEAR * radius)
            barred = np.stack(touching)[hole.parts[inside[np.asarray(nearest)]]]
            free = int((~barred).sum(axis=1).min(initial=free))
        return None if free < _SHORTLIST else Sources(library, barred)

    def search(self, columns: Columns, sources: Sources) -> MaskedSearch:
        """Search the library; see `MaskedSearch`."""
        return MaskedSearch(columns, sources, self.k)

    def for_trial(self) -> MaskedDistance:
        """Fewer patches, in half of the turns."""
        return replace(self, patches=self.patches // 2, angles=(self.angles + 1) // 2)

    def for_finer(self) -> MaskedDistance:
        """Look at more places: what is sharper has to be met more exactly."""
        return replace(self, patches=round(_DENSER * self.patches))

    def for_copying(self) -> MaskedDistance:
        """Copy single patches."""
        return replace(self, k=1)


@dataclass(frozen=True)
class MaskedSearch:
    """Looks in the library for the patches nearest to targets; see `Search`."""

    columns: Columns
    sources: Sources
    k: int

    def __call__(self, rows: IntArray, listed: IntArray | None = None) -> Groups:
        """Compare with the whole library, or with what is listed for each target."""
        values, weights = self.columns.values[rows], self.columns.weights[rows]
        library = self.sources.library
        if listed is None:
            wanted = max(_SHORTLIST, self.k)
            barred = None if self.sources.barred is None else self.sources.barred[rows]
            listed = similar_patches(values, weights, library, wanted, barred=barred)
            nearest = listed[:, : self.k]
        else:
            nearest = similar_patches(values, weights, library, self.k, among=listed)
        return Groups(library.rows[nearest].astype(np.float64), None, listed)


def _fully_known(patches: Patches, hole: Hole) -> BoolArray:
    share = patches.sampler @ hole.measured.astype(np.float64)
    return np.asarray(share.reshape(len(patches), patches.size).min(axis=1) > 0.99)


def turned_patches(values: FloatArray, turns: IntArray) -> Float32Array:
    """Turn patches of local normals by equal angles.

    Parameters
    ----------
    values : (w, sp, 3) float64
    turns : (q, sp) int64
        See `PatchLayer`.

    Returns
    -------
    (q w, 3 sp) float32
    """
    turned = []
    for number, slots in enumerate(turns):
        angle = number * 2.0 * np.pi / len(turns)
        cosine, sine = np.cos(angle), np.sin(angle)
        back = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        patches = (values[:, slots] @ back).reshape(len(values), 3 * len(slots))
        turned.append(patches.astype(np.float32))  # each, as all of them take much memory
    return np.concatenate(turned)


def similar_patches(
    values: FloatArray,
    weights: FloatArray,
    library: PatchLibrary,
    k: int,
    *,
    among: IntArray | None = None,
    barred: BoolArray | None = None,
) -> IntArray:
    """Find the k patches of the library nearest to each target.

    The distance is ``sum m |n_a - n_b|^2 / sum m`` over the samples of weight m that the target
    knows; since all normals are unit vectors, the nearest has the largest product.

    Parameters
    ----------
    values : (t, sp, 3) float64
        Local unit normals of the targets, zero where missing.
    weights : (t, sp) float64
        Weight m of each sample, 0 where missing.
    library : PatchLibrary
    k : int
    among : (t, c) int64, optional
        Rows of the library that each target is compared with; by default all.
    barred : (t, w) bool, optional
        Rows that a target may not take, where it is compared with all.

    Returns
    -------
    (t, min(k, c)) int64
        Rows of the library, the most similar first.
    """
    columns = (values * weights[..., None]).reshape(len(values), -1).astype(np.float32)
    if among is None:
        product = columns @ library.rows.T
        if barred is not None:
            product[barred] = -np.inf
        nearest = largest(product, min(k, len(library)))
        product = np.take_along_axis(product, nearest, axis=1)
    else:
        product = (library.rows[among] @ columns[..., None])[..., 0]
        nearest = among
    order = np.argsort(-product, axis=1, kind="stable")[:, :k]
    return np.take_along_axis(nearest, order, axis=1)


def largest(values: Float32Array, k: int) -> IntArray:
    """Find the k largest of each row, in any order.

    They lie in the k blocks with the largest maxima, so that most values are only looked at once.
    The values of a block lie as far apart as there are blocks: so maxima are found many at a time.

    Parameters
    ----------
    values : (t, w) float32
    k : int
        At most w.

    Returns
    -------
    (t, k) int64
    """
    count, width = values.shape
    number = width // _BLOCK
    whole = number * _BLOCK
    peaks = values[:, :whole].reshape(count, _BLOCK, number).max(axis=1)
    if number <= k:
        return np.argpartition(values, width - k, axis=1)[:, width - k :]
    blocks = np.argpartition(peaks, -k, axis=1)[:, -k:]
    among = (blocks[:, :, None] + number * np.arange(_BLOCK)).reshape(count, -1)
    rest = np.broadcast_to(np.arange(whole, width), (count, width - whole))
    among = np.concatenate([among, rest], axis=1)
    chosen = np.argpartition(np.take_along_axis(values, among, axis=1), -k, axis=1)[:, -k:]
    return np.take_along_axis(among, chosen, axis=1)
