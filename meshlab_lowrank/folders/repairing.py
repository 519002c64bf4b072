"""Repair of a mesh before its holes are filled, by MeshLab's own filters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pymeshlab

_STEPS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("meshing_remove_duplicate_vertices", {}),
    ("meshing_remove_duplicate_faces", {}),
    ("meshing_remove_null_faces", {}),
    ("meshing_repair_non_manifold_edges", {"method": "Remove Faces"}),
    ("meshing_re_orient_faces_coherently", {}),
)


def repair(ms: pymeshlab.MeshSet) -> str:
    """Merge doubled vertices, take bad faces out and turn the others alike.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh is changed.

    Returns
    -------
    str
        A sentence on what was changed.
    """
    mesh = ms.current_mesh()
    mesh.compact()
    vertices, faces = mesh.vertex_number(), mesh.face_number()
    for name, values in _STEPS:
        before = mesh.face_matrix()
        getattr(ms, name)(**values)
        mesh.compact()
    turned = np.count_nonzero((mesh.face_matrix() != before).any(axis=1))  # by the last step
    merged, removed = vertices - mesh.vertex_number(), faces - mesh.face_number()
    return f"Repaired: {merged} vertices merged, {removed} faces removed, {turned} faces turned."
