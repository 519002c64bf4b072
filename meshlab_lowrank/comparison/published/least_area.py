"""Least areas of the pieces of a chain of points, by dynamic programming."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray


def least_areas(points: FloatArray, banned: BoolArray, most: int) -> tuple[FloatArray, IntArray]:
    """Give the least areas between the pieces of a chain of points and their chords.

    Parameters
    ----------
    points : (k, 3) float64
    banned : (k, k) bool
        Chords that may not be.
    most : int
        Sides of the longest pieces.

    Returns
    -------
    weight : (k, k) float64
        Of the piece from each point to each later one; infinite where it can't be triangulated.
    apex : (k, k) int64
        The third corner of the triangle at the chord.
    """
    k = len(points)
    weight = np.full((k, k), np.inf)
    weight[np.arange(k - 1), np.arange(1, k)] = 0.0
    apex = np.zeros((k, k), dtype=np.int64)
    for gap in range(2, most + 1):
        i = np.arange(k - gap)
        j = i + gap
        m = i[:, None] + np.arange(1, gap)
        first, last = points[i, None], points[j, None]
        areas = 0.5 * np.linalg.norm(np.cross(points[m] - first, last - first), axis=2)
        total = areas + weight[i[:, None], m] + weight[m, j[:, None]]
        best = np.argmin(total, axis=1)
        rows = np.arange(len(i))
        apex[i, j] = m[rows, best]
        weight[i, j] = np.where(banned[i, j], np.inf, total[rows, best])
    return weight, apex


def pieces(apex: IntArray, first: int, last: int) -> list[tuple[int, int, int]]:
    """Give the triangles of the piece of a chain between two of its points."""
    triangles, open_pieces = [], [(first, last)]
    while open_pieces:
        i, j = open_pieces.pop()
        if j - i > 1:
            m = int(apex[i, j])
            triangles.append((i, m, j))
            open_pieces += [(i, m), (m, j)]
    return triangles
