"""Triangulation of a polygon with points inside it, without a turned triangle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import Delaunay, QhullError

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray

_HEXAGON = np.sqrt(3.0) / 2.0
_CLEARANCE = 0.6  # of a point inside from the outline, in edge lengths
_BLOCK = 1000
_MOST_FLIPS = 200
_BOX = 8.0  # most points of a grid, for each that lies inside


def is_simple(points: FloatArray, sides: IntArray) -> bool:
    """Whether no two sides cross or touch, but at a corner that both have.

    Parameters
    ----------
    points : (n, 2) float64
    sides : (s, 2) int64
        Their ends, as rows of the points.
    """
    start, end = points[sides[:, 0]], points[sides[:, 1]]
    for first in range(0, len(sides), _BLOCK):
        rows = slice(first, first + _BLOCK)
        a, b = start[rows, None], end[rows, None]
        c, d = start[None], end[None]
        across = (_turn(a, b, c) * _turn(a, b, d) <= 0.0) & (_turn(c, d, a) * _turn(c, d, b) <= 0.0)
        for own, other in np.ndindex(2, 2):
            across &= sides[rows, None, own] != sides[None, :, other]
        # sides on one line cross only where their boxes meet
        low = np.maximum(np.minimum(a, b), np.minimum(c, d))
        high = np.minimum(np.maximum(a, b), np.maximum(c, d))
        if (across & (low <= high).all(axis=-1)).any():
            return False
    return True


def triangulated(
    corners: FloatArray, outlines: Sequence[IntArray], length: float
) -> tuple[FloatArray, IntArray] | None:
    """Triangulate a polygon, that may have holes, with triangles of about one edge length.

    Parameters
    ----------
    corners : (k, 2) float64
    outlines : sequence of (s,) int64
        Rows of the corners: the outer outline counter-clockwise, then those of holes, clockwise.
        One corner may be in two of them.
    length : float

    Returns
    -------
    points : (k + v, 2) float64
        The corners, then points inside the polygon.
    faces : (f, 3) int64
        Counter-clockwise, each of a positive area; Delaunay triangles but for the polygon's sides.
    None
        If sides cross or touch, or can't be had as edges.
    """
    sides = sides_of(outlines)
    if not is_simple(corners, sides):
        return None
    points = np.concatenate([corners, _grid(corners, outlines, length)])
    faces = _delaunay(points, sides)
    if faces is None or len(faces) != 2 * (len(points) + len(outlines) - 2) - len(sides):
        return None
    return points, faces


def enclosed_area(corners: FloatArray, outlines: Sequence[IntArray]) -> float:
    """Area of a polygon; see `triangulated`."""
    tails, heads = corners[sides_of(outlines).T]
    return 0.5 * abs(float((tails[:, 0] * heads[:, 1] - tails[:, 1] * heads[:, 0]).sum()))


def perimeter(corners: FloatArray, outlines: Sequence[IntArray]) -> float:
    """Length of all sides of a polygon; see `triangulated`."""
    tails, heads = corners[sides_of(outlines).T]
    return float(np.linalg.norm(heads - tails, axis=1).sum())


def sides_of(outlines: Sequence[IntArray]) -> IntArray:
    """Give the ends of the sides of closed outlines, (s, 2) int64."""
    return np.concatenate([np.stack([each, np.roll(each, -1)], axis=1) for each in outlines])


def _delaunay(points: FloatArray, sides: IntArray) -> IntArray | None:
    """Give the Delaunay triangles to the left of the sides, if all sides can be their edges."""
    try:
        faces = Delaunay(points).simplices.astype(np.int64)
    except QhullError:
        return None
    a, b, c = (points[faces[:, i]] for i in range(3))
    clockwise = _turn(a, b, c) < 0.0
    faces[clockwise] = faces[clockwise][:, ::-1]
    n = len(points)
    keys = sides @ np.array([n, 1])
    half_edges = (faces * n + np.roll(faces, -1, axis=1)).ravel()
    for tail, head in sides[~np.isin(keys, half_edges)]:
        if not _force_edge(points, faces, tail, head):
            return None
    half_edges = (faces * n + np.roll(faces, -1, axis=1)).ravel()
    if not np.isin(keys, half_edges).all():
        return None
    # what the sides part from the outside hangs together without crossing them
    order = np.argsort(half_edges)
    heads, tails = np.roll(faces, -1, axis=1).ravel(), faces.ravel()
    opposite = heads * n + tails
    place = np.minimum(np.searchsorted(half_edges, opposite, sorter=order), len(order) - 1)
    across = half_edges[order[place]] == opposite
    across &= ~np.isin(half_edges, keys) & ~np.isin(opposite, keys)
    here, there = np.flatnonzero(across) // 3, order[place[across]] // 3
    graph = sparse.coo_array((np.ones(len(here)), (here, there)), shape=(len(faces),) * 2)
    _, label = csgraph.connected_components(graph.tocsr(), directed=False)
    inner = np.isin(label, label[np.flatnonzero(np.isin(half_edges, keys)) // 3])
    faces = faces[inner]
    a, b, c = (points[faces[:, i]] for i in range(3))
    sound = (_turn(a, b, c) > 0.0).all() and len(np.unique(faces)) == n
    return faces if sound else None


def _force_edge(points: FloatArray, faces: IntArray, tail: int, head: int) -> bool:
    """Flip edges of a triangulation, in place, until none crosses the line between two points.

    References
    ----------
    Sloan, A fast algorithm for generating constrained Delaunay triangulations, 1993.
    """
    a, b = points[tail], points[head]
    for _ in range(_MOST_FLIPS):
        heads = np.roll(faces, -1, axis=1)
        c, d = points[faces], points[heads]
        crossing = (_turn(a, b, c) > 0.0) & (_turn(a, b, d) < 0.0)  # once, of two half-edges
        crossing &= _turn(c, d, a) * _turn(c, d, b) < 0.0
        if not crossing.any():
            return True
        flipped = False
        for face, corner in np.argwhere(crossing):
            p, q, r = np.roll(faces[face], -corner)
            other = np.flatnonzero((faces == q).any(axis=1) & (faces == p).any(axis=1))
            other = other[other != face]
            if len(other) != 1:
                return False
            s = faces[other[0]][~np.isin(faces[other[0]], [p, q])][0]
            if _turn(*points[[s, q, r]]) > 0.0 and _turn(*points[[p, s, r]]) > 0.0:
                faces[face], faces[other[0]] = (s, q, r), (p, s, r)
                flipped = True
                break
        if not flipped:
            return False
    return False


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Twice the area of triangles, negative where they run clockwise."""
    u, w = b - a, c - a
    return np.asarray(u[..., 0] * w[..., 1] - u[..., 1] * w[..., 0])


def _grid(corners: FloatArray, outlines: Sequence[IntArray], length: float) -> FloatArray:
    """Points of a hexagonal grid inside a polygon and off its sides, (v, 2).

    The grid lies along the polygon where that is slim and askew; none where its box is nearly all
    outside even so.
    """
    sides = sides_of(outlines)
    most = _BOX * (enclosed_area(corners, outlines) / (_HEXAGON * length**2) + _BLOCK)
    grid = _hexagons(corners, length, most)
    if grid is None:
        _, axes = np.linalg.eigh(np.cov(corners.T))
        grid = _hexagons(corners @ axes, length, most)
        grid = np.zeros((0, 2)) if grid is None else grid @ axes.T
    return grid[depth_inside(grid, corners, sides) > _CLEARANCE * length]


def _hexagons(corners: FloatArray, length: float, most: float) -> FloatArray | None:
    """Points of a hexagonal grid in the box of some points, (g, 2); None if there are too many."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    rows = int((high[1] - low[1]) / (_HEXAGON * length)) + 1
    columns = int((high[0] - low[0]) / length) + 1
    if rows * columns > most:
        return None
    i, j = np.mgrid[:rows, :columns]
    grid: FloatArray = np.stack([j + 0.5 * (i % 2), _HEXAGON * i], axis=-1).reshape(-1, 2)
    return np.asarray(grid * length + low)


def depth_inside(points: FloatArray, corners: FloatArray, sides: IntArray) -> FloatArray:
    """Distance of points (p, 2) from the sides of a polygon, (p,), negative outside it.

    Parameters
    ----------
    points : (p, 2) float64
    corners : (k, 2) float64
    sides : (s, 2) int64
        Ends of its sides, of all its outlines, as rows of the corners.
    """
    a, b = corners[sides[:, 0]], corners[sides[:, 1]]
    side = b - a
    square = np.maximum((side**2).sum(axis=1), np.finfo(np.float64).tiny)
    depth = np.zeros(len(points))
    for start in range(0, len(points), _BLOCK):
        p = points[start : start + _BLOCK, None]  # (b, 1, 2) against (s, 2)
        along = np.clip(((p - a) * side).sum(axis=-1) / square, 0.0, 1.0)
        gap = np.linalg.norm(p - a - along[..., None] * side, axis=-1).min(axis=1)
        straddles = (a[:, 1] <= p[..., 1]) != (b[:, 1] <= p[..., 1])
        left = (_turn(a, b, p) > 0.0) == (side[:, 1] > 0.0)
        odd = (straddles & left).sum(axis=1) % 2 == 1
        depth[start : start + _BLOCK] = np.where(odd, gap, -gap)
    return depth
