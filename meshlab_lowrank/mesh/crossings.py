"""Pairs of triangles that cross or lie on one another."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, normalized

_CROSS = 1e-6  # least depth of a crossing, in the extent of the two triangles
_LIE_ON = 1e-3  # distance from one plane, and least overlap, of triangles that lie on one another
_PARALLEL = 1e-8
_BLOCK = 20_000
_AT_ONCE = 2_000  # faces whose pairs are held at a time, for the memory
_PAIRS = 50_000  # tried together, as there are many classes of few pairs
_CELLS = 64


def crossing_pairs(
    vertices: FloatArray, faces: IntArray, first: IntArray, second: IntArray
) -> IntArray:
    """Find the faces that cross one another, or overlap in one plane.

    Faces that only touch, as neighbours do at their common edge or corner, don't cross.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    first, second : (a,), (b,) int64
        Rows of faces; each of the first is tried against each of the second.

    Returns
    -------
    (p, 2) int64
        Rows of faces that cross, one of the first and one of the second, in ascending order.

    Notes
    -----
    By separating axes: two triangles are apart if their shadows on the normal of one of them, or
    on the cross product of two of their sides, are. Faces without area cross nothing.
    """
    found = [np.zeros((0, 2), dtype=np.int64)]
    triangles = _Triangles(vertices, faces)
    for near in _together(_near_pairs(vertices, faces, first, second)):
        pairs = triangles.not_apart(near)
        found.append(pairs[triangles.cross(pairs)])
    return np.unique(np.concatenate(found), axis=0)


class _Triangles:
    """The planes and extents of faces, to pass over most pairs at little cost.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    """

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        corners = vertices[faces]  # (m, 3, 3)
        self._corners = corners
        self._normals = normalized(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        )
        self._extents = np.ptp(corners, axis=1).max(axis=1)

    def not_apart(self, pairs: IntArray) -> IntArray:
        """Leave out pairs (p, 2) of which one lies off, and on one side of, the other's plane."""
        for own, other in ((0, 1), (1, 0)):
            plane, rows = pairs[:, own], pairs[:, other]
            away = self._corners[rows] - self._corners[plane, :1]
            height = np.einsum("pij,pj->pi", away, self._normals[plane])
            low, high = _span(height)
            extent = np.maximum(self._extents[plane], self._extents[rows])
            apart = np.maximum(low, -high) >= -_CROSS * extent
            pairs = pairs[~apart | (np.maximum(high, -low) <= _LIE_ON * extent)]
        return pairs

    def cross(self, pairs: IntArray) -> BoolArray:
        """Whether the faces of each pair (p, 2) cross or lie on one another."""
        one, other = pairs.T
        return _cross(
            self._corners[one],
            self._corners[other],
            (self._normals[one], self._normals[other]),
            np.maximum(self._extents[one], self._extents[other]),
        )


def faces_near(
    vertices: FloatArray, faces: IntArray, low: FloatArray, high: FloatArray
) -> IntArray:
    """Find the faces that may reach into one of some boxes.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    low, high : (g, 3) float64
        Corners of the boxes.

    Returns
    -------
    (f,) int64
        Rows of faces, ascending: all that do, and some that come near.
    """
    if len(low) == 0:
        return np.zeros(0, dtype=np.int64)
    margin = _LIE_ON * (high - low).max(axis=1, keepdims=True)  # what lies on a face is near it
    low, high = low - margin, high + margin
    lowest, highest = low.min(axis=0), high.max(axis=0)
    side = np.zeros(len(vertices), dtype=np.uint8)  # on which sides of the box around all boxes
    for axis in range(3):
        side |= (vertices[:, axis] < lowest[axis]).astype(np.uint8) << (2 * axis)
        side |= (vertices[:, axis] > highest[axis]).astype(np.uint8) << (2 * axis + 1)
    outside = side[faces[:, 0]] & side[faces[:, 1]] & side[faces[:, 2]]
    rows = np.flatnonzero(outside == 0)
    cell = np.maximum((highest - lowest).max() / _CELLS, np.finfo(np.float64).tiny)
    taken = np.zeros((_CELLS + 2,) * 3, dtype=np.int32)  # a cell each side for the sums

    def cells(points: FloatArray) -> IntArray:
        return np.asarray(np.clip(np.floor((points - lowest) / cell), 0, _CELLS), dtype=np.int64)

    for (x, y, z), (u, v, w) in zip(cells(low).tolist(), cells(high).tolist(), strict=True):
        taken[x + 1 : u + 2, y + 1 : v + 2, z + 1 : w + 2] = 1
    sums = taken.cumsum(axis=0).cumsum(axis=1).cumsum(axis=2)
    near = [np.zeros(0, dtype=np.int64)]
    for start in range(0, len(rows), _BLOCK):
        corners = vertices[faces[rows[start : start + _BLOCK]]]  # (b, 3, 3)
        ends = (cells(corners.min(axis=1)), cells(corners.max(axis=1)) + 1)
        count = np.zeros(len(corners), dtype=np.int64)
        for corner in np.ndindex(2, 2, 2):  # inclusion and exclusion over the corners of the range
            x, y, z = (ends[which][:, axis] for axis, which in enumerate(corner))
            count += (-1) ** (3 - sum(corner)) * sums[x, y, z]
        near.append(rows[start : start + _BLOCK][count > 0])
    return np.concatenate(near)


def _near_pairs(
    vertices: FloatArray, faces: IntArray, first: IntArray, second: IntArray
) -> Iterator[IntArray]:
    """Give pairs (p, 2) of different faces whose boxes meet, those of like sizes together."""
    corners = vertices[faces]  # (m, 3, 3)
    low, high = corners.min(axis=1).T.copy(), corners.max(axis=1).T.copy()
    sides = []
    for rows in (first, second):
        corners = vertices[faces[rows]]
        centre = corners.mean(axis=1)
        radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        kept = radius > 0.0
        size = np.floor(np.log2(radius[kept])).astype(np.int64)
        sides.append(
            [
                (float(2.0 ** (each + 1)), rows[kept][size == each], centre[kept][size == each])
                for each in np.unique(size)
            ]
        )
    for reach, others, centres in sides[1]:
        tree = cKDTree(centres)
        for own_reach, own, points in sides[0]:
            for start in range(0, len(own), _AT_ONCE):
                block = cKDTree(points[start : start + _AT_ONCE])
                near = block.sparse_distance_matrix(
                    tree, own_reach + reach, output_type="coo_matrix"
                )
                ours, theirs = own[start + near.row], others[near.col]
                for axis in range(3):
                    gap = np.maximum(
                        low[axis, ours] - high[axis, theirs], low[axis, theirs] - high[axis, ours]
                    )
                    kept = gap <= _LIE_ON * (own_reach + reach)
                    ours, theirs = ours[kept], theirs[kept]
                yield np.stack([ours, theirs], axis=1)[ours != theirs]


def _together(blocks: Iterator[IntArray]) -> Iterator[IntArray]:
    """Join small blocks of pairs."""
    held: list[IntArray] = []
    for block in blocks:
        held.append(block)
        if sum(map(len, held)) >= _PAIRS:
            yield np.concatenate(held)
            held = []
    if held:
        yield np.concatenate(held)


def _cross(
    a: FloatArray, b: FloatArray, normals: tuple[FloatArray, FloatArray], extent: FloatArray
) -> BoolArray:
    """Whether triangles (p, 3, 3), of normals (p, 3), cross or lie on their partners."""
    origin = a[:, :1]
    a, b = a - origin, b - origin
    off = np.zeros(len(a))  # largest distance of a corner from the other's plane
    for normal, own, other in zip(normals, (a, b), (b, a), strict=True):
        away = np.einsum("pij,pj->pi", other - own[:, :1], normal)
        off = np.maximum(off, _span(np.abs(away))[1])
    result = (np.linalg.norm(normals[0], axis=1) > 0.0) & (np.linalg.norm(normals[1], axis=1) > 0.0)
    level = off <= _LIE_ON * extent
    sides = [np.roll(t, -1, axis=1) - t for t in (a, b)]  # (p, 3, 3)
    rows = np.flatnonzero(result & level)
    for which in range(2):
        for i in range(3):
            axis = normalized(np.cross(normals[which][rows], sides[which][rows, i]))
            deep = _depth(a[rows], b[rows], axis) > _LIE_ON * extent[rows]
            result[rows[~deep]] = False
            rows = rows[deep]
    rows = np.flatnonzero(result & ~level)
    for normal in normals:
        deep = _depth(a[rows], b[rows], normal[rows]) > _CROSS * extent[rows]
        result[rows[~deep]] = False
        rows = rows[deep]
    for i, j in np.ndindex(3, 3):
        axis = np.cross(sides[0][rows, i], sides[1][rows, j])
        length = np.linalg.norm(axis, axis=1)
        told = length > _PARALLEL * extent[rows] ** 2
        deep = ~told | (_depth(a[rows], b[rows], normalized(axis)) > _CROSS * extent[rows])
        result[rows[~deep]] = False
        rows = rows[deep]
    return np.asarray(result)


def _depth(a: FloatArray, b: FloatArray, axis: FloatArray) -> FloatArray:
    """How far the shadows of two triangles on an axis must move to be apart, (p,)."""
    (low, high), (lowest, highest) = (_span(np.einsum("pij,pj->pi", t, axis)) for t in (a, b))
    return np.minimum(high - lowest, highest - low)


def _span(heights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest, (p,) each, of three heights (p, 3); much faster than along an axis."""
    first, second, third = heights.T
    return (
        np.minimum(np.minimum(first, second), third),
        np.maximum(np.maximum(first, second), third),
    )
