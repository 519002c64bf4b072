"""glTF files: what they name, and the images that they hold."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh_files.names import find_companion, find_image, refuse_name, safe_name
from meshlab_lowrank.mesh_files.staging import Stage

_MAGIC = b"glTF"
_START = 20  # bytes before the JSON of a binary file
_CHUNK = 8  # bytes before the data of a chunk
_IMAGES = {b"\x89PNG\r\n\x1a\n": ".png", b"\xff\xd8\xff": ".jpg"}


def fill_gltf(stage: Stage) -> None:
    """Put a glTF file into a stage; images inside it become files beside it.

    MeshLab gives images inside a file names that it can't write again.

    Raises
    ------
    InvalidMeshError
        If its JSON is damaged, or it names something that must not be opened.
    """
    data = stage.source.read_bytes()
    document, rest = _parsed(stage.source, data)
    for kind in ("buffers", "images"):
        for item in _items(document, kind):
            uri = item.get("uri", "")
            if isinstance(uri, str) and uri and not uri.startswith("data:"):
                _stage_uri(stage, uri, is_image=kind == "images")
    inside = [(n, i) for n, i in enumerate(_items(document, "images")) if _is_inside(i)]
    if not inside:
        stage.link_source()
        return
    for number, item in inside:
        image = _embedded(stage, document, item, rest[_CHUNK:])
        suffix = next((s for start, s in _IMAGES.items() if image.startswith(start)), "")
        for key in ("bufferView", "mimeType"):
            item.pop(key, None)
        item["uri"] = stage.embedded(image, number, suffix) if suffix else stage.left_out()
        if not suffix:
            stage.notes.append(
                f"Image {number} of the file is left out, since it is neither PNG nor JPEG."
            )
    stage.path.write_bytes(_written(document, rest, binary=data.startswith(_MAGIC)))


def _items(document: Any, kind: str) -> list[dict[str, Any]]:
    """Give the objects of a list; none if there is something else, which the loader refuses."""
    items = document.get(kind) if isinstance(document, dict) else None
    whole = isinstance(items, list) and all(isinstance(item, dict) for item in items)
    return items if isinstance(items, list) and whole else []


def _parsed(path: Path, data: bytes) -> tuple[Any, bytes]:
    """Parse the JSON of a file, and give what follows; what can't be checked is not opened."""
    text, rest = data, b""
    try:
        if data.startswith(_MAGIC):
            (length,) = struct.unpack_from("<I", data, _START - _CHUNK)
            text, rest = data[_START : _START + length], data[_START + length :]
        return json.loads(text.rstrip(b"\0"), object_pairs_hook=_object), rest
    except (ValueError, struct.error, RecursionError) as error:
        msg = f"{path.name} can't be read: its JSON is damaged."
        raise InvalidMeshError(msg) from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Refuse names that stand twice, of which a loader may take another than we."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError
    return found


def _written(document: Any, rest: bytes, *, binary: bool) -> bytes:
    text = json.dumps(document).encode()
    if not binary:
        return text
    text += b" " * (-len(text) % 4)
    size = _START + len(text) + len(rest)
    return struct.pack("<4sIII4s", _MAGIC, 2, size, len(text), b"JSON") + text + rest


def _stage_uri(stage: Stage, uri: str, *, is_image: bool) -> None:
    for name in dict.fromkeys((uri, unquote(uri, errors="surrogateescape"))):
        found = (find_image if is_image else find_companion)(stage.source, name)
        wanted = safe_name(name)
        if not wanted:
            refuse_name(stage.source, name)
        if found:
            stage.link(found, wanted)
            if is_image:
                stage.textures[wanted] = found


def _is_inside(image: dict[str, Any]) -> bool:
    uri = image.get("uri", "")
    return "bufferView" in image if not uri else isinstance(uri, str) and uri.startswith("data:")


def _embedded(stage: Stage, document: Any, image: dict[str, Any], chunk: bytes) -> bytes:
    """Give the bytes of an image inside a file; none if they aren't there."""
    if image.get("uri"):
        return _data_of(image["uri"])
    try:
        view = _items(document, "bufferViews")[image["bufferView"]]
        buffer = _items(document, "buffers")[view["buffer"]]
        start, length = view.get("byteOffset", 0), view["byteLength"]
        if min(image["bufferView"], view["buffer"], start, length) < 0:
            return b""
        return _buffer(stage, buffer.get("uri", ""), chunk)[start : start + length]
    except (AttributeError, LookupError, TypeError):
        return b""


def _buffer(stage: Stage, uri: str, chunk: bytes) -> bytes:
    if not uri:
        return chunk
    if uri.startswith("data:"):
        return _data_of(uri)
    found = find_companion(stage.source, unquote(uri, errors="surrogateescape"))
    return found.read_bytes() if found else b""


def _data_of(uri: str) -> bytes:
    header, _, text = uri.partition(",")
    if not header.endswith(";base64"):
        return unquote_to_bytes(text)
    try:
        return base64.b64decode(text)
    except binascii.Error:
        return b""
