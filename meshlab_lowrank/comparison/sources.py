"""The meshes that a comparison is given, in whatever form."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.validation import check_mesh
from meshlab_lowrank.mesh_files import load_mesh

MeshSource: TypeAlias = "str | os.PathLike[str] | pymeshlab.MeshSet | tuple[Any, Any]"


def read_mesh(source: MeshSource) -> tuple[FloatArray, IntArray]:
    """Give the vertices and faces of a mesh, without vertices that no face uses.

    Parameters
    ----------
    source : path, pymeshlab.MeshSet, or (vertices, faces)

    Returns
    -------
    vertices : (n, 3) float64
    faces : (m, 3) int64

    Raises
    ------
    InvalidMeshError
        If the mesh can't be read or worked on.
    """
    if isinstance(source, pymeshlab.MeshSet):
        vertices, faces = check_mesh(*_current_mesh(source))
    elif isinstance(source, tuple):
        vertices, faces = check_mesh(*source)
    else:
        vertices, faces = check_mesh(*_current_mesh(load_mesh(Path(source)).meshset))
    return without_unused(vertices, faces)


def mesh_name(source: MeshSource) -> str:
    """Give the file name or label of a mesh."""
    if isinstance(source, pymeshlab.MeshSet):
        return str(source.current_mesh().label()) or "mesh"
    return "mesh" if isinstance(source, tuple) else Path(source).name


def without_unused(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Drop vertices that no face uses."""
    used, local = np.unique(faces, return_inverse=True)
    return np.ascontiguousarray(vertices[used]), local.reshape(-1, 3).astype(np.int64)


def _current_mesh(ms: Any) -> tuple[FloatArray, IntArray]:
    if ms.mesh_number() == 0:
        msg = "The MeshSet has no mesh; load one first."
        raise InvalidMeshError(msg)
    mesh = ms.current_mesh()
    if not mesh.is_compact():  # compacting would change the caller's mesh
        copy = pymeshlab.MeshSet(verbose=False)
        copy.add_mesh(mesh)
        mesh = copy.current_mesh()
        mesh.compact()
        return mesh.transformed_vertex_matrix(), mesh.face_matrix()
    return mesh.transformed_vertex_matrix(), mesh.face_matrix()
