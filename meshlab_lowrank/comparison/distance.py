"""Exact distances from points to triangles, with a KD-tree in front."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.comparison.sampling import cut_triangles
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, edge_lengths

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
            self._corners, max(2.0 * float(np.median(longest)), fair_share)
        )
        centroids = pieces.mean(axis=1)
        self._radius = float(np.linalg.norm(pieces - centroids[:, None], axis=2).max())
        self._tree = cKDTree(centroids)

    def closest(self, points: FloatArray) -> ClosestPoints:
        """Find the closest place of the surface to each of the points (p, 3)."""
        distances = np.full(len(points), np.inf)
        faces = np.zeros(len(points), dtype=np.int64)
        barycentric = np.zeros((len(points), 3))
        open_ = np.arange(len(points))
        k = min(8, self._tree.n)
        while len(open_):
            still_open = []
            step = max(1, _CHUNK // k)
            for start in range(0, len(open_), step):
                rows = open_[start : start + step]
                reach, found = self._tree.query(points[rows], k=np.arange(1, k + 1), workers=-1)
                owners = self._owners[found]  # (rows, k)
                repeated = np.repeat(points[rows], k, axis=0)
                gaps, places = closest_on_triangles(repeated, self._corners[owners.ravel()])
                gaps = gaps.reshape(-1, k)
                chosen = gaps.argmin(axis=1)
                row = np.arange(len(rows))
                distances[rows] = gaps[row, chosen]
                faces[rows] = owners[row, chosen]
                barycentric[rows] = places.reshape(-1, k, 3)[row, chosen]
                if k < self._tree.n:
                    still_open.append(
                        rows[distances[rows] > np.atleast_2d(reach)[:, -1] - self._radius]
                    )
            open_ = np.concatenate(still_open) if still_open else open_[:0]
            k = min(4 * k, self._tree.n)
        return ClosestPoints(distances, faces, barycentric)
