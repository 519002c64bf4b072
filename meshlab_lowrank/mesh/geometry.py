"""Normals, areas and differential operators of triangle meshes."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]

_COTANGENT_LIMIT = 20.0  # an angle below 3 degrees would let one triangle rule the operator


def normalized(vectors: FloatArray) -> FloatArray:
    """Scale vectors to unit length; zero vectors stay zero.

    Parameters
    ----------
    vectors : (..., d) float64

    Returns
    -------
    (..., d) float64
    """
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0))


def face_vectors(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Area vectors: the unit normal of each face times its area.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64

    Returns
    -------
    (m, 3) float64
    """
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    (ux, uy, uz), (vx, vy, vz) = (b - a).T, (c - a).T  # much faster than np.cross
    return 0.5 * np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], axis=1)


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Give the unit normals of the faces, (m, 3) float64; zero for faces without area."""
    return normalized(face_vectors(vertices, faces))


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Area-weighted unit normals of the vertices.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64

    Returns
    -------
    (n, 3) float64
        Zero for vertices without faces.
    """
    total = corner_sum(faces, np.repeat(face_vectors(vertices, faces), 3, axis=0), len(vertices))
    return normalized(total)


def corner_sum(faces: IntArray, values: FloatArray, n: int) -> FloatArray:
    """Sum values given at face corners over the vertices.

    Parameters
    ----------
    faces : (m, 3) int64
    values : (3 m, d) or (3 m,) float64
        In the order of ``faces.ravel()``.
    n : int
        Number of vertices.

    Returns
    -------
    (n, d) or (n,) float64
    """
    corners = faces.ravel()
    if values.ndim == 1:
        return np.asarray(np.bincount(corners, weights=values, minlength=n), dtype=np.float64)
    columns = [np.bincount(corners, weights=column, minlength=n) for column in values.T]
    return np.stack(columns, axis=1).astype(
        np.float64, copy=False
    )  # without corners they are of integers


def vertex_areas(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """One third of the area of the faces around each vertex, (n,) float64."""
    areas = np.linalg.norm(face_vectors(vertices, faces), axis=1)
    return corner_sum(faces, np.repeat(areas / 3.0, 3), len(vertices))


def edge_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Lengths of the three edges of each face, (m, 3): edge i runs from corner i to i + 1."""
    corners = vertices[faces]  # (m, 3, 3)
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2))


def corner_angles(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Angle at each corner of each face in radians, (m, 3) float64."""
    corners = vertices[faces]
    onward = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    dot = np.einsum("ijk,ijk->ij", onward, back)
    doubled_area = 2.0 * np.linalg.norm(face_vectors(vertices, faces), axis=1)
    return np.asarray(np.arctan2(doubled_area[:, None], dot))


def cotangent_laplacian(vertices: FloatArray, faces: IntArray) -> sparse.csr_array:
    """Positive semi-definite cotangent Laplacian.

    Row sums are zero; off-diagonal entries are minus half the sum of the two cotangents opposite
    the edge. Cotangents are clamped to [0, 20], which keeps the matrix an M-matrix on obtuse
    and sliver triangles.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64

    Returns
    -------
    (n, n) csr_array of float64

    References
    ----------
    Pinkall and Polthier, Computing discrete minimal surfaces and their conjugates, 1993.
    """
    n = len(vertices)
    corners = vertices[faces]  # (m, 3, 3)
    rows, columns, weights = [], [], []
    for i in range(3):
        u = corners[:, (i + 1) % 3] - corners[:, i]
        v = corners[:, (i + 2) % 3] - corners[:, i]
        doubled_area = np.linalg.norm(np.cross(u, v), axis=1)
        dot = np.einsum("ij,ij->i", u, v)
        cotangent = np.divide(dot, doubled_area, out=np.zeros_like(dot), where=doubled_area > 0)
        rows.append(faces[:, (i + 1) % 3])
        columns.append(faces[:, (i + 2) % 3])
        weights.append(0.5 * np.clip(cotangent, 0.0, _COTANGENT_LIMIT))
    row, column, weight = (np.concatenate(parts) for parts in (rows, columns, weights))
    adjacency = sparse.coo_array((weight, (row, column)), shape=(n, n)).tocsr()
    adjacency = adjacency + adjacency.T
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    return sparse.csr_array(sparse.diags_array(degree) - adjacency)
