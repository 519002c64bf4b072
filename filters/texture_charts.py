"""Texture coordinates for a fill, where its rim lies in one chart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class RimTexture:
    """What the faces around the holes say about the texture of the fill.

    Attributes
    ----------
    coordinates : (k, 2) float64
        Texture coordinates at the rim vertices of the fill; where the rim of a fill lies in
        several charts they are all those of one rim vertex, so that it gets that texel's colour.
    textures : (q,) int64
        Texture index for each new face.
    in_one_chart : (q,) bool
        Whether the texture can run on into the face.
    """

    coordinates: FloatArray
    textures: IntArray
    in_one_chart: BoolArray


def rim_texture(
    vertices: FloatArray,
    faces: IntArray,
    new_faces: IntArray,
    wedges: FloatArray,
    textures: IntArray,
) -> RimTexture:
    """Read the texture around the fills.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    new_faces : (q, 3) int64
        Indices beyond those of ``vertices`` are new vertices. Each connected fill has a rim.
    wedges : (m, 3, 2) float64
        Texture coordinates of the corners of ``faces``.
    textures : (m,) int64
        Texture index of each of ``faces``.

    Returns
    -------
    RimTexture
    """
    rim = np.intersect1d(new_faces, faces)
    data, seam = _rim_corners(faces, rim, wedges, textures)
    return _one_texel_if_broken(vertices, new_faces, rim, data, seam)


def vertex_rim_texture(
    vertices: FloatArray, new_faces: IntArray, coordinates: FloatArray
) -> RimTexture:
    """Read the texture around the fills where coordinates (n, 2) belong to vertices."""
    rim = np.unique(new_faces[new_faces < len(vertices)])
    finite = np.where(np.isfinite(coordinates[rim]), coordinates[rim], 0.0)
    data = np.column_stack([finite, np.zeros(len(rim))])
    return _one_texel_if_broken(vertices, new_faces, rim, data, np.zeros(len(rim), dtype=np.bool_))


def _one_texel_if_broken(
    vertices: FloatArray, new_faces: IntArray, rim: IntArray, data: FloatArray, seam: BoolArray
) -> RimTexture:
    """Give fills whose rim lies in several charts the data of one of its vertices.

    Parameters
    ----------
    vertices : (n, 3) float64
    new_faces : (q, 3) int64
    rim : (k,) int64
        Vertices of the rims.
    data : (k, 3) float64
        Their u, v and texture.
    seam : (k,) bool
        Whether they have others too.
    """
    ids, local = np.unique(new_faces, return_inverse=True)
    fill = _connected(local.reshape(-1, 3), len(ids))
    rim_fill = fill[np.searchsorted(ids, rim)]
    leader = np.unique(rim_fill, return_index=True)[1]  # a rim vertex of each fill
    _, first, place = np.unique(vertices[rim], axis=0, return_index=True, return_inverse=True)
    doubled = (data != data[first][place.ravel()]).any(axis=1)  # seams that are cut open
    broken = np.zeros(len(leader), dtype=np.bool_)
    broken[rim_fill[seam | doubled | (data[:, 2] != data[leader[rim_fill], 2])]] = True
    data = np.where(broken[rim_fill, None], data[leader[rim_fill]], data)
    face_fill = fill[local.reshape(-1, 3)[:, 0]]
    return RimTexture(
        coordinates=data[:, :2],
        textures=data[leader, 2].astype(np.int64)[face_fill],
        in_one_chart=~broken[face_fill],
    )


def _connected(faces: IntArray, n: int) -> IntArray:
    """Find the connected part of faces (q, 3) to which each of n vertices belongs, (n,)."""
    ones = np.ones(2 * len(faces))
    pairs = (np.repeat(faces[:, 0], 2), faces[:, 1:].ravel())
    graph = sparse.coo_array((ones, pairs), shape=(n, n))
    parts: IntArray = csgraph.connected_components(graph, directed=False)[1].astype(np.int64)
    return parts


def _rim_corners(
    faces: IntArray, rim: IntArray, wedges: FloatArray, textures: IntArray
) -> tuple[FloatArray, BoolArray]:
    """Give u, v and texture of the first corner at each rim vertex, and whether others differ."""
    on_rim = np.zeros(int(faces.max()) + 1, dtype=np.bool_)
    on_rim[rim] = True
    rows = np.flatnonzero(on_rim[faces].any(axis=1))
    corners = faces[rows].ravel()
    data = np.column_stack([wedges[rows].reshape(-1, 2), np.repeat(textures[rows], 3)])
    corners, data = corners[on_rim[corners]], data[on_rim[corners]]
    _, first, place = np.unique(corners, return_index=True, return_inverse=True)
    seam = np.zeros(len(rim), dtype=np.bool_)
    seam[place[(data != data[first][place]).any(axis=1)]] = True
    return np.asarray(data[first], dtype=np.float64), seam
