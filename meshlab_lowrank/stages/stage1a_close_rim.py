"""What closings have in common: the edge length along a loop, and edges that are there already."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_vectors
from meshlab_lowrank.mesh.topology import border_of, edges_of
from meshlab_lowrank.stages.stage0_region import Region

_NEAR_FACES = 40  # faces whose mean area gives the edge length at a vertex of the loop

_LEAST_LENGTH = 1e-6  # in local units
_MOST_RATIO = 30.0
_MOST_FACES = 4_000_000


def local_lengths(region: Region) -> FloatArray:
    """Edge length of equilateral triangles as large as those around each loop vertex, (k,).

    None is less than a thirtieth of the largest.

    Raises
    ------
    StageError
        If the faces around the loop have no area.
    """
    areas = np.linalg.norm(face_vectors(region.vertices, region.faces), axis=1)
    centroids = region.vertices[region.faces].mean(axis=1)
    count = min(_NEAR_FACES, len(centroids))
    _, near = cKDTree(centroids).query(region.vertices[region.loop], k=count)
    mean_area = areas[near.reshape(len(region.loop), -1)].mean(axis=1)
    lengths = np.sqrt(mean_area * 4.0 / np.sqrt(3.0))
    if lengths.max() < _LEAST_LENGTH:
        msg = "The faces around this hole have no area."
        raise StageError(msg)
    return np.asarray(np.maximum(lengths, lengths.max() / _MOST_RATIO))


def face_count(areas: FloatArray, lengths: FloatArray | float) -> FloatArray:
    """How many equilateral triangles of given edge lengths cover given areas (f,)."""
    return np.asarray(areas / (0.25 * np.sqrt(3.0) * lengths**2))


def coarsening(
    count: FloatArray, rim: FloatArray, most: FloatArray, *, asked: BoolArray
) -> FloatArray:
    """By what to multiply the edge lengths of fills, for them to have no more faces than they may.

    Parameters
    ----------
    count : (p,) float64
        Faces that cover the area of each fill, see `face_count`.
    rim : (p,) float64
        Edges that its rim is long. A drawn out fill needs about as many faces, whatever its area.
    most : (p,) float64
        Faces that it may have.
    asked : (p,) bool
        Whether its edge length was asked for; it is left alone then.

    Returns
    -------
    (p,) float64
        1 or more.

    Raises
    ------
    StageError
        If an edge length was asked for with which a fill would need more than 4,000,000 faces.
    """
    wanted = float((count + rim)[asked].max(initial=0.0))
    if wanted > _MOST_FACES:
        msg = f"The fill would need about {wanted:.0f} faces; give a longer edge length."
        raise StageError(msg)
    # count / f^2 + rim / f = most, divided through by most as that may be infinite
    half = 0.5 * rim / most
    return np.where(asked, 1.0, np.maximum(half + np.sqrt(half**2 + count / most), 1.0))


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
