"""Stage 1, closing: the flat faces around a hole go on across it, without new vertices."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, face_normals
from meshlab_lowrank.mesh.topology import edges_of
from meshlab_lowrank.stages.stage0_batch import with_fill
from meshlab_lowrank.stages.stage0_region import Region

_SOFT = np.radians(8.0)  # edges that turn by much more than that cost the same
_FOLDED = np.radians(150.0)
_FOLD_COST = 100.0
_LEAST_AREA = 1e-9


def close_with_planes(region: Region) -> Region:
    """Triangulate a loop so that as little as can be of its edges, by length, is bent.

    Parameters
    ----------
    region : Region
        Open, without islands.

    Returns
    -------
    Region
        Closed; it has no new vertices.

    Raises
    ------
    StageError
        If each triangulation has an edge that is there already, or a face without area.

    References
    ----------
    Barequet and Sharir, Filling gaps in the boundary of a polyhedron, 1995.
    """
    loop, rim = region.loop, region.vertices[region.loop]
    k = len(loop)
    beyond = _beyond(region)
    taken = _taken(region)
    cost, split = np.full((k, k), np.inf), np.zeros((k, k), dtype=np.int64)
    normals = np.zeros((k, k, 3))  # of the face at the inner side of each edge
    steps = np.arange(k)
    cost[steps[:-1], steps[1:]] = 0.0
    normals[steps, (steps + 1) % k] = beyond
    for width in range(2, k):
        for i in range(k - width):
            j = i + width
            if taken[i, j] and width < k - 1:
                continue
            inner = np.arange(i + 1, j)
            normal, area = _triangles(rim[i], rim[inner], rim[j])
            total = cost[i, inner] + cost[inner, j]
            total += _bend(rim[i] - rim[inner], normals[i, inner], normal)
            total += _bend(rim[j] - rim[inner], normals[inner, j], normal)
            if width == k - 1:
                total += _bend((rim[i] - rim[j])[None], beyond[-1:], normal)
            total[area < _LEAST_AREA] = np.inf
            best = int(np.argmin(total))
            cost[i, j], split[i, j] = total[best], inner[best]
            normals[i, j] = normal[best]
    if not np.isfinite(cost[0, k - 1]):
        msg = "Its rim can't be closed without new vertices."
        raise StageError(msg)
    faces = []
    left = [(0, k - 1)]
    while left:
        i, j = left.pop()
        if j > i + 1:
            middle = int(split[i, j])
            faces.append((i, middle, j))
            left += [(i, middle), (middle, j)]
    return with_fill(region, np.zeros((0, 3)), loop[np.array(faces, dtype=np.int64)])


def _beyond(region: Region) -> FloatArray:
    """Give the normals of the known faces at the edges of the loop, (k, 3)."""
    n = len(region.vertices)
    keys = (region.faces * n + np.roll(region.faces, -1, axis=1)).ravel()
    order = np.argsort(keys)
    wanted = np.roll(region.loop, -1) * n + region.loop
    rows = order[np.searchsorted(keys, wanted, sorter=order)] // 3
    return face_normals(region.vertices, region.faces[rows])


def _taken(region: Region) -> BoolArray:
    """Which pairs of vertices of the loop have an edge, (k, k) bool."""
    k = len(region.loop)
    place = np.full(len(region.vertices), -1)
    place[region.loop] = np.arange(k)
    ends = place[edges_of(region.faces).vertices]
    ends = ends[(ends >= 0).all(axis=1)]
    taken = np.zeros((k, k), dtype=np.bool_)
    taken[ends[:, 0], ends[:, 1]] = taken[ends[:, 1], ends[:, 0]] = True
    return taken


def _triangles(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give unit normals (p, 3) and areas (p,) of the triangles a, b, c for many b."""
    vectors = np.cross(b - a, c - a)
    length = np.linalg.norm(vectors, axis=1)
    return vectors / np.maximum(length, 1e-300)[:, None], 0.5 * length


def _bend(edges: FloatArray, one: FloatArray, two: FloatArray) -> FloatArray:
    """Weigh edges, (p,): about their length if they are bent, far more if they are folded."""
    cosine = np.sum(one * two, axis=1)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    each = 1.0 - np.exp(-angle / _SOFT) + 0.2 * angle + _FOLD_COST * (angle > _FOLDED)
    return np.asarray(np.linalg.norm(edges, axis=1) * each)
