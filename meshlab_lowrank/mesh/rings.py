"""Breadth-first search around many vertices at once, and walks along the rings that it finds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray


@dataclass(frozen=True)
class RingMembers:
    """Vertices around w centres as one flat list of s entries.

    Attributes
    ----------
    patch : (s,) int64
        Number of the centre, from 0 to w - 1.
    vertex : (s,) int64
    ring : (s,) int64
        Distance from the centre in edges.
    """

    patch: IntArray
    vertex: IntArray
    ring: IntArray


def collect_rings(adjacency: sparse.csr_array, centres: IntArray, sp: int) -> RingMembers:
    """Breadth-first search from all centres at once, whole rings, until each has sp vertices.

    A pair of patch p and vertex v is the number ``p * n + v``; the front of all searches is one
    sorted array of such numbers.
    """
    n = adjacency.shape[0]
    start, degree = adjacency.indptr[:-1].astype(np.int64), np.diff(adjacency.indptr)
    front = np.arange(len(centres), dtype=np.int64) * n + centres
    fronts, before = [front], np.zeros(0, dtype=np.int64)
    number = np.ones(len(centres), dtype=np.int64)
    while True:
        growing = front[number[front // n] < sp]
        vertex = growing % n
        count = degree[vertex]
        pick = np.repeat(start[vertex] - np.cumsum(count) + count, count) + np.arange(count.sum())
        reached = np.unique(np.repeat(growing - vertex, count) + adjacency.indices[pick])
        # a neighbour of ring q lies in ring q - 1, q or q + 1
        fresh = np.setdiff1d(reached, np.concatenate([front, before]), assume_unique=True)
        if len(fresh) == 0:
            break
        before, front = front, fresh
        fronts.append(front)
        number += np.bincount(front // n, minlength=len(centres))
    pairs = np.concatenate(fronts)
    ring = np.repeat(np.arange(len(fronts)), [len(f) for f in fronts])
    return RingMembers(pairs // n, pairs % n, ring)


def walk_rings(found: RingMembers, local: FloatArray, start_key: FloatArray, sp: int) -> IntArray:
    """Order of the samples: by patch, by ring, counter-clockwise from the least `start_key`.

    Returns indices into `found`, the first sp of each patch.
    """
    angle = np.arctan2(local[:, 1], local[:, 0])
    by_key = np.lexsort((start_key, found.ring, found.patch))
    patch, ring = found.patch[by_key], found.ring[by_key]
    first = np.ones(len(patch), dtype=np.bool_)
    first[1:] = (patch[1:] != patch[:-1]) | (ring[1:] != ring[:-1])
    turn = np.zeros(len(patch))
    turn[by_key] = np.mod(angle[by_key] - angle[by_key][first][np.cumsum(first) - 1], 2.0 * np.pi)
    order = np.lexsort((turn, found.ring, found.patch))
    return order[position_in_patch(found.patch[order]) < sp]


def position_in_patch(patch: IntArray) -> IntArray:
    """Count 0, 1, 2, ... within each run of equal numbers of a sorted array."""
    return np.arange(len(patch)) - np.searchsorted(patch, patch)


def offsets_in_frames(frames: FloatArray, members: RingMembers, offsets: FloatArray) -> FloatArray:
    """Offsets from the centres, (s, 3), in the frames of their patches."""
    return np.asarray(np.einsum("sij,sj->si", frames[members.patch], offsets))
