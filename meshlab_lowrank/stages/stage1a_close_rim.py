"""What closings have in common: the edge length along a loop, and edges that are there already."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, face_vectors
from meshlab_lowrank.mesh.topology import border_of, edges_of
from meshlab_lowrank.stages.stage0_region import Region

_NEAR_FACES = 40  # faces whose mean area gives the edge length at a vertex of the loop


def local_lengths(region: Region) -> FloatArray:
    """Edge length of equilateral triangles as large as those around each loop vertex, (k,)."""
    areas = np.linalg.norm(face_vectors(region.vertices, region.faces), axis=1)
    centroids = region.vertices[region.faces].mean(axis=1)
    count = min(_NEAR_FACES, len(centroids))
    _, near = cKDTree(centroids).query(region.vertices[region.loop], k=count)
    mean_area = areas[near.reshape(len(region.loop), -1)].mean(axis=1)
    return np.asarray(np.sqrt(mean_area * 4.0 / np.sqrt(3.0)))


def without_double_edges(n: int, known: IntArray, filled: IntArray) -> tuple[IntArray, IntArray]:
    """Split edges of the fills that the mesh has, or may get from another fill, already.

    Gives the ends (d, 2) of the edges in whose middles the new vertices n, n + 1, ... come, and
    the faces of the fills.
    """
    edges, present = edges_of(filled), edges_of(known)
    old = np.zeros(n, dtype=np.bool_)
    old[known] = True
    inner = edges.vertices[(edges.face_count == 2) & old[edges.vertices].all(axis=1)]
    double = np.isin(inner @ np.array([n, 1]), present.vertices @ np.array([n, 1]))
    tails = known.ravel()[border_of(known, n).half_edges]
    pinched = np.bincount(tails, minlength=n) > 1
    double |= pinched[inner].all(axis=1)
    ends = inner[double]
    faces = filled.tolist()
    for number, (a, b) in enumerate(ends.tolist()):
        middle = n + number
        for face in [face for face in faces if a in face and b in face]:
            faces.remove(face)
            faces += [[middle if corner == end else corner for corner in face] for end in (a, b)]
    return ends, np.array(faces, dtype=np.int64).reshape(-1, 3)
