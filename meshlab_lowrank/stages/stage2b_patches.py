"""Stage 2, patches: samples of the surface around a centre, seen in the centre's own frame.

Variants: `GridPatches`, `RingPatches`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, normalized

KNOWN_SHARE = 0.6  # a sample is known when at least this much of its weight is
REACH = 0.8  # patch radii from the centre of a target to what is missing, at most


@dataclass(frozen=True)
class Patches:
    """All patches of a region, w of them with sp samples each.

    Attributes
    ----------
    centres : (w,) int64
        Vertex at the centre of each patch.
    frames : (w, 3, 3) float64
        Rotations R_i with rows e1, e2, e3: ``local = frames @ global`` (paper, 3.3.2).
    sampler : (w * sp, n) csr_array of float64
        Row ``i * sp + j`` holds the interpolation weights of sample j of patch i over the
        vertices of the region: non-negative, sum 1. Empty where the patch has no such sample.
    size : int
        Samples per patch, the paper's sp.
    """

    centres: IntArray
    frames: FloatArray
    sampler: sparse.csr_array
    size: int

    def __len__(self) -> int:
        """Give the number of patches, the paper's w."""
        return len(self.centres)

    def __getitem__(self, rows: IntArray) -> Patches:
        """Take some of the patches, in the order of their row numbers (t,)."""
        samples = (rows[:, None] * self.size + np.arange(self.size)).ravel()
        return Patches(self.centres[rows], self.frames[rows], self.sampler[samples], self.size)


class PatchLayer(Protocol):
    """Lays patches on the surface of one pass, all with the same samples."""

    @property
    def size(self) -> int:
        """Samples per patch, the paper's sp."""
        ...

    @property
    def distances(self) -> FloatArray:
        """Distance of each sample from the centre, (sp,) float64 in patch radii."""
        ...

    @property
    def turns(self) -> IntArray:
        """Turns by equal angles that map samples on samples, (q, sp) int64 of sample numbers."""
        ...

    def at(self, centres: IntArray, angle: float = 0.0) -> Patches:
        """Lay patches with centres (w,), turned about their normals by an angle in radians.

        Where there is but one turn, the angle has no meaning either.
        """
        ...


class LayPatches(Protocol):
    """Chooses where patches lie and what their samples are."""

    @property
    def rings(self) -> int:
        """Rings of vertices around the hole that have to be cut out with it."""
        ...

    def radius(self, hole: Hole) -> float:
        """Radius of a patch, in mean edge lengths."""
        ...

    def centres(self, hole: Hole) -> IntArray:
        """Choose the vertices whose patches are recovered, (w,) int64."""
        ...

    def layer(self, hole: Hole) -> PatchLayer:
        """Get ready to lay patches on the hole's surface as it is."""
        ...


def normals_in(
    patches: Patches, normals: FloatArray, known: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Vertex normals at the samples of all patches, each in the frame of its patch.

    Parameters
    ----------
    patches : Patches
        w patches of sp samples over n vertices.
    normals : (n, 3) float64
        Unit normals; rows that are not known are never read.
    known : (n,) bool

    Returns
    -------
    values : (w, sp, 3) float64
        Unit vectors, zero where missing, as the paper writes missing normals (3.3.2).
    mask : (w, sp) bool
        Samples of which at least 60 % of the weight lies on known vertices.
    """
    shape = (len(patches), patches.size)
    share = patches.sampler @ known.astype(np.float64)
    sums = patches.sampler @ np.where(known[:, None], normals, 0.0)
    mask = (share >= KNOWN_SHARE) & (sums != 0.0).any(axis=1)
    unit = normalized(np.where(mask[:, None], sums, 0.0)).reshape(*shape, 3)
    return unit @ patches.frames.transpose(0, 2, 1), mask.reshape(shape)


def centres_at_parts(hole: Hole, centres: IntArray, radius: float) -> IntArray:
    """Keep the centres (w,) near a part that is recovered on its own; all where there is none.

    Parameters
    ----------
    hole : Hole
    centres : (w,) int64
    radius : float
        Radius of a patch, in mean edge lengths.
    """
    if hole.parts is None:
        return centres
    away = cKDTree(hole.base[hole.parts >= 0]).query(hole.base[centres])[0]
    return centres[away < REACH * radius]
