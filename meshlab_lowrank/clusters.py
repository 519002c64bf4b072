"""Holes that lie near one another, to be worked on as one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray

_MOST_HOLES = 12  # of a cluster, so that clusters don't grow over a whole mesh
_MOST_VERTICES = 4000  # that are missing in one, where it has several holes
_LARGEST_RATIO = 1.5  # of edge lengths


def clusters(
    rims: Sequence[FloatArray], scales: Sequence[float], missing: Sequence[int], near: float
) -> list[list[int]]:
    """Put holes together whose surroundings are the same.

    Each cluster has a first hole, near to which the others lie; chains of holes don't make long
    clusters.

    Parameters
    ----------
    rims : sequence of (k, 3) float64
        Vertices of the loops.
    scales : sequence of float
        Mean edge length around each, in the units of the mesh.
    missing : sequence of int
        New vertices of each.
    near : float
        Largest distance from the first hole, in its mean edge lengths.

    Returns
    -------
    list of list of int
        Numbers of the holes, each in one cluster; clusters by their first holes, ascending.
    """
    if len(rims) == 0:
        return []
    points = np.concatenate(rims)
    of = np.repeat(np.arange(len(rims)), [len(rim) for rim in rims])
    tree = cKDTree(points)
    left = np.ones(len(rims), dtype=np.bool_)
    found = []
    for first, rim in enumerate(rims):
        if not left[first]:
            continue
        left[first] = False
        cluster, total = [first], missing[first]
        for other in _within(tree, of, rim, near * scales[first]):
            ratio = scales[other] / scales[first]
            fits = 1.0 / _LARGEST_RATIO < ratio < _LARGEST_RATIO
            fits = fits and len(cluster) < _MOST_HOLES and total + missing[other] <= _MOST_VERTICES
            if left[other] and fits:
                left[other] = False
                cluster.append(int(other))
                total += missing[other]
        found.append(cluster)
    return found


def _within(tree: cKDTree, of: IntArray, rim: FloatArray, distance: float) -> IntArray:
    """Numbers of the holes with a vertex near a rim, ascending."""
    lists = tree.query_ball_point(rim, distance)
    return np.unique(of[np.unique(np.concatenate([np.array(each, dtype=int) for each in lists]))])
