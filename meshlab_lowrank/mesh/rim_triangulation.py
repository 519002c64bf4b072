"""Triangulations of a closed chain of points that bend as little as they can."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, normalized

_STEP = 1e-3  # of one less the cosine, below which two bends are alike and the area decides
_REMEMBERED = 64  # triangulations


def least_bent(points: FloatArray, outer: FloatArray, banned: BoolArray) -> IntArray | None:
    """Triangulate a closed chain of points in space without further ones.

    The largest angle, between two of its triangles or one and what lies beyond its rim, is kept
    small; of several such triangulations it is that with the least area.

    Parameters
    ----------
    points : (n, 3) float64
        At least three.
    outer : (n, 3) float64
        Unit normals of the faces that lie beyond the edges from each point to the next.
    banned : (n, n) bool
        Pairs of points between which no edge may run.

    Returns
    -------
    (n - 2, 3) int64 or None
        Each triangle runs along the chain; None where the bans leave no triangulation.

    Notes
    -----
    By dynamic programming over the pieces of the chain, in time n^3. A piece is settled before it
    is known what it will bend against, so that another triangulation may bend a little less.

    References
    ----------
    Liepa, Filling holes in meshes, 2003, section 3.
    """
    found = _least_bent(points.tobytes(), outer.tobytes(), banned.tobytes())
    return None if found is None else found.copy()


@lru_cache(maxsize=_REMEMBERED)
def _least_bent(chain: bytes, normals: bytes, bans: bytes) -> IntArray | None:
    """Do what `least_bent` does; a rim is triangulated again at each density of its fill."""
    points, outer = (np.frombuffer(each).reshape(-1, 3) for each in (chain, normals))
    banned = np.frombuffer(bans, dtype=np.bool_).reshape(len(points), -1)
    n = len(points)
    bend, area = np.zeros((n, n)), np.zeros((n, n))
    apex = np.zeros((n, n), dtype=np.int64)
    normal = np.zeros((n, n, 3))
    normal[np.arange(n - 1), np.arange(1, n)] = outer[:-1]
    extent = n * np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1).sum() ** 2
    for gap in range(2, n):
        i = np.arange(n - gap)
        j = i + gap
        k = i[:, None] + np.arange(1, gap)  # (n - gap, gap - 1)
        vectors = np.cross(points[k] - points[i, None], points[j, None] - points[i, None])
        across = normalized(vectors)
        before, after = (i[:, None], k), (k, j[:, None])
        bends = np.maximum(bend[before], bend[after])
        for side in (before, after):
            np.maximum(bends, 1.0 - np.einsum("abi,abi->ab", across, normal[side]), out=bends)
        if gap == n - 1:
            np.maximum(bends, 1.0 - across @ outer[-1], out=bends)
        bends[~across.any(axis=2)] = 2.0  # without area there is no telling how it lies
        areas = 0.5 * np.linalg.norm(vectors, axis=2) + area[before] + area[after]
        best = np.argmin(np.ceil(bends / _STEP) + areas / extent, axis=1)
        rows = np.arange(len(i))
        apex[i, j] = k[rows, best]
        bend[i, j], area[i, j] = bends[rows, best], areas[rows, best]
        normal[i, j] = across[rows, best]
        if gap < n - 1:
            bend[i, j] = np.where(banned[i, j], np.inf, bend[i, j])
    if not np.isfinite(bend[0, n - 1]):
        return None
    triangles, pieces = [], [(0, n - 1)]
    while pieces:
        first, last = pieces.pop()
        if last - first > 1:
            middle = int(apex[first, last])
            triangles.append((first, middle, last))
            pieces += [(first, middle), (middle, last)]
    return np.array(triangles, dtype=np.int64)
