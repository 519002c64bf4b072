"""Marks of what is invented in a mesh file: inside PLY, in a small file beside all others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import msgspec
import numpy as np
import plyfile

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray
from meshlab_lowrank.mesh_files.hashing import sha256_of
from meshlab_lowrank.mesh_files.names import kind_of
from meshlab_lowrank.mesh_files.ply_header import PlyHeader
from meshlab_lowrank.plain_text import plain

INPAINTED = "inpainted"
INPAINT_TRUST = "inpaint_trust"
INPAINT_ERROR = "inpaint_error"
MARKS_SUFFIX = ".marks.json"
_FORMAT = "meshlab-lowrank marks 1"
_PROPERTIES = {"vertex": (INPAINTED, INPAINT_TRUST), "face": (INPAINTED,)}
_INDICES = ("vertex_indices", "vertex_index")

_Count: TypeAlias = Annotated[int, msgspec.Meta(ge=0)]


@dataclass(frozen=True)
class Marks:
    """What is invented in a mesh.

    Attributes
    ----------
    vertices : (n,) bool
        New ones.
    faces : (m,) bool
    trust : (n,) float64
        See `InpaintResult`; NaN where it is not known.
    error : (n,) float64
        Likewise; NaN on new vertices that older versions marked.
    """

    vertices: BoolArray
    faces: BoolArray
    trust: FloatArray
    error: FloatArray

    @property
    def any(self) -> bool:
        """Whether something is invented."""
        return bool(self.faces.any() or self.vertices.any())


class _Document(msgspec.Struct):
    format: str
    mesh: str
    sha256: str
    vertex_count: _Count
    face_count: _Count
    faces: list[_Count]
    vertices: list[_Count]
    vertex_trust: list[float | None]
    vertex_error: list[float | None] | None = None


def marks_path(mesh: Path) -> Path:
    """Give the path of the marks beside a mesh."""
    return mesh.with_name(f"{mesh.name}{MARKS_SUFFIX}")


def write_marks(path: Path, marks: Marks, *, mesh: Path, name: str) -> None:
    """Write marks beside a mesh.

    Parameters
    ----------
    path : Path
    marks : Marks
        By the rows of the vertices and faces in the file of the mesh.
    mesh : Path
        The file, whole; its hash goes along, so that marks of another one are told apart.
    name : str
        That it will have.

    Raises
    ------
    OSError
    """
    new = np.flatnonzero(marks.vertices)
    document = _Document(
        format=_FORMAT,
        mesh=plain(name),
        sha256=sha256_of(mesh),
        vertex_count=len(marks.vertices),
        face_count=len(marks.faces),
        faces=np.flatnonzero(marks.faces).tolist(),
        vertices=new.tolist(),
        vertex_trust=_with_none(marks.trust[new]),
        vertex_error=_with_none(marks.error[new]),
    )
    path.write_bytes(msgspec.json.format(msgspec.json.encode(document), indent=0) + b"\n")


def marks_beside(mesh: Path, vertices: int, faces: int) -> Marks | None:
    """Read the marks of a mesh file, from itself or from the file beside it.

    Parameters
    ----------
    mesh : Path
    vertices, faces : int
        How many the mesh has.

    Returns
    -------
    Marks or None
        None if there are none.

    Raises
    ------
    InvalidMeshError
        If they are damaged, or those of another mesh.
    """
    if mesh.suffix.lower() == ".ply":
        return _marks_in_ply(mesh, vertices, faces) if holds_marks(mesh) else None
    path = marks_path(mesh)
    if not path.exists():
        return None
    document = _document(path)
    if document.sha256 != sha256_of(mesh):
        msg = f"{path.name} was written for another {mesh.name}; its marks were left out."
        raise InvalidMeshError(msg)
    return _marks(document, path, vertices, faces)


def read_marks(path: Path, vertices: int, faces: int) -> Marks:
    """Read the marks of a mesh from a file of marks, or a PLY file that holds them.

    Parameters
    ----------
    path : Path
    vertices, faces : int
        How many the mesh has.

    Raises
    ------
    InvalidMeshError
        If it is no such file, or damaged.
    OSError
        If it can't be read.
    """
    if kind := kind_of(path):
        msg = f"{path} is {kind} and not a file; give a file of marks or a PLY file."
        raise InvalidMeshError(msg)
    if path.suffix.lower() != ".ply":
        return _marks(_document(path), path, vertices, faces)
    if not holds_marks(path):
        msg = f"{path.name} holds no marks; write it by meshlab-lowrank, or save it with them."
        raise InvalidMeshError(msg)
    return _marks_in_ply(path, vertices, faces)


def holds_marks(path: Path) -> bool:
    """Whether a PLY file has the properties that mark what is invented."""
    found = {element.name: element.properties for element in PlyHeader.read(path).elements}
    return all(set(names) <= set(found.get(kind, ())) for kind, names in _PROPERTIES.items())


def _document(path: Path) -> _Document:
    if kind := kind_of(path):
        msg = f"{path.name} is {kind} and not a file; take it away."
        raise InvalidMeshError(msg)
    try:
        document = msgspec.json.decode(path.read_bytes(), type=_Document)
    except msgspec.MsgspecError as error:
        msg = f"{path.name} is no file of marks ({error}); write the mesh again."
        raise InvalidMeshError(msg) from error
    if document.format != _FORMAT:
        msg = f"{path.name} has the format {document.format!r}, which is not {_FORMAT!r}."
        raise InvalidMeshError(msg)
    return document


def _marks(document: _Document, path: Path, vertices: int, faces: int) -> Marks:
    _refuse_misfit(path, (document.vertex_count, document.face_count), (vertices, faces))
    errors = document.vertex_error
    if errors is None:
        errors = [None] * len(document.vertices)
    inside = (
        max(document.vertices, default=-1) < vertices
        and max(document.faces, default=-1) < faces
        and len(document.vertices) == len(document.vertex_trust) == len(errors)
    )
    if not inside:
        msg = f"{path.name} marks what its mesh doesn't have; write the mesh again."
        raise InvalidMeshError(msg)
    marks = Marks(
        np.zeros(vertices, np.bool_),
        np.zeros(faces, np.bool_),
        np.ones(vertices),
        np.zeros(vertices),
    )
    marks.vertices[document.vertices] = True
    marks.faces[document.faces] = True
    marks.trust[document.vertices] = _with_nan(document.vertex_trust)
    marks.error[document.vertices] = _with_nan(errors)
    return marks


def _with_none(values: FloatArray) -> list[float | None]:
    return [None if math.isnan(value) else value for value in values.tolist()]


def _with_nan(values: list[float | None]) -> list[float]:
    return [math.nan if value is None else value for value in values]


def _marks_in_ply(path: Path, vertices: int, faces: int) -> Marks:
    try:
        data = _ply_data(path)
        vertex, face = data["vertex"].data, data["face"].data
        new = np.asarray(vertex[INPAINTED]) > 0.5
        error = np.where(new, np.nan, 0.0)
        if INPAINT_ERROR in vertex.dtype.names:
            error = np.array(vertex[INPAINT_ERROR], dtype=np.float64)
        marks = Marks(
            new,
            np.asarray(face[INPAINTED]) > 0.5,
            np.array(vertex[INPAINT_TRUST], dtype=np.float64),
            error,
        )
    except (plyfile.PlyParseError, ValueError, TypeError, LookupError) as error:
        msg = f"The marks in {path.name} can't be read ({error}); check that the file is whole."
        raise InvalidMeshError(msg) from error
    _refuse_misfit(path, (len(marks.vertices), len(marks.faces)), (vertices, faces))
    return marks


def _refuse_misfit(path: Path, found: tuple[int, int], wanted: tuple[int, int]) -> None:
    if found != wanted:
        msg = (
            f"{path.name} marks a mesh of {found[0]} vertices and {found[1]} faces, and this one "
            f"has {wanted[0]} and {wanted[1]}; its marks were left out."
        )
        raise InvalidMeshError(msg)


def _ply_data(path: Path) -> Any:
    """Read a PLY file; fast if all faces are triangles, as in those that MeshLab writes."""
    triangles = {"face": dict.fromkeys(_INDICES, 3)}
    try:
        return plyfile.PlyData.read(str(path), known_list_len=triangles, mmap=False)
    except plyfile.PlyParseError:
        return plyfile.PlyData.read(str(path), mmap=False)
