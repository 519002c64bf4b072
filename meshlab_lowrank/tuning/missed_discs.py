"""How far smooth fills of discs miss the known surface around holes, by sparse solves alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.energies import harmonic_energy
from meshlab_lowrank.mesh.fairing import membrane
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.topology import boundary_vertices, compacted, faces_around

_MARGIN = 2.0  # edge lengths of known surface between a disc and a border
_FEWEST = 4  # discs of one size, below which smaller ones are laid
_SIZES = (1.0, 0.7, 0.5, 0.35, 0.25)  # of the discs that are tried, over that of the hole
_SMALLER = 0.5  # size of further discs, from which the growth with the size is told
_LEAST_SIZE, LARGEST_SIZE = 1.0, 30.0  # edge lengths; larger discs would cost more than the fill
_BENT = 0.8  # length of the mean normal of a disc that turns too far to be filled as it lies
_TOGETHER = 20_000  # vertices that are filled in one go
_LEAST_DEPTH = 0.1  # edge lengths, of a disc that tells anything
_APART = 1.0  # radii between the centres of two discs; each is filled by itself
_AWAY = 1e4  # edge lengths between what has nothing to do with one another


@dataclass(frozen=True)
class Surroundings:
    """What is known around a hole, in mean edge lengths.

    Attributes
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        Known ones.
    rim : (k,) int64
        Vertices at the hole.
    size : float
        Largest depth of the hole.
    order : {2, 3}
        Of the energy that fills it.
    """

    vertices: FloatArray
    faces: IntArray
    rim: IntArray
    size: float
    order: int


@dataclass(frozen=True)
class MissedDisc:
    """How far a smooth fill misses a disc of the known surface.

    Attributes
    ----------
    depth : (s,) float64
        Distance of its vertices from the rim, in mean edge lengths.
    miss : (s,) float64
        Distance of the fill from the true surface there.
    """

    depth: FloatArray
    miss: FloatArray

    @property
    def size(self) -> float:
        """Largest depth."""
        return float(self.depth.max())


def missed_discs(around: Sequence[Surroundings], most: int) -> list[list[MissedDisc]]:
    """Lay discs beside holes, fill them as the holes are filled, and measure what that misses.

    The fill is one sparse solve for the triangles of the known surface itself, and of all discs of
    all holes in one go, which costs a small part of what closing and fairing them would.

    Parameters
    ----------
    around : sequence of Surroundings
    most : int
        Discs of one size at each hole.

    Returns
    -------
    list of list of MissedDisc
        For each hole: of its own size where there is room for a few, else smaller, and of half
        that size. Empty where there is no room.
    """
    found: list[list[MissedDisc]] = [[] for _ in around]
    for order in (2, 3):
        chosen = [i for i, each in enumerate(around) if each.order == order]
        if not chosen:
            continue
        counts = np.array([len(around[i].vertices) for i in chosen])
        start = np.cumsum(counts) - counts
        shift = np.zeros((len(chosen), 3))
        shift[:, 0] = _AWAY * np.arange(len(chosen))
        vertices = np.concatenate([around[i].vertices for i in chosen])
        vertices = vertices + np.repeat(shift, counts, axis=0)
        faces = np.concatenate([around[i].faces + s for i, s in zip(chosen, start, strict=True)])
        border = boundary_vertices(faces, len(vertices))
        room = np.full(len(vertices), np.inf)
        if border.any():
            room = np.asarray(cKDTree(vertices[border]).query(vertices)[0])
        unused = np.ones(len(vertices), dtype=np.bool_)
        unused[faces] = False
        room[unused] = 0.0
        centres, radii, owner = [], [], []
        for i, first, count in zip(chosen, start.tolist(), counts.tolist(), strict=True):
            own = slice(first, first + count)
            for radius, places in _places(around[i], room[own], most):
                centres.append(first + places)
                radii.append(np.full(len(places), radius))
                owner.append(np.full(len(places), i))
        if not centres:
            continue
        middles, sizes = np.concatenate(centres), np.concatenate(radii)
        discs: list[MissedDisc] = []
        for rows in _portions(sizes):
            discs += _solved(vertices, faces, middles[rows], sizes[rows], order)
        for i, disc in zip(np.concatenate(owner).tolist(), discs, strict=True):
            if disc.size > _LEAST_DEPTH and np.isfinite(disc.miss).all():
                found[i].append(disc)
    return found


def _solved(
    vertices: FloatArray, faces: IntArray, centres: IntArray, radii: FloatArray, order: int
) -> list[MissedDisc]:
    """Fill discs in one go, and those for which that fails in halves; empty ones where it fails."""
    try:
        return _filled(vertices, faces, centres, radii, order)
    except StageError:
        half = len(centres) // 2
        if half == 0:
            return [MissedDisc(np.zeros(1), np.zeros(1))]
        return [
            disc
            for rows in (slice(half), slice(half, None))
            for disc in _solved(vertices, faces, centres[rows], radii[rows], order)
        ]


def _portions(radii: FloatArray) -> list[IntArray]:
    """Put discs, in their order, together until they have about as many vertices as one solve may.

    A vertex has an area of less than one squared edge length.
    """
    vertices = np.cumsum(np.pi * (radii + 3.0) ** 2)
    return np.split(np.arange(len(radii)), np.flatnonzero(np.diff(vertices // _TOGETHER)) + 1)


def _places(around: Surroundings, room: FloatArray, most: int) -> list[tuple[float, IntArray]]:
    """Choose the radii and the centres of discs, those next to the rim first."""
    points = around.vertices
    away = np.asarray(cKDTree(points[around.rim]).query(points)[0])
    order = np.argsort(away, kind="stable")
    laid: list[tuple[float, IntArray]] = []
    for size in _SIZES:
        radius = min(max(size * around.size, _LEAST_SIZE), LARGEST_SIZE)
        if radius < _SIZES[-1] * around.size:
            break
        centres = _apart(points, order[room[order] >= radius + _MARGIN], radius, most)
        if len(centres):
            laid = [(radius, centres)]
        if len(centres) >= min(_FEWEST, most) or radius == _LEAST_SIZE:
            break
    if laid and laid[0][0] * _SMALLER > _LEAST_SIZE:
        radius = laid[0][0] * _SMALLER
        laid.append((radius, _apart(points, order[room[order] >= radius + _MARGIN], radius, most)))
    return laid


def _apart(points: FloatArray, candidates: IntArray, radius: float, most: int) -> IntArray:
    """Take candidates in their order, none near another."""
    centres: list[int] = []
    while len(candidates) and len(centres) < most:
        centres.append(int(candidates[0]))
        distance = np.linalg.norm(points[candidates] - points[centres[-1]], axis=1)
        candidates = candidates[distance > _APART * radius]
    return np.asarray(centres, dtype=np.int64)


def _filled(
    vertices: FloatArray, faces: IntArray, centres: IntArray, radii: FloatArray, order: int
) -> list[MissedDisc]:
    """Fill discs, each by itself, in one go."""
    near = cKDTree(vertices).query_ball_point(vertices[centres], radii, return_sorted=True)
    balls = [np.asarray(ball, dtype=np.int64) for ball in near]
    rows = faces_around(faces, len(vertices), balls, order)  # rings that the energy looks at
    parts = [compacted(faces[row], len(vertices)) for row in rows]
    sizes = np.array([len(used) for used, _ in parts])
    start = np.cumsum(sizes) - sizes
    used = np.concatenate([each for each, _ in parts])
    corners = np.concatenate([each + s for (_, each), s in zip(parts, start, strict=True)])
    disc = np.repeat(np.arange(len(parts)), sizes)
    truth = vertices[used] - vertices[centres][disc]
    free: BoolArray = np.linalg.norm(truth, axis=1) <= radii[disc]
    normals = vertex_normals(truth, corners)
    shape = membrane(truth, corners, free & _is_bent(normals, disc, free), passes=2)
    filled = minimise_with_fixed(harmonic_energy(shape, corners, order), ~free, truth)
    shift = np.zeros((len(used), 3))
    shift[:, 0] = _AWAY * disc
    moved = (filled + shift)[free]
    depth = np.asarray(cKDTree((truth + shift)[~free]).query(moved)[0])
    gap, nearest = cKDTree(truth + shift).query(moved)
    across = np.einsum("ij,ij->i", moved - (truth + shift)[nearest], normals[nearest])
    miss = np.minimum(np.abs(across), gap)
    ends = np.searchsorted(disc[free], np.arange(1, len(parts)))
    return [
        MissedDisc(d, m) for d, m in zip(np.split(depth, ends), np.split(miss, ends), strict=True)
    ]


def _is_bent(normals: FloatArray, disc: IntArray, free: BoolArray) -> BoolArray:
    """Mark the vertices (n,) of discs over which the surface turns far.

    The shape of their triangles tells how it does, which no hole knows. A hole is closed flat
    first, so such discs are too.
    """
    inner = disc[free]
    count = np.maximum(np.bincount(inner), 1)
    total = np.stack([np.bincount(inner, axis) for axis in normals[free].T], axis=1)
    return np.asarray((np.linalg.norm(total, axis=1) / count < _BENT)[disc])
