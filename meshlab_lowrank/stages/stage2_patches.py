"""Patches: samples of the surface around a centre, seen in the centre's own frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, normalized

KNOWN_SHARE = 0.6  # a sample is known when at least this much of its weight is


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


def tangent_frames(normals: FloatArray, angle: float = 0.0) -> FloatArray:
    """Build frames with rows e1, e2, e3 whose third axis is the given normal.

    Parameters
    ----------
    normals : (w, 3) float64
    angle : float
        Turns the tangents, which are arbitrary otherwise, about the normal; in radians.

    Returns
    -------
    (w, 3, 3) float64
    """
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = normalized(np.cross(helper, normals))
    second = np.cross(normals, first)
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack(
        [cosine * first + sine * second, cosine * second - sine * first, normals], axis=1
    )
