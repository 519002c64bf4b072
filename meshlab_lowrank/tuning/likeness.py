"""How much the relief of places is like that around the hole."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import vertex_adjacency

_ROUNDS = (3, 12, 40)  # of averages over neighbours: up to some 4, 9 and 20 edge lengths
_LEAST_ENERGY = 1e-6
_LEAST_SHARE = 1e-9


def unlikeness(hole: Hole, centres: IntArray, radius: float, rim: BoolArray) -> FloatArray:
    """Compare the relief around places with that around the hole.

    Relief is taken apart into what averages over few and over many neighbours take from the
    normals; the mean squares of the parts are its amplitude and its spectrum in one.

    Parameters
    ----------
    hole : Hole
    centres : (c,) int64
        Vertices at the places.
    radius : float
        How far around them is looked, in mean edge lengths.
    rim : (n,) bool
        Vertices whose relief the places are compared with.

    Returns
    -------
    (c,) float64
        Root mean square difference of the logarithms of the parts' mean squares.
    """
    parts = _parts(hole)
    wanted = _logarithms(parts, np.flatnonzero(rim & hole.measured))
    measured = np.flatnonzero(hole.measured)
    around = cKDTree(hole.positions[measured]).query_ball_point(hole.positions[centres], radius)
    found = np.stack([_logarithms(parts, measured[near]) for near in around])
    return np.asarray(np.sqrt(((found - wanted) ** 2).mean(axis=1)))


def _logarithms(parts: FloatArray, rows: IntArray) -> FloatArray:
    return np.asarray(np.log(parts[rows].sum(axis=0) / max(len(rows), 1) + _LEAST_ENERGY))


def _parts(hole: Hole) -> FloatArray:
    """Squared detail of the normals at each vertex between one smoothing and the next, (n, 3)."""
    n = len(hole.positions)
    known = sparse.diags_array(hole.measured.astype(np.float64))
    near = known @ (vertex_adjacency(hole.faces, n).astype(np.float64) + sparse.eye_array(n))
    near = sparse.csr_array(near @ known)
    share = np.maximum(np.asarray(near.sum(axis=1)).ravel(), _LEAST_SHARE)
    average = sparse.csr_array(sparse.diags_array(1.0 / share) @ near)
    parts, before = [], hole.normals
    done = 0
    for rounds in _ROUNDS:
        after = before
        for _ in range(rounds - done):
            after = np.asarray(average @ after)
        parts.append(((before - after) ** 2).sum(axis=1))
        before, done = after, rounds
    return np.stack(parts, axis=1)
