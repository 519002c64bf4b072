"""Edge flips that widen angles and undo folds."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    corner_angles,
    face_normals,
)
from meshlab_lowrank.mesh.topology import edges_of, half_edge_pairs

_PASSES = 20
_LEAST_GAIN = 0.01  # radians
_FOLDED = -0.2  # cosine between the normals of two neighbouring faces


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
        if not _flip_once(vertices, faces, flippable):
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
    pairs = half_edge_pairs(edges_of(faces)) // 3
    normals = face_normals(vertices, faces)
    cosine = np.einsum("ij,ij->i", normals[pairs[0]], normals[pairs[1]])
    folded = np.zeros(len(faces), dtype=np.bool_)
    folded[pairs[:, cosine < _FOLDED]] = True
    return folded


def _flip_once(vertices: FloatArray, faces: IntArray, flippable: BoolArray) -> bool:
    """Flip the best edges that are not near one another; tell whether there were any."""
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
    old = np.stack([np.stack([a, b, c], axis=1), np.stack([b, a, d], axis=1)])
    new = np.stack([np.stack([d, b, c], axis=1), np.stack([a, d, c], axis=1)])
    gain = _score(vertices, new, (bc, db), (ca, ad)) - _score(vertices, old, (bc, ca), (ad, db))
    better = np.flatnonzero((gain > _LEAST_GAIN) & ~np.isin(flipped, keys))
    better = better[np.argsort(-gain[better], kind="stable")]

    touched = np.concatenate([f[None], g[None], around])[:, better]
    rank = np.broadcast_to(np.arange(len(better)), touched.shape)
    best = np.full(len(faces) + 1, len(better))  # the last entry stands for no neighbour
    np.minimum.at(best, touched, rank)
    best[-1] = len(better)
    chosen = better[np.all((best[touched] == rank) | (touched < 0), axis=0)]
    chosen = chosen[np.unique(flipped[chosen], return_index=True)[1]]
    faces[f[chosen]], faces[g[chosen]] = new[0, chosen], new[1, chosen]
    return len(chosen) > 0


def _score(
    vertices: FloatArray,
    pairs: IntArray,
    first: tuple[FloatArray, FloatArray],
    second: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Least angle of two faces, less pi for each fold between them and with their neighbours.

    pairs is (2, e, 3); first and second hold the normals (e, 3) of each face's two neighbours.
    """
    angle = np.min([corner_angles(vertices, side).min(axis=1) for side in pairs], axis=0)
    one, two = (face_normals(vertices, side) for side in pairs)
    cosines = [np.sum(one * two, axis=1)]
    cosines += [np.sum(one * normal, axis=1) for normal in first]
    cosines += [np.sum(two * normal, axis=1) for normal in second]
    return np.asarray(angle - np.pi * np.count_nonzero(np.array(cosines) < _FOLDED, axis=0))
