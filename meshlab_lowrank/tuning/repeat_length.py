"""The length after which surface detail repeats, from the autocorrelation of its normals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray, vertex_normals
from meshlab_lowrank.stages.stage1e_base_low_pass import smooth_base
from meshlab_lowrank.stages.stage2a_frames_base import BaseFrames
from meshlab_lowrank.stages.stage2b_patches_grid import GridLayer, HexagonalGrid

_CUTOFF = 18.0  # detail of wavelengths up to about 16 edge lengths is kept apart from the body
_HALF = 24  # half width of the windows, in edge lengths
_WINDOWS = 40
SHORTEST, _LONGEST = 5.0, 22.0


def repeat_lengths(hole: Hole, seed: int) -> tuple[float, ...]:
    """Estimate the repeat length of the detail around a hole.

    Windows of the surroundings are sampled on a square grid; the autocorrelation of the part of
    the normals that is tangential to a smooth base is averaged over windows and directions. Its
    first minimum lies at half the repeat length, its next maximum at one; the two differ where
    the cells of the pattern are longer than wide.

    Parameters
    ----------
    hole : Hole
    seed : int
        Choice of the windows.

    Returns
    -------
    tuple of float
        One or two candidates, in mean edge lengths, between 5 and 22.
    """
    return lengths_from(_autocorrelation(hole, seed))


def lengths_from(profile: FloatArray) -> tuple[float, ...]:
    """Read the repeat lengths from a correlation.

    Parameters
    ----------
    profile : (n,) float64
        Correlation at the distances 0, 1, 2, ... mean edge lengths.

    Returns
    -------
    tuple of float
        See `repeat_lengths`.
    """
    first = 2 + int(np.argmax(np.diff(profile[2:]) > 0))  # end of the first descent
    candidates = [2.0 * first]
    peaks = 1 + np.flatnonzero((profile[1:-1] > profile[:-2]) & (profile[1:-1] >= profile[2:]))
    later = peaks[peaks > first]
    if len(later):
        candidates.append(float(later[0]))
    lengths = np.clip(candidates, SHORTEST, _LONGEST)
    if len(lengths) == 2 and abs(lengths[1] / lengths[0] - 1.0) < 0.2:
        lengths = lengths.mean(keepdims=True)
    return tuple(float(length) for length in lengths)


def _autocorrelation(hole: Hole, seed: int) -> FloatArray:
    """Correlation of detail normals at distances 0, 1, 2, ... edge lengths."""
    base = smooth_base(hole.positions, hole.faces, hole.measured, cutoff=_CUTOFF)
    normals = vertex_normals(base, hole.faces)
    upright = np.einsum("ij,ij->i", hole.normals, normals)[:, None] * normals
    detail = np.where(hole.measured[:, None], hole.normals - upright, 0.0)
    axis = np.arange(-_HALF, _HALF + 1.0)
    width = len(axis)
    window = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    grid = HexagonalGrid(window, np.zeros((6, 0), dtype=np.int64))
    centres = np.flatnonzero(hole.measured)
    centres = np.sort(np.random.default_rng(seed).permutation(centres)[:_WINDOWS])
    layer = GridLayer(replace(hole, base=base, base_normals=normals), grid, _HALF, BaseFrames())
    patches = layer.at(centres)
    shape = (len(centres), width, width)
    mask = (patches.sampler @ hole.measured.astype(np.float64)).reshape(shape) > 0.9
    sampled = (patches.sampler @ detail).reshape(len(centres), width**2, 3)
    values = (sampled @ patches.frames[:, :2].transpose(0, 2, 1)).reshape(*shape, 2)
    values *= mask[..., None]
    double = (2 * width, 2 * width)
    power = np.abs(np.fft.rfft2(values, s=double, axes=(1, 2))) ** 2
    counts = np.abs(np.fft.rfft2(mask.astype(np.float64), s=double, axes=(1, 2))) ** 2
    products = np.fft.irfft2(power.sum(axis=(0, 3)), s=double)
    pairs = np.fft.irfft2(counts.sum(axis=0), s=double)
    shift = np.fft.fftfreq(2 * width, 1.0 / (2 * width))
    distance = np.rint(np.hypot(shift[:, None], shift[None])).astype(np.int64)
    near = (distance <= _HALF) & (pairs > 0.5)
    total = np.bincount(distance[near], weights=products[near], minlength=_HALF + 1)
    count = np.bincount(distance[near], weights=pairs[near], minlength=_HALF + 1)
    return np.asarray(total / np.maximum(count, 1.0))
