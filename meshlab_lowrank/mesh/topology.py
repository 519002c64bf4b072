"""Connectivity of triangle meshes: edges, adjacency, rings, components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from meshlab_lowrank.mesh.geometry import BoolArray, IntArray

_BLOCK = 500_000


@dataclass(frozen=True)
class Edges:
    """Undirected edges of a mesh.

    Attributes
    ----------
    vertices : (e, 2) int64
        End points, the smaller index first, rows sorted.
    face_edges : (m, 3) int64
        Edge i of a face runs from its corner i to its corner i + 1.
    face_count : (e,) int64
        Number of faces at the edge: 1 on a boundary, 2 inside, more where not manifold.
    """

    vertices: IntArray
    face_edges: IntArray
    face_count: IntArray


def edges_of(faces: IntArray) -> Edges:
    """Collect the undirected edges of faces (m, 3)."""
    n = int(faces.max(initial=0)) + 1
    heads = np.roll(faces, -1, axis=1)
    keys = (np.minimum(faces, heads) * n + np.maximum(faces, heads)).ravel()
    edges, inverse, count = np.unique(keys, return_inverse=True, return_counts=True)
    ends = np.stack(np.divmod(edges, n), axis=1)
    return Edges(ends, inverse.reshape(-1, 3), count)


def half_edge_pairs(edges: Edges) -> IntArray:
    """Half-edges 3 f + i (2, e) of the two faces at each inner edge."""
    order = np.argsort(edges.face_edges.ravel(), kind="stable")
    first = (np.cumsum(edges.face_count) - edges.face_count)[edges.face_count == 2]
    return np.stack([order[first], order[first + 1]])


@dataclass(frozen=True)
class Border:
    """Half-edges of a mesh that have no partner, and those that have too many.

    Attributes
    ----------
    half_edges : (b,) int64
        Half-edges whose edge has one face, ascending; half-edge 3 f + i runs from corner i of
        face f to its corner i + 1.
    non_manifold : int
        Number of edges with more than two faces.
    inconsistent : int
        Number of edges that their two faces run through in the same direction.
    bad_vertices : (b,) int64
        Ends of the edges of both kinds, ascending.
    """

    half_edges: IntArray
    non_manifold: int
    inconsistent: int
    bad_vertices: IntArray


def border_of(faces: IntArray, n: int) -> Border:
    """Find the boundary half-edges of faces (m, 3) over n vertices, by one sort."""
    keys = _half_edge_keys(faces, n).ravel()
    keys.sort()
    same = np.zeros(len(keys) + 1, dtype=np.bool_)  # same[i]: half-edges i - 1 and i share an edge
    turned = []  # per block: edges whose two half-edges run the same way
    for start in range(0, len(keys) - 1, _BLOCK):  # a block at a time, for the memory
        block = keys[start : start + _BLOCK + 1]
        np.less_equal(block[1:] ^ block[:-1], 1, out=same[start + 1 : start + len(block)])
        turned.append(block[1:][block[1:] == block[:-1]] >> 1)
    alone = keys[~same[:-1] & ~same[1:]]
    more = same[1:-1] & same[:-2]  # a third, fourth, ... half-edge of one edge
    crowded = np.unique(keys[1:][more] >> 1)
    inconsistent = np.setdiff1d(np.concatenate(turned), crowded) if turned else crowded
    del keys, same
    marked = np.zeros(n, dtype=np.bool_)  # few vertices, so few half-edges to look at
    marked[alone // (2 * n)] = True
    rows = np.flatnonzero(faces_at(marked, faces))
    at_border = np.isin(_half_edge_keys(faces[rows], n).T, alone)
    return Border(
        half_edges=(3 * rows[:, None] + np.arange(3))[at_border],
        non_manifold=len(crowded),
        inconsistent=len(inconsistent),
        bad_vertices=np.unique(np.divmod(np.concatenate([crowded, inconsistent]), n)),
    )


def _half_edge_keys(faces: IntArray, n: int) -> IntArray:
    """Give each half-edge (3, m) twice the number of its edge, plus one if it runs downwards."""
    keys = np.empty((3, len(faces)), dtype=np.int64)
    for i in range(3):  # a column at a time, as large temporaries cost more than the arithmetic
        tails, heads = faces[:, i], faces[:, (i + 1) % 3]
        np.minimum(tails, heads, out=keys[i])
        keys[i] *= n
        keys[i] += np.maximum(tails, heads)
        keys[i] *= 2
        keys[i] += tails > heads
    return keys


def half_edge_ends(faces: IntArray, half_edges: IntArray) -> tuple[IntArray, IntArray]:
    """Give the tails and heads of half-edges 3 f + i of faces (m, 3), of any shape."""
    corners = faces.ravel()
    return corners[half_edges], corners[half_edges + np.where(half_edges % 3 == 2, -2, 1)]


def faces_at(marked: BoolArray, faces: IntArray) -> BoolArray:
    """Mark the faces (m, 3) of which at least one corner is among the marked vertices (n,)."""
    a, b, c = faces.T
    return np.asarray(marked[a] | marked[b] | marked[c])  # much faster than any(axis=1)


def compacted(faces: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Give the numbers of the vertices that faces (m, 3) use, and the faces in new numbers."""
    marked = np.zeros(n, dtype=np.bool_)
    marked[faces] = True
    used = np.flatnonzero(marked)
    number = np.cumsum(marked) - 1
    return used, np.asarray(number[faces], dtype=np.int64)


def faces_around(faces: IntArray, n: int, seeds: Sequence[IntArray], rings: int) -> list[IntArray]:
    """Walk some rings outwards from each of several sets of vertices, all at once.

    Parameters
    ----------
    faces : (m, 3) int64
    n : int
        Number of vertices.
    seeds : sequence of (s,) int64
    rings : int

    Returns
    -------
    list of (f,) int64
        For each set the faces that hold a vertex less than so many rings away, ascending.
    """
    m, corners = len(faces), faces.ravel()
    order = np.argsort(corners, kind="stable")
    count = np.bincount(corners, minlength=n)
    start = np.cumsum(count) - count
    sizes = [len(seed) for seed in seeds]
    front = np.repeat(np.arange(len(seeds)), sizes) * n + np.concatenate(seeds)
    front, last = np.unique(front), np.zeros(0, dtype=np.int64)
    found = [np.zeros(0, dtype=np.int64)]
    for _ in range(rings):
        walker, vertex = np.divmod(front, n)
        faces_here = count[vertex]
        slot = np.arange(faces_here.sum()) - np.repeat(
            np.cumsum(faces_here) - faces_here, faces_here
        )
        met = order[np.repeat(start[vertex], faces_here) + slot] // 3
        met = np.unique(np.repeat(walker, faces_here) * m + met)
        found.append(met)
        walker, face = np.divmod(met, m)
        beyond = np.unique(walker[:, None] * n + faces[face])
        # a neighbour of a ring lies in it, in the last one, or in the next
        beyond = beyond[~np.isin(beyond, front) & ~np.isin(beyond, last)]
        front, last = beyond, front
    walker, face = np.divmod(np.unique(np.concatenate(found)), m)
    return np.split(face, np.searchsorted(walker, np.arange(1, len(seeds))))


def vertex_adjacency(faces: IntArray, n: int) -> sparse.csr_array:
    """Symmetric (n, n) matrix of ones where two vertices share an edge."""
    ends = edges_of(faces).vertices
    ones = np.ones(len(ends))
    upper = sparse.coo_array((ones, (ends[:, 0], ends[:, 1])), shape=(n, n)).tocsr()
    return sparse.csr_array(upper + upper.T)


def vertex_rings(adjacency: sparse.csr_array, seeds: IntArray, number: int) -> IntArray:
    """Ring number of each vertex around a set of seeds (paper, section 3.3).

    Parameters
    ----------
    adjacency : (n, n) csr_array
    seeds : (s,) int64
        Vertices of ring 0.
    number : int
        Rings to walk.

    Returns
    -------
    (n,) int64
        0 on the seeds, then 1, 2, ... and -1 beyond the last ring.
    """
    ring = np.full(adjacency.shape[0], -1, dtype=np.int64)
    ring[seeds] = 0
    front = np.asarray(seeds, dtype=np.int64)
    for level in range(1, number + 1):
        neighbours = np.unique(adjacency[front].indices)
        front = neighbours[ring[neighbours] < 0].astype(np.int64)
        if len(front) == 0:
            break
        ring[front] = level
    return ring


def vertex_components(faces: IntArray, n: int) -> IntArray:
    """Give the components of vertices numbers, (n,) int64, ordered by their smallest vertices."""
    first = np.arange(n, dtype=sparse.get_index_dtype(maxval=n))  # what scipy computes with
    for start in range(0, len(faces), _BLOCK):  # a block at a time, for the memory
        corners = first[faces[start : start + _BLOCK]]
        tails, heads = corners[:, :2].ravel(), corners[:, 1:].ravel()  # two edges connect a face
        ones = np.ones(len(tails), dtype=np.int8)
        graph = sparse.coo_array((ones, (tails, heads)), shape=(n, n)).tocsr()
        _, label = csgraph.connected_components(graph, directed=False)
        del graph
        smallest = np.full(int(label.max()) + 1, n, dtype=first.dtype)
        np.minimum.at(smallest, label, first)
        first = smallest[label][first]
    return np.asarray(np.cumsum(first == np.arange(n))[first] - 1, dtype=np.int64)


def boundary_vertices(faces: IntArray, n: int) -> BoolArray:
    """Mark the vertices of edges with one face, (n,) bool."""
    corners = faces.ravel()
    half_edges = border_of(faces, n).half_edges
    mask = np.zeros(n, dtype=np.bool_)
    mask[corners[half_edges]] = True  # each boundary vertex is the tail of one
    return mask
