"""Connectivity of triangle meshes: edges, adjacency, rings, components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from meshlab_lowrank.mesh.geometry import BoolArray, IntArray


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
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    ends = np.sort(directed, axis=1)
    vertices, inverse, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    return Edges(vertices, inverse.reshape(-1, 3), count)


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
    """Label of the connected component of each vertex, (n,) int64."""
    _, labels = csgraph.connected_components(vertex_adjacency(faces, n), directed=False)
    return np.asarray(labels, dtype=np.int64)


def boundary_vertices(faces: IntArray, n: int) -> BoolArray:
    """Mark the vertices of edges with one face, (n,) bool."""
    edges = edges_of(faces)
    mask = np.zeros(n, dtype=np.bool_)
    mask[edges.vertices[edges.face_count == 1]] = True
    return mask
