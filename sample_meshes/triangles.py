"""The few mesh helpers that the generator needs."""

from __future__ import annotations

import numpy as np

from .bodies import FloatArray, IntArray


def edges_of(faces: IntArray) -> IntArray:
    """Undirected edges, (e, 2), each once, sorted."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(edges, axis=0)


def mean_edge(vertices: FloatArray, faces: IntArray) -> float:
    """Mean length of the edges."""
    a, b = edges_of(faces).T
    return float(np.linalg.norm(vertices[a] - vertices[b], axis=1).mean())


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Area-weighted unit normals of the vertices, (n, 3)."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    normals = np.stack(
        [
            np.bincount(faces.ravel(), weights=np.repeat(cross[:, i], 3), minlength=len(vertices))
            for i in range(3)
        ],
        axis=1,
    )
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None])
