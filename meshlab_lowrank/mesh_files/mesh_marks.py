"""The marks of a mesh in memory: its custom attributes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh_files.marks import (
    INPAINT_ERROR,
    INPAINT_TRUST,
    INPAINTED,
    Marks,
    marks_beside,
)

_SAME_PLACE = 1e-4  # of the diagonal of the bounding box: as text formats round


def marks_of(mesh: Any) -> Marks | None:
    """Read the marks of a compact `pymeshlab.Mesh`; None if it has none."""
    try:
        vertices = mesh.vertex_custom_scalar_attribute_array(INPAINTED) > 0.5
        faces = mesh.face_custom_scalar_attribute_array(INPAINTED) > 0.5
        trust = mesh.vertex_custom_scalar_attribute_array(INPAINT_TRUST)
    except pymeshlab.PyMeshLabException:
        return None
    try:
        error = mesh.vertex_custom_scalar_attribute_array(INPAINT_ERROR)
    except pymeshlab.PyMeshLabException:  # of an older version
        error = np.where(vertices, np.nan, 0.0)
    return Marks(vertices, faces, trust, error)


def put_marks(mesh: Any, marks: Marks) -> None:
    """Give marks to a compact `pymeshlab.Mesh` that has none."""
    mesh.add_vertex_custom_scalar_attribute(marks.vertices.astype(np.float64), INPAINTED)
    mesh.add_vertex_custom_scalar_attribute(marks.trust, INPAINT_TRUST)
    mesh.add_vertex_custom_scalar_attribute(marks.error, INPAINT_ERROR)
    mesh.add_face_custom_scalar_attribute(marks.faces.astype(np.float64), INPAINTED)


def take_marks(mesh: Any, path: Path) -> str:
    """Give a mesh the marks of the file from which it was just read.

    Parameters
    ----------
    mesh : pymeshlab.Mesh
    path : Path

    Returns
    -------
    str
        A sentence on why there are marks that it doesn't get; empty otherwise.
    """
    try:
        marks = marks_beside(path, mesh.vertex_number(), mesh.face_number())
    except (InvalidMeshError, OSError) as error:
        return str(error)
    if marks is not None:
        mesh.compact()
        put_marks(mesh, marks)
    return ""


def marks_as_read(marks: Marks, mesh: Any, read: Any) -> Marks | None:
    """Give the marks of a mesh by the rows that its file is read with.

    Formats join vertices or number them anew; faces must have kept their order.

    Parameters
    ----------
    marks : Marks
    mesh : pymeshlab.Mesh
        That was written.
    read : pymeshlab.Mesh
        What its file gives.

    Returns
    -------
    Marks or None
        None where the faces have another order.
    """
    read.compact()
    if read.face_number() != mesh.face_number():
        return None
    written, found = mesh.face_matrix(), read.face_matrix()
    places, kept = mesh.vertex_matrix()[written], read.vertex_matrix()[found]
    diagonal = float(np.linalg.norm(np.ptp(places.reshape(-1, 3), axis=0)))
    if np.abs(places - kept).max(initial=0.0) > _SAME_PLACE * diagonal:
        return None
    vertices = np.zeros(read.vertex_number(), dtype=np.bool_)
    trust, error = np.ones(read.vertex_number()), np.zeros(read.vertex_number())
    vertices[found] = marks.vertices[written]
    trust[found], error[found] = marks.trust[written], marks.error[written]
    return Marks(vertices, marks.faces, trust, error)
