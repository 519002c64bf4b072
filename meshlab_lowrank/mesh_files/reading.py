"""Reading mesh files through pymeshlab, with the checks that its loaders leave out."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import InvalidMeshError, InvalidParameterError
from meshlab_lowrank.mesh_files import companions
from meshlab_lowrank.mesh_files.damage import refuse_damaged
from meshlab_lowrank.mesh_files.formats import READ_SUFFIXES, check_suffix
from meshlab_lowrank.mesh_files.marks import INPAINT_ERROR, INPAINT_TRUST, INPAINTED, holds_marks
from meshlab_lowrank.mesh_files.meshlab_output import captured_output, meshlab_reason
from meshlab_lowrank.mesh_files.names import kind_of
from meshlab_lowrank.mesh_files.ply_header import PlyHeader
from meshlab_lowrank.mesh_files.staging import LEFT_OUT, staged

_PLY_PROPERTY = re.compile(  # of vertices and faces, as far as MeshLab reads them
    "n?[xyz]|(diffuse_)?(red|green|blue)|alpha|intensity|quality|confidence|radius|flags|[stuv]|"
    "texture_[uvw]|texnumber|texcoord|vertex_ind(ex|ices)"
)
DROPPED = re.compile(r"(\d+) vertices with NAN coords and (\d+) degenerated faces")
_LOADER_ERRORS = (pymeshlab.PyMeshLabException, ArithmeticError, LookupError, ValueError)
_LOST_TEXTURE = re.compile(r"Failed loading (.+?); using a dummy texture")


@dataclass(frozen=True)
class LoadedMesh:
    """A mesh file in memory.

    Attributes
    ----------
    meshset : pymeshlab.MeshSet
        Holds one mesh, silent.
    path : Path
    textures : dict of str to Path
        Texture files by the names that the mesh gives them, relative to its folder.
    images : dict of str to bytes
        Textures that stand in the file itself, by the names that the mesh gives them.
    materials : dict of str to str
        Text of its material libraries by their names.
    verbatim : bool
        Whether the file itself names both so, and may be copied as it stands.
    notes : tuple of str
        Sentences on what the loader changed.
    """

    meshset: Any
    path: Path
    textures: dict[str, Path] = field(default_factory=dict)
    images: dict[str, bytes] = field(default_factory=dict)
    materials: dict[str, str] = field(default_factory=dict)
    verbatim: bool = True
    notes: tuple[str, ...] = field(default=())


def load_mesh(path: Path, *, scratch: Path | None = None, target: Path | None = None) -> LoadedMesh:
    """Read a mesh file.

    Parameters
    ----------
    path : Path
    scratch : Path or None
        Folder for what is needed while the file is read; None: that of temporary files.
    target : Path or None
        The mesh that will be made of it: textures that would change what lies beside that get
        another name.

    Returns
    -------
    LoadedMesh

    Raises
    ------
    InvalidParameterError
        If there is no such file or pymeshlab has no reader for its format.
    InvalidMeshError
        If the file can't be read, has no faces, has coordinates that are not finite or faces that
        name missing vertices, or names something beside it that must not be opened.
    """
    check_readable(path)
    refuse_damaged(path)
    with staged(path, scratch, target) as stage:
        companions.fill(stage)
        try:
            meshset, log = read(stage.path)
        except _LOADER_ERRORS as error:
            reason = meshlab_reason(error).replace(str(stage.folder), str(path.parent))
            msg = f"{path.name} can't be read ({reason}); check that the file is whole."
            raise InvalidMeshError(msg) from error
    notes = (*stage.notes, *_notes(path, log, meshset))
    mesh = meshset.current_mesh()
    if mesh.face_number() == 0:
        msg = f"{path.name} has no faces; give a triangle mesh, not a point cloud."
        raise InvalidMeshError(msg)
    return LoadedMesh(
        meshset,
        path,
        textures={name: stage.textures[name] for name in mesh.textures() if name in stage.textures},
        images={name: stage.images[name] for name in mesh.textures() if name in stage.images},
        materials=stage.materials,
        verbatim=stage.verbatim,
        notes=notes,
    )


def check_readable(path: Path) -> None:
    """Refuse a path that is no file or has a format that pymeshlab can't read."""
    try:
        kind = kind_of(path)
    except (FileNotFoundError, NotADirectoryError, ValueError) as error:  # ValueError: a null byte
        msg = f"There is no file {path}; check the name."
        raise InvalidParameterError(msg) from error
    except OSError as error:
        msg = f"{path} can't be read ({error.strerror}); give one mesh file."
        raise InvalidParameterError(msg) from error
    if kind:
        msg = f"{path} is {kind} and not a file; give one mesh file."
        raise InvalidParameterError(msg)
    check_suffix(path, READ_SUFFIXES, "read")


def read(path: Path) -> tuple[Any, str]:
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
    for vertices, faces in DROPPED.findall(log):
        if int(vertices):
            msg = (
                f"{path.name} has {vertices} vertices with coordinates that aren't finite; "
                "delete them or export the mesh again."
            )
            raise InvalidMeshError(msg)
        notes.append(f"The loader dropped {faces} faces that name a vertex twice.")
    if unread := _unread_properties(path):
        notes.append(f"MeshLab doesn't read {', '.join(unread)}, so what it writes goes without.")
    lost = (name for name in _LOST_TEXTURE.findall(log) if not name.startswith(LEFT_OUT))
    notes += [
        f"The texture {name} can't be read; put the image beside the mesh and run again."
        for name in lost
    ]
    if meshset.mesh_number() > 1:
        notes.append(f"The {meshset.mesh_number()} layers of the file were merged into one mesh.")
        meshset.generate_by_merging_visible_meshes(
            mergevisible=True, deletelayer=True, mergevertices=False, alsounreferenced=True
        )
    elif not np.array_equal(meshset.current_mesh().transform_matrix(), np.eye(4)):
        notes.append("The positions are those in the scene: the transform of the mesh was applied.")
        meshset.apply_matrix_freeze()
    return tuple(notes)


def _unread_properties(path: Path) -> list[str]:
    """Name the properties of vertices and faces in a PLY file that the loader passes over."""
    if path.suffix.lower() != ".ply":
        return []
    elements = PlyHeader.read(path).elements
    names = (n for item in elements if item.name in ("vertex", "face") for n in item.properties)
    ours = (INPAINTED, INPAINT_TRUST, INPAINT_ERROR) if holds_marks(path) else ()  # see take_marks
    return [n for n in dict.fromkeys(names) if n not in ours and not _PLY_PROPERTY.fullmatch(n)]
