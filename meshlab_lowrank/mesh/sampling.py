"""Points spread evenly over a set of points."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray


def spread_points(points: FloatArray, distance: float) -> IntArray:
    """Choose a maximal set of points no two of which are nearer than a distance.

    Parameters
    ----------
    points : (n, 3) float64
    distance : float
        In the units of the points.

    Returns
    -------
    (k,) int64
        Indices of the chosen points, ascending.
    """
    n = len(points)
    priority = np.random.default_rng(0).permutation(n)
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    ones = np.ones(len(pairs), dtype=np.bool_)
    graph = sparse.coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()
    graph = sparse.csr_array(graph + graph.T)
    one, other = np.repeat(np.arange(n), np.diff(graph.indptr)), graph.indices
    chosen, open_ = np.zeros(n, dtype=np.bool_), np.ones(n, dtype=np.bool_)
    while open_.any():
        rank = np.where(open_, priority, -1)
        rival = np.full(n, -1)
        np.maximum.at(rival, one, rank[other])
        winner = open_ & (rank > rival)
        chosen |= winner
        open_ &= ~winner
        open_[other[winner[one]]] = False
    return np.flatnonzero(chosen)
