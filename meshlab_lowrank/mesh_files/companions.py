"""What the formats of mesh files name, checked before MeshLab opens it."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh_files.materials import rewritten
from meshlab_lowrank.mesh_files.name_search import image_names, paths_away
from meshlab_lowrank.mesh_files.names import (
    as_path,
    find_companion,
    find_image,
    kind_of,
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
        ".glb": _fill_gltf,
        ".gltf": _fill_gltf,
        ".3mf": _link,
        ".obj": _fill_obj,
        ".off": _link,
        ".ply": _fill_ply,
        ".stl": _link,
    }
    formats.get(stage.source.suffix.lower(), _fill_any)(stage)


def _link(stage: Stage) -> None:
    stage.link(stage.source, stage.path.name)


def _fill_obj(stage: Stage) -> None:
    """Put all material libraries into one that is written here."""
    with stage.source.open("rb") as file:
        named = dict.fromkeys(map(library_of, obj_lines(file)))
    named.pop(None, None)
    if not named:
        _link(stage)
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
        _link(stage)
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


def _fill_gltf(stage: Stage) -> None:
    _link(stage)
    document = _gltf_document(stage.source)
    for kind in ("buffers", "images"):
        items = document.get(kind, ()) if isinstance(document, dict) else ()
        for item in items if isinstance(items, list) else ():
            uri = item.get("uri", "") if isinstance(item, dict) else ""
            if isinstance(uri, str) and uri and not uri.startswith("data:"):
                _stage_uri(stage, uri, is_image=kind == "images")


def _gltf_document(path: Path) -> Any:
    """Parse the JSON of a glTF file; what can't be checked is not opened."""
    text = path.read_bytes()
    try:
        if text[:4] == b"glTF":
            (length,) = struct.unpack_from("<I", text, 12)
            text = text[20 : 20 + length]
        return json.loads(text.rstrip(b"\0"), object_pairs_hook=_object)
    except (ValueError, struct.error, RecursionError) as error:
        msg = f"{path.name} can't be read: its JSON is damaged."
        raise InvalidMeshError(msg) from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Refuse names that stand twice, of which a loader may take another than we."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError
    return found


def _stage_uri(stage: Stage, uri: str, *, is_image: bool) -> None:
    for name in dict.fromkeys((uri, unquote(uri, errors="surrogateescape"))):
        found = (find_image if is_image else find_companion)(stage.source, name)
        wanted = safe_name(name)
        if not wanted:
            _refuse(stage, name)
        if found:
            stage.link(found, wanted)
            if is_image:
                stage.textures[wanted] = found


def _fill_any(stage: Stage) -> None:
    """Look for names in a file of any format; only images below its folder are opened."""
    _link(stage)
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
            _refuse(stage, name)
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


def _refuse(stage: Stage, name: str) -> NoReturn:
    msg = (
        f"{stage.source.name} names {name}, which is not opened; only images and buffers that lie "
        "in the folder of the mesh or below are."
    )
    raise InvalidMeshError(msg)
