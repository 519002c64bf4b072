"""Writing mesh files through pymeshlab, and reading them back."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import pymeshlab

from meshlab_lowrank.errors import InvalidMeshError, InvalidParameterError
from meshlab_lowrank.mesh_files.formats import WRITE_SUFFIXES, check_suffix
from meshlab_lowrank.mesh_files.marks import marks_path, write_marks
from meshlab_lowrank.mesh_files.mesh_marks import marks_as_read, marks_of
from meshlab_lowrank.mesh_files.meshlab_output import meshlab_reason
from meshlab_lowrank.mesh_files.names import safe_name
from meshlab_lowrank.mesh_files.reading import DROPPED, LoadedMesh, read
from meshlab_lowrank.mesh_files.staging import plain_name

_EXACT_SUFFIXES = (".obj", ".off", ".ply")  # others round coordinates or join vertices


def check_writable(path: Path) -> None:
    """Refuse a path that pymeshlab can't write: its format, its folder."""
    check_suffix(path, WRITE_SUFFIXES, "write")
    if path.is_dir():
        msg = f"{path} is a folder; give the name of a file in it."
        raise InvalidParameterError(msg)
    if not path.absolute().parent.is_dir():
        msg = f"There is no folder {path.parent} to write to; make it first."
        raise InvalidParameterError(msg)
    if not os.access(path.absolute().parent, os.W_OK):
        msg = f"The folder {path.absolute().parent} can't be written to; choose another."
        raise InvalidParameterError(msg)


def save_mesh(loaded: LoadedMesh, target: Path) -> tuple[str, ...]:
    """Write the current mesh, its texture files unchanged beside it, and read it back.

    Positions come back bit for bit from PLY (written as binary doubles); text formats carry 16
    digits. PLY also gets the custom attributes; beside other formats lies a file of the marks, if
    something is marked.

    Parameters
    ----------
    loaded : LoadedMesh
    target : Path
        Its suffix chooses the format.

    Returns
    -------
    tuple of str
        Sentences on what the format lost of the texture and the marks.

    Raises
    ------
    InvalidMeshError
        If pymeshlab can't write it or what it wrote is not whole.
    OSError
        If a texture file can't be copied, or the marks can't be written.
    """
    meshset, suffix = loaded.meshset, target.suffix.lower().removeprefix(".")
    for name in meshset.current_mesh().textures():
        if not safe_name(name):
            msg = f"{target.name} can't be written: {name} is no name for a texture beside it."
            raise InvalidMeshError(msg)
    mesh = meshset.current_mesh()
    if suffix == "ctm" and mesh.has_vertex_scalar() and not mesh.has_vertex_color():
        msg = (
            f"{target.name} can't be written: MeshLab crashes when it reads CTM files with quality "
            "and no colours; write PLY."
        )
        raise InvalidMeshError(msg)
    custom = [name for name in meshset.filter_parameter_values(suffix) if name.startswith("__ca_")]
    written = target.absolute().with_name(plain_name(target.name))
    try:
        meshset.save_current_mesh(str(written), **dict.fromkeys(custom, True))
    except pymeshlab.PyMeshLabException as error:
        msg = (
            f"{target.name} can't be written ({meshlab_reason(error)}); check the free space and "
            "the format."
        )
        raise InvalidMeshError(msg) from error
    for name, image in loaded.textures.items():  # MeshLab encoded them anew
        _copy(image, target.absolute().parent / name)
    for name, data in loaded.images.items():
        target.absolute().with_name(name).write_bytes(data)
    read_back, lost = _check_whole(written, meshset.current_mesh())
    lost += _write_marks(written, target, meshset.current_mesh(), read_back.current_mesh())
    written.replace(target)
    return lost


def copy_mesh(loaded: LoadedMesh, target: Path) -> tuple[str, ...]:
    """Give an unchanged mesh another name: the same bytes when the format and its textures stay.

    Parameters
    ----------
    loaded : LoadedMesh
    target : Path

    Returns
    -------
    tuple of str
        As `save_mesh`.

    Raises
    ------
    InvalidMeshError, OSError
        As `save_mesh`.
    """
    if target.suffix.lower() != loaded.path.suffix.lower() or not loaded.verbatim:
        return save_mesh(loaded, target)
    shutil.copyfile(loaded.path, target)
    folder = target.absolute().parent
    for name, image in loaded.textures.items():
        _copy(image, folder / name)
    for name, text in loaded.materials.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8", errors="surrogateescape")
    mesh = loaded.meshset.current_mesh()
    return _write_marks(target, target, mesh, mesh)


def _write_marks(written: Path, target: Path, mesh: Any, read_back: Any) -> tuple[str, ...]:
    """Write the marks beside a file that has no place for them; say what it lost of them."""
    marks = None if target.suffix.lower() == ".ply" else marks_of(mesh)
    if marks is None or not marks.any:
        return ()
    found = marks_as_read(marks, mesh, read_back)
    if found is None:
        suffix = target.suffix[1:].upper()
        return (f"The {suffix} file doesn't tell what was filled; write PLY to keep the marks.",)
    write_marks(marks_path(target), found, mesh=written, name=target.name)
    return ()


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


def _check_whole(target: Path, mesh: Any) -> tuple[Any, tuple[str, ...]]:
    """Read a written file back: a full disk can cut it short without an error.

    Returns
    -------
    pymeshlab.MeshSet
        What was read.
    tuple of str
        Sentences on what the format lost of the texture.
    """
    meshset: Any = None
    lost: tuple[str, ...] = ()
    try:
        meshset, log = read(target)
        dropped = sum(int(faces) for _, faces in DROPPED.findall(log))
        found = meshset.current_mesh().face_number() + dropped
        exact = target.suffix.lower() in _EXACT_SUFFIXES
        whole = found == mesh.face_number() if exact else found > 0
        lost = _lost_texture(target, mesh, meshset.current_mesh())
    except pymeshlab.PyMeshLabException:
        whole = False
    if not whole:
        msg = f"{target.name} was not written whole; check the free space and the format."
        raise InvalidMeshError(msg)
    return meshset, lost


def _lost_texture(target: Path, before: Any, after: Any) -> tuple[str, ...]:
    """Say what a format didn't take of the texture, and what to do."""
    suffix = target.suffix[1:].upper()
    if not _has_coordinates(before):
        return ()
    if not _has_coordinates(after):
        return (f"The {suffix} file has lost the texture coordinates; write PLY to keep them.",)
    if before.texture_number() and not after.texture_number():
        return (f"The {suffix} file no longer names its texture image; write PLY to keep it.",)
    return ()


def _has_coordinates(mesh: Any) -> bool:
    return bool(mesh.has_wedge_tex_coord() or mesh.has_vertex_tex_coord())
