"""Means over what lies around each point."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import FloatArray


def window_means(points: FloatArray, values: FloatArray, radius: float) -> FloatArray:
    """Average values over the points within a distance of each point, itself too.

    Parameters
    ----------
    points : (n, 3) float64
    values : (n, d) float64
    radius : float

    Returns
    -------
    (n, d) float64
    """
    tree = cKDTree(points)
    pairs = tree.sparse_distance_matrix(tree, radius, output_type="ndarray")
    ones, places = np.ones(len(pairs)), (pairs["i"], pairs["j"])
    near = sparse.csr_array((ones, places), shape=(len(points), len(points)))
    return np.asarray((near @ values) / np.asarray(near.sum(axis=1)).reshape(-1, 1))
