"""What the formats of mesh files name, checked before MeshLab opens it."""

from __future__ import annotations

import html
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh_files.gltf import fill_gltf
from meshlab_lowrank.mesh_files.materials import rewritten
from meshlab_lowrank.mesh_files.name_search import image_names, paths_away
from meshlab_lowrank.mesh_files.names import (
    as_path,
    find_companion,
    find_image,
    kind_of,
    refuse_name,
    safe_name,
)
from meshlab_lowrank.mesh_files.obj_lines import library_of, obj_lines
from meshlab_lowrank.mesh_files.ply_header import PlyHeader
from meshlab_lowrank.mesh_files.staging import Stage

_LIBRARY = "materials.mtl"
_TEXTURE_COMMENT = re.compile(rb"\s*(?:comment|obj_info)\s+TextureFile\s*(.+)", re.IGNORECASE)
_INCLUDES = re.compile(rb"<\s*(?:Inline|ExternProtoDeclare)\b|\bInline\s*\{|\bEXTERNPROTO\b")
_SCENES = (".wrl", ".x3d", ".x3dv")
_XML = (".dae", ".x3d")


def fill(stage: Stage) -> None:
    """Put the source of a stage into its folder, and what it may open.

    Raises
    ------
    InvalidMeshError
        If it names something that isn't a regular file, or, in a format that is not written anew
        here, something outside its folder.
    """
    formats: dict[str, Callable[[Stage], None]] = {
        ".glb": fill_gltf,
        ".gltf": fill_gltf,
        ".3mf": Stage.link_source,
        ".obj": _fill_obj,
        ".off": Stage.link_source,
        ".ply": _fill_ply,
        ".stl": Stage.link_source,
    }
    formats.get(stage.source.suffix.lower(), _fill_any)(stage)


def _fill_obj(stage: Stage) -> None:
    """Put all material libraries into one that is written here."""
    with stage.source.open("rb") as file:
        named = dict.fromkeys(map(library_of, obj_lines(file)))
    named.pop(None, None)
    if not named:
        stage.link_source()
        return
    text = "".join(_library(stage, name) for name in named if name)
    (stage.folder / _LIBRARY).write_text(text, encoding="utf-8", errors="surrogateescape")
    with stage.source.open("rb") as file, stage.path.open("wb") as copy:
        if text:
            copy.write(f"mtllib {_LIBRARY}\n".encode())
        copy.writelines(line for line in obj_lines(file) if library_of(line) is None)


def _library(stage: Stage, name: str) -> str:
    path = find_companion(stage.source, name)
    if path is None:
        stage.verbatim &= bool(safe_name(name))
        stage.notes.append(f"The material library {name} can't be read.")
        return ""
    with path.open(encoding="utf-8", errors="surrogateescape") as file:
        text = rewritten(file, stage.texture)
    wanted = safe_name(name)
    others = wanted.lower().endswith(".obj.mtl") and wanted != f"{stage.source.name}.mtl"
    if wanted.lower().endswith(".mtl") and not others and stage.is_free_for(wanted, text):
        stage.materials[wanted] = text
    stage.verbatim &= as_path(name) in stage.materials
    return rewritten(text.splitlines(), options=False)


def _fill_ply(stage: Stage) -> None:
    header = PlyHeader.read(stage.source)
    lines = [_ply_line(stage, line) for line in header.lines]
    if lines == header.lines:
        stage.link_source()
        return
    with stage.source.open("rb") as file, stage.path.open("wb") as copy:
        file.seek(header.size)
        copy.writelines(lines)
        shutil.copyfileobj(file, copy)


def _ply_line(stage: Stage, line: bytes) -> bytes:
    match = _TEXTURE_COMMENT.fullmatch(line.rstrip())
    if not match:
        return line
    name = match[1].decode(errors="surrogateescape")
    chosen = stage.texture(name)
    return line if chosen == name else f"comment TextureFile {chosen}\n".encode()


def _fill_any(stage: Stage) -> None:
    """Look for names in a file of any format; only images below its folder are opened."""
    stage.link_source()
    suffix = stage.source.suffix.lower()
    data = stage.source.read_bytes()
    if suffix in _XML:
        data = _without_references(stage, data)
    if suffix in _SCENES and _INCLUDES.search(data):
        msg = f"{stage.source.name} takes parts of its scene from other files; export it as one."
        raise InvalidMeshError(msg)
    for name in paths_away(data):
        path = name[5:] if name[:5].lower() == "file:" else name
        path = os.path.normpath(path.replace("\\", "/"))  # as Qt does it
        path = f"/{path.lstrip('/')}" if path.startswith("/") else path
        places = (folder / path for folder in (stage.source.absolute().parent, stage.folder))
        if any(map(_is_there, places)) and find_image(stage.source, path) is None:
            refuse_name(stage.source, name)
    for name in image_names(data):
        image, wanted = find_image(stage.source, name), safe_name(name)
        if image and wanted:
            stage.textures[wanted] = image
            stage.link(image, wanted)


def _without_references(stage: Stage, data: bytes) -> bytes:
    """Give the text of an XML file with its characters as they are, none by their number."""
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    text = data.decode("utf-16" if wide else "utf-8", errors="replace")
    if "<!ENTITY" in text:
        msg = f"{stage.source.name} declares entities, which no mesh needs; export it again."
        raise InvalidMeshError(msg)
    return html.unescape(text).encode() if "&" in text else text.encode()


def _is_there(path: Path) -> bool:
    """Whether opening a path would open something."""
    try:
        return kind_of(path) != "a folder"
    except (OSError, ValueError):
        return False
