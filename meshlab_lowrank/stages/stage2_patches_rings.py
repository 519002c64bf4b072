"""The paper's patches: sp vertices found ring by ring, in PCA frames (sections 3.3.1 to 3.3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.topology import vertex_adjacency, vertex_rings
from meshlab_lowrank.stages.stage2_frames_pca import pca_frames
from meshlab_lowrank.stages.stage2_patches import Patches, tangent_frames


@dataclass(frozen=True)
class _Members:
    """Vertices of all patches as one flat list."""

    patch: IntArray
    vertex: IntArray
    ring: IntArray


def ring_centres(faces: IntArray, n: int, loop: IntArray, inside: IntArray, r: int) -> IntArray:
    """Give the centres of the patches of one hole: the r-ring neighbourhood NB_r (section 3.3).

    NB_r lies on M^1, so it reaches into the filled hole as well as outwards. Where a hole is
    deeper than r rings, its other vertices are added: otherwise no patch would hold them, and
    their normals could never be recovered.

    Parameters
    ----------
    faces : (m, 3) int64
        Faces of M^1, the closed mesh.
    n : int
        Number of vertices.
    loop : (b,) int64
        Vertices of the hole boundary HB.
    inside : (u,) int64
        Vertices of the filled hole, M^1 - M^0.
    r : int
        Number of rings.

    Returns
    -------
    (w,) int64, sorted
    """
    rings = vertex_rings(vertex_adjacency(faces, n), loop, r)
    return np.union1d(np.flatnonzero(rings >= 0), inside)


def ring_patches(vertices: FloatArray, faces: IntArray, centres: IntArray, sp: int) -> Patches:
    """Extract the patches N(v_i) of the paper.

    Section 3.3.1: the vertices around a centre are collected ring by ring, counter-clockwise as
    seen from outside, each ring from its vertex nearest to v_i, until there are sp. Their
    covariance about v_i gives the frame (section 3.3.2). The rings are then walked again, each
    from the vertex nearest to the half-line of e1 (section 3.3.3), and cut at sp: that is the
    order of the samples. Complete rings hold the same vertices in both walks.

    A ring is all vertices at one distance in edges, its order is the angle about v_i in the
    tangent plane: that is the walk along the ring where the ring is one, and stays defined where
    it is torn by a border.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    centres : (w,) int64
    sp : int
        Vertices per patch.

    Returns
    -------
    Patches
        One vertex per sample. Where the surface has fewer than sp vertices in reach, the last
        samples are empty rows.
    """
    normals = vertex_normals(vertices, faces)
    found = _collect_rings(vertex_adjacency(faces, len(vertices)), centres, sp)
    offsets = vertices[found.vertex] - vertices[centres[found.patch]]

    upright = tangent_frames(normals[centres])
    local = _to_frames(upright, found, offsets)
    order = _walk(found, local, np.linalg.norm(offsets, axis=1), sp)
    patch, vertex = found.patch[order], found.vertex[order]
    frames = pca_frames(patch, offsets[order], normals[vertex], len(centres))

    local = _to_frames(frames, found, offsets)
    beside = np.where(local[:, 0] > 0, local[:, 1] ** 2, (local[:, :2] ** 2).sum(axis=1))
    order = _walk(found, local, beside, sp)
    rows = found.patch[order] * sp + _position_in_patch(found.patch[order])
    sampler = sparse.csr_array(
        (np.ones(len(order)), (rows, found.vertex[order])),
        shape=(len(centres) * sp, len(vertices)),
    )
    return Patches(centres=centres, frames=frames, sampler=sampler, size=sp)


def _collect_rings(adjacency: sparse.csr_array, centres: IntArray, sp: int) -> _Members:
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
    return _Members(pairs // n, pairs % n, ring)


def _walk(found: _Members, local: FloatArray, start_key: FloatArray, sp: int) -> IntArray:
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
    return order[_position_in_patch(found.patch[order]) < sp]


def _position_in_patch(patch: IntArray) -> IntArray:
    """Count 0, 1, 2, ... within each run of equal numbers of a sorted array."""
    return np.arange(len(patch)) - np.searchsorted(patch, patch)


def _to_frames(frames: FloatArray, members: _Members, offsets: FloatArray) -> FloatArray:
    """Offsets from the centres, (s, 3), in the frames of their patches."""
    return np.asarray(np.einsum("sij,sj->si", frames[members.patch], offsets))
