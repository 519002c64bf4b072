"""Reading and writing mesh files through pymeshlab, with the checks that its loaders leave out."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pymeshlab

from meshlab_lowrank.errors import InvalidMeshError, InvalidParameterError

WRITE_SUFFIXES = (".3ds", ".3mf", ".ctm", ".dae", ".obj", ".off", ".ply", ".stl", ".wrl", ".x3d")
READ_SUFFIXES = (*WRITE_SUFFIXES, ".fbx", ".glb", ".gltf", ".vmi", ".x3dv")
_EXACT_SUFFIXES = (".obj", ".off", ".ply")  # others round coordinates or join vertices

_PLY_PROPERTY = re.compile(  # of vertices and faces, as far as MeshLab reads them
    "n?[xyz]|(diffuse_)?(red|green|blue)|alpha|intensity|quality|confidence|radius|flags|[stuv]|"
    "texture_[uvw]|texnumber|texcoord|vertex_ind(ex|ices)"
)
_DROPPED = re.compile(r"(\d+) vertices with NAN coords and (\d+) degenerated faces")
_LOST_TEXTURE = re.compile(r"Failed loading (.+?); using a dummy texture")


@dataclass(frozen=True)
class LoadedMesh:
    """A mesh file in memory.

    Attributes
    ----------
    meshset : pymeshlab.MeshSet
        Holds one mesh, silent.
    path : Path
    textures : tuple of str
        Texture files as the mesh names them, relative to the folder of the file.
    notes : tuple of str
        Sentences on what the loader changed.
    """

    meshset: Any
    path: Path
    textures: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())


def load_mesh(path: Path) -> LoadedMesh:
    """Read a mesh file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    LoadedMesh

    Raises
    ------
    InvalidParameterError
        If there is no such file or pymeshlab has no reader for its format.
    InvalidMeshError
        If the file can't be read, has no faces, has coordinates that are not finite or faces that
        name missing vertices.
    """
    check_readable(path)
    _refuse_missing_vertices(path)  # these loaders skip such faces, or crash
    try:
        meshset, log = _read(path)
    except pymeshlab.PyMeshLabException as error:
        msg = f"{path.name} can't be read ({meshlab_reason(error)}); check that the file is whole."
        raise InvalidMeshError(msg) from error
    notes = _notes(path, log, meshset)
    mesh = meshset.current_mesh()
    if mesh.face_number() == 0:
        msg = f"{path.name} has no faces; give a triangle mesh, not a point cloud."
        raise InvalidMeshError(msg)
    return LoadedMesh(meshset, path, tuple(mesh.textures()), notes)


def check_readable(path: Path) -> None:
    """Refuse a path that is no file or has a format that pymeshlab can't read."""
    if not path.exists():
        msg = f"There is no file {path}; check the name."
        raise InvalidParameterError(msg)
    if not path.is_file():
        msg = f"{path} is not a file; give one mesh file."
        raise InvalidParameterError(msg)
    _check_suffix(path, READ_SUFFIXES, "read")


def check_writable(path: Path) -> None:
    """Refuse a path that pymeshlab can't write: its format, its folder."""
    _check_suffix(path, WRITE_SUFFIXES, "write")
    if path.is_dir():
        msg = f"{path} is a folder; give the name of a file in it."
        raise InvalidParameterError(msg)
    if not path.absolute().parent.is_dir():
        msg = f"There is no folder {path.parent} to write to; make it first."
        raise InvalidParameterError(msg)
    if not os.access(path.absolute().parent, os.W_OK):
        msg = f"The folder {path.absolute().parent} can't be written to; choose another."
        raise InvalidParameterError(msg)


def save_mesh(loaded: LoadedMesh, target: Path) -> None:
    """Write the current mesh, its texture files unchanged beside it, and read it back.

    Positions come back bit for bit from PLY (written as binary doubles); text formats carry 16
    digits. PLY also gets the custom attributes.

    Parameters
    ----------
    loaded : LoadedMesh
    target : Path
        Its suffix chooses the format.

    Raises
    ------
    InvalidMeshError
        If pymeshlab can't write it or what it wrote is not whole.
    OSError
        If a texture file can't be copied.
    """
    meshset, suffix = loaded.meshset, target.suffix.lower().removeprefix(".")
    custom = [name for name in meshset.filter_parameter_values(suffix) if name.startswith("__ca_")]
    try:
        meshset.save_current_mesh(str(target.absolute()), **dict.fromkeys(custom, True))
    except pymeshlab.PyMeshLabException as error:
        msg = (
            f"{target.name} can't be written ({meshlab_reason(error)}); check the free space and "
            "the format."
        )
        raise InvalidMeshError(msg) from error
    _copy_textures(loaded, target.absolute().parent)
    _check_whole(target, loaded.meshset.current_mesh())


def copy_mesh(loaded: LoadedMesh, target: Path) -> None:
    """Give an unchanged mesh another name: the same bytes when the format stays.

    Parameters
    ----------
    loaded : LoadedMesh
    target : Path

    Raises
    ------
    InvalidMeshError, OSError
        As `save_mesh`.
    """
    if target.suffix.lower() != loaded.path.suffix.lower():
        save_mesh(loaded, target)
        return
    shutil.copyfile(loaded.path, target)
    for name in (*loaded.textures, *_material_files(loaded.path)):
        _copy_beside(loaded.path.absolute().parent, name, target.absolute().parent)


def meshlab_reason(error: Exception) -> str:
    """Give the part of MeshLab's message that says what is wrong, without a full stop."""
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return re.sub("^(Error )?[Dd]etails: ", "", lines[-1]).rstrip(".")


@contextlib.contextmanager
def captured_output() -> Iterator[list[str]]:
    """Catch what C++ code writes to the process's standard output and error.

    Yields
    ------
    list of str
        Empty inside the block; holds the whole text after it.
    """
    text: list[str] = []
    sys.stdout.flush()
    sys.stderr.flush()
    saved = os.dup(1), os.dup(2)
    with tempfile.TemporaryFile() as sink:
        os.dup2(sink.fileno(), 1)
        os.dup2(sink.fileno(), 2)
        try:
            yield text
        finally:
            for descriptor, copy in zip((1, 2), saved, strict=True):
                os.dup2(copy, descriptor)
                os.close(copy)
            sink.seek(0)
            text.append(sink.read().decode(errors="replace"))


def _check_suffix(path: Path, known: tuple[str, ...], verb: str) -> None:
    if path.suffix.lower() not in known:
        formats = ", ".join(known)
        msg = (
            f"MeshLab can't {verb} {path.suffix or 'a file without suffix'}; use one of {formats}."
        )
        raise InvalidParameterError(msg)


def _read(path: Path) -> tuple[Any, str]:
    """Load a file into a silent mesh set; only the log tells what the loader dropped."""
    meshset, here = pymeshlab.MeshSet(verbose=True), Path.cwd()
    with captured_output() as log:
        try:
            meshset.load_new_mesh(str(path.absolute()))
        finally:
            os.chdir(here)  # a reader that fails leaves us in the folder of the file
            meshset.set_verbosity(False)
    return meshset, log[0]


def _notes(path: Path, log: str, meshset: Any) -> tuple[str, ...]:
    """Turn the loader's log into notes; refuse what it dropped silently."""
    notes = []
    for vertices, faces in _DROPPED.findall(log):
        if int(vertices):
            msg = (
                f"{path.name} has {vertices} vertices with coordinates that aren't finite; "
                "delete them or export the mesh again."
            )
            raise InvalidMeshError(msg)
        notes.append(f"The loader dropped {faces} faces that name a vertex twice.")
    if unread := _unread_properties(path):
        notes.append(f"MeshLab doesn't read {', '.join(unread)}, so what it writes goes without.")
    notes += [f"The texture {name} can't be read." for name in _LOST_TEXTURE.findall(log)]
    if meshset.mesh_number() > 1:
        notes.append(f"The {meshset.mesh_number()} layers of the file were merged into one mesh.")
        meshset.generate_by_merging_visible_meshes(
            mergevisible=True, deletelayer=True, mergevertices=False, alsounreferenced=True
        )
    return tuple(notes)


def _unread_properties(path: Path) -> list[str]:
    """Name the properties of vertices and faces in a PLY file that the loader passes over."""
    names: list[str] = []
    if path.suffix.lower() != ".ply":
        return names
    element = b""
    with path.open("rb") as file:
        for line in file:
            kind, *words = line.split() or [b""]
            if kind == b"end_header":
                break
            if kind == b"element":
                element = words[0]
            elif kind == b"property" and element in (b"vertex", b"face"):
                names.append(words[-1].decode(errors="replace"))
    return [name for name in dict.fromkeys(names) if not _PLY_PROPERTY.fullmatch(name)]


def _obj_indices(path: Path) -> tuple[int, int]:
    """Count the vertices and find the highest vertex number, from 1 or back from the end."""
    vertices = highest = 0
    with path.open("rb") as file:
        for line in file:
            if line.startswith((b"v ", b"v\t")):
                vertices += 1
            elif line.startswith((b"f ", b"f\t")):
                with contextlib.suppress(ValueError):
                    corners = [abs(int(item.partition(b"/")[0])) for item in line.split()[1:]]
                    highest = max(highest, *corners)
    return vertices, highest


def _off_indices(path: Path) -> tuple[int, int]:
    """Count the vertices and the highest vertex number from 1; zeros when it is no text OFF."""
    with path.open("rb") as file:
        rows = filter(None, (line.partition(b"#")[0].split() for line in file))
        try:
            counts = next(rows)
            if counts[0].endswith(b"OFF"):
                counts = counts[1:] or next(rows)
            vertices, faces = int(counts[0]), int(counts[1])
            polygons = itertools.islice(rows, vertices, vertices + faces)
            corners = (corner for row in polygons for corner in row[1 : 1 + int(row[0])])
            return vertices, 1 + max(map(int, corners), default=-1)
        except (IndexError, StopIteration, ValueError):
            return 0, 0  # the loader says what is wrong with it


def _refuse_missing_vertices(path: Path) -> None:
    scan = {".obj": _obj_indices, ".off": _off_indices}.get(path.suffix.lower())
    vertices, highest = scan(path) if scan else (0, 0)
    if highest > vertices:
        msg = (
            f"{path.name} has faces that name vertex number {highest} of {vertices}; "
            "the file is damaged, export it again."
        )
        raise InvalidMeshError(msg)


def _check_whole(target: Path, mesh: Any) -> None:
    """Read a written file back: a full disk can cut it short without an error."""
    try:
        meshset, log = _read(target)
        dropped = sum(int(faces) for _, faces in _DROPPED.findall(log))
        found = meshset.current_mesh().face_number() + dropped
        exact = target.suffix.lower() in _EXACT_SUFFIXES
        whole = found == mesh.face_number() if exact else found > 0
    except pymeshlab.PyMeshLabException:
        whole = False
    if not whole:
        msg = f"{target.name} was not written whole; check the free space and the format."
        raise InvalidMeshError(msg)


def _copy_textures(loaded: LoadedMesh, folder: Path) -> None:
    """Put the original texture files over those that pymeshlab encoded anew."""
    for name in loaded.textures:
        _copy_beside(loaded.path.absolute().parent, name, folder)


def _copy_beside(source: Path, name: str, target: Path) -> None:
    destination = (target / name).resolve()
    if (source / name).is_file() and destination.is_relative_to(target.resolve()):
        destination.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source / name, destination)


def _material_files(path: Path) -> list[str]:
    if path.suffix.lower() != ".obj":
        return []
    with path.open("rb") as file:
        lines = [line for line in file if line.startswith(b"mtllib")]
    return [name for line in lines for name in line.decode(errors="replace").split()[1:]]
