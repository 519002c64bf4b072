"""Fake holes: parts of the known surface taken as missing, to choose settings and to judge them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import HoleState, start_state
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.topology import boundary_vertices
from meshlab_lowrank.stages.stage1_fairing import fair_surface

_DISCS = 5
_LEAST_RADIUS = 4.0
_LARGEST_RADIUS = 7.0  # deeper than this, the trust found at this depth is taken
_MARGIN = 4.0  # known surface between a disc and whatever else is missing
_DEPTHS = np.array([1.0, 3.0, 6.0])  # distances from the rim at which trust is measured
_DEPTH_WIDTH = 2.0
_NOISE = 0.05  # detail that is not higher than this is not told from chance
_SIGMA = 1.4826  # standard deviation of a normal distribution of median deviation 1
_LEAST_EXPLAINED = 0.25  # below it, detail did harm as often as good where nothing repeats
_ENOUGH = 0.85  # a strength from which detail is put on whole


@dataclass(frozen=True)
class FakeHoles:
    """A state in which discs of the known surface are missing too.

    Attributes
    ----------
    state : HoleState
        Its unknown vertices are those of the hole and of the discs; the discs lie on a smooth
        fill, each vertex straight below or above its true place.
    disc : (n,) int64
        Number of the disc of each vertex, -1 outside.
    truth : (n, 3) float64
        True positions.
    """

    state: HoleState
    disc: IntArray
    truth: FloatArray


@dataclass(frozen=True)
class Trust:
    """How far recovered detail can be believed.

    Attributes
    ----------
    strength : (3,) float64
        Factors from 0 to 1 for the recovered detail at growing depths.
    explained : float
        Part of the variance of the true detail that was recovered, from 0 to 1; median of the
        discs.
    error : float
        Squared error over the variance of the true detail, 1 for a smooth fill; median of the
        discs.
    """

    strength: FloatArray
    explained: float
    error: float

    @property
    def worthwhile(self) -> bool:
        """Whether detail is likelier to help than to harm.

        A quarter of the variance has to be recovered, and what comes next to the rim, where most
        is known, must not be wrong.
        """
        return bool(self.explained >= _LEAST_EXPLAINED and self.strength[0] > 0.0)

    def at(self, depth: FloatArray) -> FloatArray:
        """Factor at distances from the rim, (n,) float64 in mean edge lengths."""
        return np.interp(depth, _DEPTHS, self.strength)


def depth_of(state: HoleState) -> FloatArray:
    """Distance of each vertex from the nearest known one, (n,) float64."""
    known = state.positions[~state.unknown]
    return np.asarray(cKDTree(known).query(state.positions)[0], dtype=np.float64)


def make_fake_holes(state: HoleState, seed: int) -> FakeHoles | None:
    """Make up to five discs of the known surroundings unknown.

    Parameters
    ----------
    state : HoleState
    seed : int
        Choice of the places.

    Returns
    -------
    FakeHoles or None
        None where not even one disc has room.
    """
    points = state.positions
    room = np.asarray(cKDTree(points[state.unknown]).query(points)[0]) - _MARGIN
    border = boundary_vertices(state.faces, len(points))
    if border.any():
        room = np.minimum(room, cKDTree(points[border]).query(points)[0] - 2.0)
    room[~state.measured] = 0.0
    wanted = float(np.clip(depth_of(state).max(), _LEAST_RADIUS, _LARGEST_RADIUS))
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
    inside = (distance < radius) & state.measured
    filled = fair_surface(points, state.faces, inside)
    normals = vertex_normals(filled, state.faces)
    height = np.einsum("ij,ij->i", points - filled, normals)
    start = np.where(inside[:, None], points - height[:, None] * normals, points)
    fake = start_state(start, state.faces, state.unknown | inside)
    return FakeHoles(fake, np.where(inside, nearest, -1), points)


def judge(fake: FakeHoles, solved: HoleState) -> Trust:
    """Compare recovered with true detail in the fake holes.

    The strength at a depth is the regression of the true on the recovered detail, the median of
    the discs less its standard error by the median deviation, so that neither chance agreement
    nor one odd disc counts for much.

    Parameters
    ----------
    fake : FakeHoles
    solved : HoleState
        What the method made of ``fake.state``.

    Returns
    -------
    Trust
    """
    at = np.flatnonzero(fake.disc >= 0)
    normals, smooth = solved.base_normals[at], fake.state.positions[at]
    true = np.einsum("ij,ij->i", fake.truth[at] - smooth, normals)
    found = np.einsum("ij,ij->i", solved.positions[at] - smooth, normals)
    depth, disc = depth_of(fake.state)[at], fake.disc[at]
    near = np.exp(-(((depth[:, None] - _DEPTHS) / _DEPTH_WIDTH) ** 2))  # (p, 3)
    slopes = []
    for number in range(disc.max() + 1):
        weight = near[disc == number]
        f, t = found[disc == number], true[disc == number]
        slopes.append(weight.T @ (f * t) / (weight.T @ (f * f + _NOISE**2)))
    middle = np.median(slopes, axis=0)
    deviation = _SIGMA * np.median(np.abs(slopes - middle), axis=0)
    spread = deviation / np.sqrt(max(len(slopes) - 1, 1))
    strength = np.clip((middle - spread) / _ENOUGH, 0.0, 1.0)
    scaled = found * np.interp(depth, _DEPTHS, strength)
    variance = np.maximum(np.bincount(disc, weights=true**2), 1e-12)
    error = np.median(np.bincount(disc, weights=(true - found) ** 2) / variance)
    rest = np.median(np.bincount(disc, weights=(true - scaled) ** 2) / variance)
    return Trust(strength, max(0.0, 1.0 - float(rest)), float(error))
