"""Faces that cross others, as MeshLab's own selection filter finds them."""

from __future__ import annotations

import numpy as np
import pymeshlab
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, edge_lengths


def count_crossing_faces(vertices: FloatArray, faces: IntArray, part: BoolArray) -> int:
    """Count the faces of a part that cross any face of the mesh.

    Only faces that can reach the part are looked at, so the cost follows the part.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    part : (m,) bool

    Returns
    -------
    int
    """
    if not part.any():
        return 0
    near = np.flatnonzero(part | _within_reach(vertices, faces, part))
    used, local = np.unique(faces[near], return_inverse=True)
    mesh_set = pymeshlab.MeshSet(verbose=False)
    mesh_set.add_mesh(pymeshlab.Mesh(vertices[used], local.reshape(-1, 3)))
    mesh_set.compute_selection_by_self_intersections_per_face()
    crossing = np.asarray(mesh_set.current_mesh().face_selection_array(), dtype=np.bool_)
    return int((crossing & part[near]).sum())


def _within_reach(vertices: FloatArray, faces: IntArray, part: BoolArray) -> BoolArray:
    """Mark faces whose bounding sphere meets that of a face of the part, roughly."""
    centres = vertices[faces].mean(axis=1)
    radii = edge_lengths(vertices, faces).max(axis=1)
    low = (centres[part] - radii[part, None]).min(axis=0)
    high = (centres[part] + radii[part, None]).max(axis=0)
    candidates = np.flatnonzero(
        (centres + radii[:, None] >= low).all(axis=1)
        & (centres - radii[:, None] <= high).all(axis=1)
    )
    reach = np.zeros(len(faces), dtype=np.bool_)
    tree = cKDTree(centres[part])
    gap, _ = tree.query(centres[candidates], workers=-1)
    reach[candidates] = gap <= radii[candidates] + radii[part].max()
    return reach
