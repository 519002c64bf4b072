"""Fake holes: parts of the known surface taken as missing, to choose settings and to judge them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole, depth_of, with_missing
from meshlab_lowrank.mesh.fairing import fair_surface
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.topology import boundary_vertices
from meshlab_lowrank.tuning.trust import DEPTHS, Trust

_DISCS = 5
_LEAST_RADIUS = 4.0
_LARGEST_RADIUS = 7.0  # deeper than this, the trust found at this depth is taken
_MARGIN = 4.0  # known surface between a disc and whatever else is missing
_DEPTH_WIDTH = 2.0
_NOISE = 0.05  # detail that is not higher than this is not told from chance
_SIGMA = 1.4826  # standard deviation of a normal distribution of median deviation 1
_ENOUGH = 0.85  # a strength from which detail is put on whole


@dataclass(frozen=True)
class FakeHoles:
    """A hole around which discs of the known surface are missing too.

    Attributes
    ----------
    hole : Hole
        Its unknown vertices are those of the hole and of the discs, its parts the discs; these
        lie on a smooth fill, each vertex straight below or above its true place.
    parts : (n,) int64
        Number of the disc of each vertex, -1 outside.
    truth : (n, 3) float64
        True positions.
    """

    hole: Hole
    parts: IntArray
    truth: FloatArray


def make_fake_holes(hole: Hole, seed: int) -> FakeHoles | None:
    """Make up to five discs of the known surroundings unknown.

    Parameters
    ----------
    hole : Hole
    seed : int
        Choice of the places.

    Returns
    -------
    FakeHoles or None
        None where not even one disc has room.
    """
    points = hole.positions
    room = np.asarray(cKDTree(points[hole.unknown]).query(points)[0]) - _MARGIN
    border = boundary_vertices(hole.faces, len(points))
    if border.any():
        room = np.minimum(room, cKDTree(points[border]).query(points)[0] - 2.0)
    room[~hole.measured] = 0.0
    wanted = float(np.clip(depth_of(hole).max(), _LEAST_RADIUS, _LARGEST_RADIUS))
    radius = min(wanted, 0.9 * float(room.max()))
    if radius < _LEAST_RADIUS:
        return None
    least = max(radius, 0.6 * float(room.max()))  # near a border there is too little to go by
    order = np.random.default_rng(seed).permutation(len(points))
    candidates = order[room[order] >= least]
    centres: list[int] = []
    while len(candidates) and len(centres) < _DISCS:
        centres.append(int(candidates[0]))
        away = np.linalg.norm(points[candidates] - points[centres[-1]], axis=1)
        candidates = candidates[away > 2.0 * radius + _MARGIN]
    distance, nearest = cKDTree(points[centres]).query(points)
    inside = (distance < radius) & hole.measured
    filled = fair_surface(points, hole.faces, inside)
    normals = vertex_normals(filled, hole.faces)
    height = np.einsum("ij,ij->i", points - filled, normals)
    start = np.where(inside[:, None], points - height[:, None] * normals, points)
    parts = np.where(inside, nearest, -1)
    return FakeHoles(with_missing(hole, start, parts), parts, points)


def judge(fake: FakeHoles, solved: Hole) -> Trust:
    """Compare recovered with true detail in the fake holes.

    The strength at a depth is the regression of the true on the recovered detail, the median of
    the discs less its standard error by the median deviation, so that neither chance agreement
    nor one odd disc counts for much.

    Parameters
    ----------
    fake : FakeHoles
    solved : Hole
        What the method made of ``fake.hole``.

    Returns
    -------
    Trust
    """
    at = np.flatnonzero(fake.parts >= 0)
    normals, smooth = solved.base_normals[at], fake.hole.positions[at]
    true = np.einsum("ij,ij->i", fake.truth[at] - smooth, normals)
    found = np.einsum("ij,ij->i", solved.positions[at] - smooth, normals)
    depth, disc = depth_of(fake.hole)[at], fake.parts[at]
    near = np.exp(-(((depth[:, None] - DEPTHS) / _DEPTH_WIDTH) ** 2))  # (p, 3)
    slopes = []
    for number in range(disc.max() + 1):
        weight = near[disc == number]
        f, t = found[disc == number], true[disc == number]
        slopes.append(weight.T @ (f * t) / (weight.T @ (f * f + _NOISE**2)))
    middle = np.median(slopes, axis=0)
    deviation = _SIGMA * np.median(np.abs(slopes - middle), axis=0)
    spread = deviation / np.sqrt(max(len(slopes) - 1, 1))
    strength = np.clip((middle - spread) / _ENOUGH, 0.0, 1.0)
    scaled = found * np.interp(depth, DEPTHS, strength)
    variance = np.maximum(np.bincount(disc, weights=true**2), 1e-12)
    error = np.median(np.bincount(disc, weights=(true - found) ** 2) / variance)
    rest = np.median(np.bincount(disc, weights=(true - scaled) ** 2) / variance)
    return Trust(strength, max(0.0, 1.0 - float(rest)), float(error))
