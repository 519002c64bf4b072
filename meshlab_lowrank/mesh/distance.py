"""Exact distances from points to triangles, with a KD-tree in front."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, edge_lengths
from meshlab_lowrank.mesh.triangle_sampling import cut_triangles

_FIRST = 4  # pieces that every point looks at
_CHUNK = 400_000  # point-triangle pairs looked at together, which bounds memory


@dataclass(frozen=True)
class ClosestPoints:
    """The place of a surface that is closest to each query point.

    Attributes
    ----------
    distances : (p,) float64
    faces : (p,) int64
    barycentric : (p, 3) float64
    """

    distances: FloatArray
    faces: IntArray
    barycentric: FloatArray


def closest_on_triangles(points: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Closest place of one triangle to one point, for many pairs.

    Parameters
    ----------
    points : (p, 3) float64
    corners : (p, 3, 3) float64
        Triangles, one a point; they may have no area.

    Returns
    -------
    distances : (p,) float64
    barycentric : (p, 3) float64
    """
    best = np.full(len(points), np.inf)
    barycentric = np.zeros((len(points), 3))
    for i in range(3):
        j = (i + 1) % 3
        along = corners[:, j] - corners[:, i]
        squared = np.einsum("pd,pd->p", along, along)
        t = np.einsum("pd,pd->p", points - corners[:, i], along)
        t = np.divide(t, squared, out=np.zeros_like(t), where=squared > 0).clip(0.0, 1.0)
        gap = np.linalg.norm(corners[:, i] + t[:, None] * along - points, axis=1)
        nearer = gap < best
        best[nearer] = gap[nearer]
        barycentric[nearer] = 0.0
        barycentric[nearer, i] = 1.0 - t[nearer]
        barycentric[nearer, j] = t[nearer]

    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    w = points - corners[:, 0]
    normal = np.cross(u, v)
    squared = np.einsum("pd,pd->p", normal, normal)
    safe = np.where(squared > 0, squared, 1.0)
    b = np.einsum("pd,pd->p", np.cross(w, v), normal) / safe
    c = np.einsum("pd,pd->p", np.cross(u, w), normal) / safe
    inside = (squared > 0) & (b >= 0) & (c >= 0) & (b + c <= 1)
    best[inside] = np.abs(np.einsum("pd,pd->p", w, normal) / np.sqrt(safe))[inside]
    barycentric[inside] = np.stack([1.0 - b - c, b, c], axis=1)[inside]
    return best, barycentric


class TriangleIndex:
    """A surface prepared for many closest-point queries.

    Long triangles are cut for the tree alone, so that every piece lies within one radius of its
    centroid; a candidate closer than any piece that was not looked at is then the exact answer.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        At least one.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        self._corners = vertices[faces]
        longest = edge_lengths(vertices, faces).max(axis=1)
        fair_share = np.sqrt(np.sum(longest**2) / (2 * len(faces) + 500))
        pieces, self._owners = cut_triangles(
            self._corners, max(float(np.median(longest)), fair_share)
        )
        centroids = pieces.mean(axis=1)
        self._radius = float(np.linalg.norm(pieces - centroids[:, None], axis=2).max())
        self._tree = cKDTree(centroids)

    def closest(self, points: FloatArray) -> ClosestPoints:
        """Find the closest place of the surface to each of the points (p, 3)."""
        found = ClosestPoints(
            np.full(len(points), np.inf),
            np.zeros(len(points), dtype=np.int64),
            np.zeros((len(points), 3)),
        )
        unsure = np.arange(len(points))
        looked_at, k = 0, min(_FIRST, self._tree.n)
        while len(unsure):
            step = max(1, _CHUNK // k)
            parts = [
                self._look(points, rows, looked_at, k, found)
                for rows in np.split(unsure, range(step, len(unsure), step))
            ]
            unsure = np.concatenate(parts)
            looked_at, k = k, min(4 * k, self._tree.n)
        return found

    def _look(
        self, points: FloatArray, rows: IntArray, skip: int, k: int, found: ClosestPoints
    ) -> IntArray:
        """Look at the pieces from number `skip` to `k` of some points; give those still unsure."""
        ranks = np.arange(skip + 1, k + 1)
        answer = self._tree.query(points[rows], k=ranks, workers=-1)
        reach, piece = (np.asarray(part) for part in answer)  # (rows, ranks)
        row, rank = np.nonzero(reach < found.distances[rows, None] + self._radius)
        owner = self._owners[piece[row, rank]]
        gap, place = closest_on_triangles(points[rows[row]], self._corners[owner])
        order = np.lexsort((gap, row))
        first = order[np.searchsorted(row[order], np.unique(row))]
        better = first[gap[first] < found.distances[rows[row[first]]]]
        target = rows[row[better]]
        found.distances[target] = gap[better]
        found.faces[target] = owner[better]
        found.barycentric[target] = place[better]
        if k == self._tree.n:
            return rows[:0]
        return rows[found.distances[rows] > reach[:, -1] - self._radius]
