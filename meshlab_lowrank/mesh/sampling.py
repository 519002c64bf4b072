"""Points spread evenly over a set of points."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray

_BATCH = 2000


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
    left = np.argsort(-np.random.default_rng(0).permutation(len(points)))  # first come, first taken
    chosen = []
    while len(left):  # a batch at a time: all pairs are too many where points lie densely
        batch, left = left[:_BATCH], left[_BATCH:]
        winners = batch[_first_come(points[batch], distance)]
        chosen.append(winners)
        bound = np.nextafter(distance, np.inf)
        away = cKDTree(points[winners]).query(points[left], distance_upper_bound=bound)[0]
        left = left[np.isinf(away)]
    return np.sort(np.concatenate(chosen)) if chosen else left


def _first_come(points: FloatArray, distance: float) -> BoolArray:
    """Mark points (n, 3) that are nearer than a distance to no earlier one that is marked."""
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")  # (p, 2), i < j
    early, late = pairs.T
    marked, open_ = np.zeros(len(points), dtype=np.bool_), np.ones(len(points), dtype=np.bool_)
    while open_.any():
        rivalled = np.zeros(len(points), dtype=np.bool_)
        rivalled[late[open_[early]]] = True
        winner = open_ & ~rivalled
        marked |= winner
        open_ &= ~winner
        open_[late[winner[early]]] = False
    return marked
