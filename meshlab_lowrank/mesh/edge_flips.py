"""Edge flips that widen angles and undo folds, and others that follow creases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    corner_angles,
    face_normals,
    face_vectors,
    normalized,
)
from meshlab_lowrank.mesh.topology import edges_of, half_edge_pairs
from meshlab_lowrank.mesh.unfolding import folded_pairs

_PASSES = 20
_LEAST_GAIN = 0.01  # radians
_FOLDED = -0.2  # cosine between the normals of two neighbouring faces
_TURNED = 0.2  # cosine between the normal of a new face and the mean of the two before it
_WITHIN = np.array(  # barycentric, where normals of a face are looked at
    [
        [1 / 3, 1 / 3, 1 / 3],
        *([4 / 6, 1 / 6, 1 / 6], [1 / 6, 4 / 6, 1 / 6], [1 / 6, 1 / 6, 4 / 6]),
        *([5 / 11, 5 / 11, 1 / 11], [5 / 11, 1 / 11, 5 / 11], [1 / 11, 5 / 11, 5 / 11]),
    ]
)

_Pair: TypeAlias = tuple[FloatArray, FloatArray]
_Neighbours: TypeAlias = tuple[_Pair, _Pair]


def flip_edges(vertices: FloatArray, faces: IntArray, flippable: BoolArray) -> IntArray:
    """Flip edges while that widens the least angle of their two faces or undoes a fold.

    A flip that undoes a fold (neighbouring faces whose normals are more than a right angle
    apart) always counts as better than one that widens an angle; no flip makes an edge that
    the mesh has already.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        Manifold and oriented.
    flippable : (m,) bool
        Only edges between two of these faces are flipped.

    Returns
    -------
    (m, 3) int64
        The faces; those that are not flippable are the same.
    """
    faces = faces.copy()
    for _ in range(_PASSES):
        quads = _quads_of(vertices, faces, flippable)
        gain = _score(vertices, quads.new, quads.across) - _score(vertices, quads.old, quads.beside)
        if not _flip_best(faces, quads, gain, _LEAST_GAIN):
            break
    return faces


def open_ears(
    vertices: FloatArray, faces: IntArray, held: BoolArray, flippable: BoolArray
) -> IntArray:
    """Flip the free edge of ears that lie folded on the tooth of a rim, then others as needed.

    No single flip undoes such a fold where the vertex beyond lies beside the tip of the tooth.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        Manifold and oriented.
    held : (n,) bool
        Vertices of the rim and beyond; an ear has no others.
    flippable : (m,) bool

    Returns
    -------
    (m, 3) int64
        The faces; those that are not flippable are the same.
    """
    folded = flippable & _folded(vertices, faces)
    ears = ears_of(vertices, faces, held, flippable)
    if len(ears) == 0:
        return faces
    opened = faces.copy()
    for ear in ears:
        for a, b, tip in (np.roll(opened[ear], -turn) for turn in range(3)):
            at_edge = flippable & (opened == a).any(axis=1) & (opened == b).any(axis=1)
            at_edge[ear] = False
            beyond = np.flatnonzero(at_edge)
            if len(beyond) != 1:
                continue
            far = opened[beyond[0]][~np.isin(opened[beyond[0]], [a, b])][0]
            if not ((opened == far).any(axis=1) & (opened == tip).any(axis=1)).any():
                opened[ear], opened[beyond[0]] = (a, far, tip), (far, b, tip)
                break
    opened = flip_edges(vertices, opened, flippable)
    fewer = np.count_nonzero(flippable & _folded(vertices, opened)) < np.count_nonzero(folded)
    return opened if fewer else faces


def ears_of(
    vertices: FloatArray, faces: IntArray, held: BoolArray, flippable: BoolArray
) -> IntArray:
    """Find the ears that are folded onto a neighbour, see `open_ears`."""
    folded = flippable & _folded(vertices, faces)
    return np.flatnonzero(folded & held[faces].all(axis=1))


def _folded(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Mark faces that are folded onto a neighbour."""
    folded = np.zeros(len(faces), dtype=np.bool_)
    folded[folded_pairs(vertices, faces)] = True
    return folded


def follow_normals(
    vertices: FloatArray,
    faces: IntArray,
    flippable: BoolArray,
    normals: FloatArray,
    *,
    least_gain: float,
    least_angle: float,
) -> IntArray:
    """Flip edges while that brings two faces nearer to the normals at their corners.

    The measure of a face is the integral over it of the squared difference between its normal and
    those of its corners, interpolated. It is least where edges run along creases, not across.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        Manifold and oriented.
    flippable : (m,) bool
        Only edges between two of these faces are flipped.
    normals : (n, 3) float64
        Unit normals at the vertices.
    least_gain : float
        Of the sum over two faces that is worth a flip, in squared lengths.
    least_angle : float
        Radians below which no flip takes an angle, unless it was smaller before. No flip makes a
        fold or an edge that the mesh has already either.

    Returns
    -------
    (m, 3) int64
        The faces; those that are not flippable are the same.
    """
    faces = faces.copy()
    for _ in range(_PASSES):
        quads = _quads_of(vertices, faces, flippable)
        cost = [
            sum(_deviation(vertices, side, normals) for side in pair)
            for pair in (quads.old, quads.new)
        ]
        before, after = (_least_angle(vertices, pair) for pair in (quads.old, quads.new))
        sound = after >= np.minimum(before, least_angle)
        sound &= ~_turned(vertices, quads)
        sound &= _folds(vertices, quads.new, *quads.across) <= _folds(
            vertices, quads.old, *quads.beside
        )
        gain = np.where(sound, cost[0] - cost[1], -np.inf)
        if not _flip_best(faces, quads, gain, least_gain):
            break
    return faces


@dataclass(frozen=True)
class _Quads:
    """Pairs of faces that may be flipped, e of them.

    Attributes
    ----------
    faces : (2, e) int64
        Numbers of the two faces.
    around : (4, e) int64
        Numbers of the faces around both, -1 where there is none.
    old, new : (2, e, 3) int64
        The two faces, and those that a flip makes of them.
    flipped : (e,) int64
        Key of the edge that a flip makes.
    is_new : (e,) bool
        Whether the mesh has no such edge.
    beside, across : pair of pairs of (e, 3) float64
        Normals of the neighbours of each old, and each new face.
    """

    faces: IntArray
    around: IntArray
    old: IntArray
    new: IntArray
    flipped: IntArray
    is_new: BoolArray
    beside: _Neighbours
    across: _Neighbours


def _quads_of(vertices: FloatArray, faces: IntArray, flippable: BoolArray) -> _Quads:
    n = len(vertices)
    edges = edges_of(faces)
    keys = edges.vertices @ np.array([n, 1])
    here, there = half_edge_pairs(edges)
    partner = np.full(3 * len(faces), -1, dtype=np.int64)
    partner[here], partner[there] = there, here
    inner = flippable[here // 3] & flippable[there // 3]
    f, i = np.divmod(here[inner], 3)
    g, j = np.divmod(there[inner], 3)
    a, b, c, d = faces[f, i], faces[g, j], faces[f, i - 1], faces[g, j - 1]
    flipped = np.minimum(c, d) * n + np.maximum(c, d)

    sides = [3 * f + (i + 1) % 3, 3 * f + (i + 2) % 3, 3 * g + (j + 1) % 3, 3 * g + (j + 2) % 3]
    around = np.stack([np.where(partner[h] < 0, -1, partner[h] // 3) for h in sides])
    bc, ca, ad, db = np.append(face_normals(vertices, faces), np.zeros((1, 3)), axis=0)[around]
    return _Quads(
        faces=np.stack([f, g]),
        around=around,
        old=np.stack([np.stack([a, b, c], axis=1), np.stack([b, a, d], axis=1)]),
        new=np.stack([np.stack([d, b, c], axis=1), np.stack([a, d, c], axis=1)]),
        flipped=flipped,
        is_new=~np.isin(flipped, keys),
        beside=((bc, ca), (ad, db)),
        across=((bc, db), (ca, ad)),
    )


def _flip_best(faces: IntArray, quads: _Quads, gain: FloatArray, least_gain: float) -> bool:
    """Flip the best edges that are not near one another; tell whether there were any."""
    better = np.flatnonzero((gain > least_gain) & quads.is_new)
    better = better[np.argsort(-gain[better], kind="stable")]

    touched = np.concatenate([quads.faces, quads.around])[:, better]
    rank = np.broadcast_to(np.arange(len(better)), touched.shape)
    best = np.full(len(faces) + 1, len(better))  # the last entry stands for no neighbour
    np.minimum.at(best, touched, rank)
    best[-1] = len(better)
    chosen = better[np.all((best[touched] == rank) | (touched < 0), axis=0)]
    chosen = chosen[np.unique(quads.flipped[chosen], return_index=True)[1]]
    faces[quads.faces[:, chosen]] = quads.new[:, chosen]
    return len(chosen) > 0


def _score(vertices: FloatArray, pairs: IntArray, neighbours: _Neighbours) -> FloatArray:
    """Least angle of two faces, less pi for each fold between them and with their neighbours."""
    return _least_angle(vertices, pairs) - np.pi * _folds(vertices, pairs, *neighbours)


def _least_angle(vertices: FloatArray, pairs: IntArray) -> FloatArray:
    """Least angle of two faces; pairs is (2, e, 3)."""
    return np.asarray(np.min([corner_angles(vertices, side).min(axis=1) for side in pairs], axis=0))


def _folds(vertices: FloatArray, pairs: IntArray, first: _Pair, second: _Pair) -> IntArray:
    """Count the folds between two faces and with their neighbours.

    pairs is (2, e, 3); first and second hold the normals (e, 3) of each face's two neighbours.
    """
    one, two = (face_normals(vertices, side) for side in pairs)
    cosines = [np.sum(one * two, axis=1)]
    cosines += [np.sum(one * normal, axis=1) for normal in first]
    cosines += [np.sum(two * normal, axis=1) for normal in second]
    return np.asarray(np.count_nonzero(np.array(cosines) < _FOLDED, axis=0))


def _turned(vertices: FloatArray, quads: _Quads) -> BoolArray:
    """Mark pairs of which a flip would turn a face away from what both look at now, (e,)."""
    one, two = (face_normals(vertices, side) for side in quads.old)
    ahead = normalized(one + two)
    cosines = [np.sum(face_normals(vertices, side) * ahead, axis=1) for side in quads.new]
    return np.asarray(np.min(cosines, axis=0) < _TURNED)


def _deviation(vertices: FloatArray, faces: IntArray, normals: FloatArray) -> FloatArray:
    """Integral of the squared difference between normals of faces and of their corners, (e,)."""
    vectors = face_vectors(vertices, faces)
    within = normalized(_WITHIN @ normals[faces])  # (e, s, 3)
    squared = np.sum((normalized(vectors)[:, None] - within) ** 2, axis=2)
    return np.asarray(np.linalg.norm(vectors, axis=1) * squared.mean(axis=1))
