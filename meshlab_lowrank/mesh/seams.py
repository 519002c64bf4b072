"""Seams: boundary edges that lie on one another because vertices are doubled there."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.topology import faces_at, half_edge_ends


def seam_pairs(vertices: FloatArray, faces: IntArray, half_edges: IntArray) -> IntArray:
    """Pair boundary half-edges that lie on one another and run against one another.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    half_edges : (b,) int64
        All boundary half-edges.

    Returns
    -------
    (p, 2) int64
        Half-edges. Where more than two lie on one another none of them is paired, nor are those
        without length.
    """
    tails, heads = half_edge_ends(faces, half_edges)
    ids, ends = np.unique(np.stack([tails, heads]), return_inverse=True)
    _, place = np.unique(vertices[ids] + 0.0, axis=0, return_inverse=True)  # -0 is 0
    tail, head = place.ravel()[ends.reshape(2, -1)]
    if len(place) == 0 or len(np.unique(place)) == len(place):
        return np.zeros((0, 2), dtype=np.int64)
    keys = np.minimum(tail, head) * len(ids) + np.maximum(tail, head)
    _, edge, count = np.unique(keys, return_inverse=True, return_counts=True)
    forwards = np.bincount(edge, tail < head, minlength=len(count))
    backwards = np.bincount(edge, tail > head, minlength=len(count))
    paired = (count == 2) & (forwards == 1) & (backwards == 1)
    chosen = np.flatnonzero(paired[edge])
    order = chosen[np.lexsort((tail[chosen] > head[chosen], edge[chosen]))]
    return half_edges[order].reshape(-1, 2)


def welded(faces: IntArray, n: int, pairs: IntArray) -> IntArray:
    """Give faces (m, 3) over n vertices one vertex where half-edges (p, 2) meet in pairs.

    Vertices that would collapse a face stay apart.

    Returns
    -------
    (m, 3) int64
        Of vertices that become one, each face has the first.
    """
    tails, heads = half_edge_ends(faces, pairs.T)
    one = np.concatenate([tails[0], heads[0]])
    other = np.concatenate([heads[1], tails[1]])
    ones = np.ones(len(one), dtype=np.int8)
    graph = sparse.coo_array((ones, (one, other)), shape=(n, n))
    _, label = csgraph.connected_components(graph.tocsr(), directed=False)
    first = np.full(int(label.max()) + 1, n)
    np.minimum.at(first, label, np.arange(n))
    number = first[label].astype(np.int64)
    moved = number != np.arange(n)
    moved[number[moved]] = True
    near = faces[faces_at(moved, faces)]
    corners = number[near]
    flat = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    apart = np.isin(label, label[near[flat]])
    number[apart] = np.flatnonzero(apart)
    return number[faces]


def on_seams(
    filled: IntArray, tails: IntArray, heads: IntArray, starts: IntArray, ends: IntArray
) -> IntArray:
    """Attach a fill of welded vertices to the doubled ones.

    Parameters
    ----------
    filled : (f, 3) int64
        Faces of the fill.
    tails, heads : (k,) int64
        Vertices of the edges of boundary loops; a face of the fill runs from tail to head.
    starts, ends : (k,) int64
        The doubled vertices in the face on the other side of that edge.

    Returns
    -------
    (f, 3) int64
        The seam runs on into the fill for one edge.
    """
    size = 1 + max(int(filled.max(initial=0)), int(tails.max()), int(starts.max()), int(ends.max()))
    number = np.arange(size)
    number[heads] = ends
    result = number[filled]
    keys = (filled * size + np.roll(filled, -1, axis=1)).ravel()
    order = np.argsort(keys)
    wanted = tails * size + heads
    corner = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
    found = keys[corner] == wanted
    result.ravel()[corner[found]] = starts[found]
    return result
