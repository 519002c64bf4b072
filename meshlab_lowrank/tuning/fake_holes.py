"""Fake holes: parts of the known surface taken as missing, to choose settings and to judge them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole, depth_of, with_missing
from meshlab_lowrank.mesh.fairing import fair_surface
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.topology import boundary_vertices, vertex_adjacency, vertex_rings
from meshlab_lowrank.tuning.likeness import unlikeness

_DISCS = 5
_LEAST_RADIUS = 4.0
_LARGEST_RADIUS = 7.0  # deeper than this, the fill itself has to tell
_MARGIN = 4.0  # known surface between a disc and whatever else is missing
_RIM = 4  # rings around the hole that are missing with it
_AROUND = 4.0  # edge lengths around a disc that are like the surroundings of the hole, or not
_LOOKED_AT = 400  # places for discs
_NEARER = 0.01  # unlikeness that an edge length of distance from the hole counts as
_TO_BORDER = 2.0
_FEWEST = 20  # vertices of the rim that tell anything


@dataclass(frozen=True)
class FakeHoles:
    """A hole around which parts of the known surface are missing too.

    Attributes
    ----------
    hole : Hole
        Its unknown vertices are those of the hole and of the parts. The parts lie on a smooth
        fill, each vertex straight below or above its true place.
    parts : (n,) int64
        Number of the disc of each vertex, after them that of the rim; -1 elsewhere.
    truth : (n, 3) float64
        True positions.
    """

    hole: Hole
    parts: IntArray
    truth: FloatArray


def make_fake_holes(
    hole: Hole, seed: int, *, alike: bool = True, rim: bool = True
) -> FakeHoles | None:
    """Make the rim of the hole, and up to five discs of its surroundings, unknown.

    Nothing is more like the hole than its own rim: four rings of known vertices are missed with
    the hole, and recovered from what lies beyond them. The discs are where the relief around them
    is most like that around the hole.

    Parameters
    ----------
    hole : Hole
    seed : int
        Choice of the places that are looked at.
    alike : bool
        Otherwise the discs are anywhere.
    rim : bool
        Whether the rim is missed.

    Returns
    -------
    FakeHoles or None
        None where there is no room.
    """
    points = hole.positions
    border = boundary_vertices(hole.faces, len(points))
    to_border = np.full(len(points), np.inf)
    if border.any():
        to_border = np.asarray(cKDTree(points[border]).query(points)[0]) - _TO_BORDER
    rings = vertex_rings(
        vertex_adjacency(hole.faces, len(points)), np.flatnonzero(hole.unknown), 2 * _RIM
    )
    missed = rim & (rings >= 1) & (rings <= _RIM) & (to_border > 0.0)
    if missed.sum() < _FEWEST:
        missed = np.zeros(len(points), dtype=np.bool_)
    taken = hole.unknown | missed
    room = np.minimum(cKDTree(points[taken]).query(points)[0] - _MARGIN, to_border)
    room[~hole.measured] = 0.0
    around = (rings >= 1) & hole.measured
    centres, radius = _places(hole, room, around, seed, alike=alike)
    if len(centres) == 0 and not missed.any():
        return None
    parts = np.full(len(points), -1)
    if len(centres):
        distance, nearest = cKDTree(points[centres]).query(points)
        parts = np.where((distance < radius) & hole.measured, nearest, -1)
    parts[missed] = len(centres)
    return _with_parts(hole, parts, hole.unknown if missed.any() else None)


def _places(
    hole: Hole, room: FloatArray, around: BoolArray, seed: int, *, alike: bool
) -> tuple[IntArray, float]:
    """Choose the centres of discs, and their radius, where there is room for any."""
    wanted = float(np.clip(depth_of(hole).max(), _LEAST_RADIUS, _LARGEST_RADIUS))
    radius = min(wanted, 0.9 * float(room.max()))
    nowhere = np.zeros(0, dtype=np.int64)
    if radius < _LEAST_RADIUS:
        return nowhere, radius
    points = hole.positions
    order = np.random.default_rng(seed).permutation(len(points))
    candidates = order[room[order] >= radius][:_LOOKED_AT]
    if alike:
        away = cKDTree(points[hole.unknown]).query(points[candidates])[0]
        unlike = unlikeness(hole, candidates, radius + _AROUND, around)
        candidates = candidates[np.argsort(unlike + _NEARER * away, kind="stable")]
    centres: list[int] = []
    while len(candidates) and len(centres) < _DISCS:
        centres.append(int(candidates[0]))
        apart = np.linalg.norm(points[candidates] - points[centres[-1]], axis=1)
        candidates = candidates[apart > 2.0 * radius + _MARGIN]
    return np.asarray(centres, dtype=np.int64), radius


def _with_parts(hole: Hole, parts: IntArray, refilled: BoolArray | None) -> FakeHoles:
    """Lay parts on a smooth fill; what else is missing too, where it is given."""
    points, inside = hole.positions, parts >= 0
    moved = inside if refilled is None else inside | refilled
    filled = fair_surface(points, hole.faces, moved)
    normals = vertex_normals(filled, hole.faces)
    height = np.einsum("ij,ij->i", points - filled, normals)
    start = np.where(moved[:, None], filled, points)
    start[inside] = (points - height[:, None] * normals)[inside]
    return FakeHoles(with_missing(hole, start, parts), parts, points)
