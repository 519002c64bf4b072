"""Hostile files of the formats that hold whole scenes; see `hostile_files`.

``python -m tests.hostile_scenes FOLDER`` writes them.
"""

from __future__ import annotations

import base64
import json
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np

from tests.hostile_files import (
    DEVICE,
    FACES,
    FILLED,
    PIPE,
    REFUSED,
    VERTICES,
    Hostile,
    make_companions,
)

DATA = np.array(VERTICES, np.float32).tobytes() + np.array(FACES, np.uint16).tobytes()
CRASHED = "crashed"
NOT_OPENED, ENTITIES = "is not opened", "declares entities"
BASE64 = "data:application/octet-stream;base64,"


def scene(*, buffer: str | None = None, image: str | None = None, **changes: Any) -> dict[str, Any]:
    """Give the JSON of a glTF file whose buffer and image have these names."""
    size = 12 * len(VERTICES)
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": size}]
    views += [{"buffer": 0, "byteOffset": size, "byteLength": len(DATA) - size}]
    corner = {"min": [-1, -1, -1], "max": [1, 1, 1]}
    rows = {"bufferView": 0, "componentType": 5126, "count": len(VERTICES), "type": "VEC3"}
    indices = {"bufferView": 1, "componentType": 5123, "count": 3 * len(FACES), "type": "SCALAR"}
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(DATA)} | ({"uri": buffer} if buffer else {})],
        "bufferViews": views,
        "accessors": [rows | corner, indices],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    if image is not None:
        document |= {"images": [{"uri": image}], "textures": [{"source": 0}]}
        colour = {"baseColorTexture": {"index": 0}}
        document["materials"] = [{"pbrMetallicRoughness": colour}]
    return document | changes


def gltf(buffer: str = BASE64 + base64.b64encode(DATA).decode(), **changes: Any) -> bytes:
    return json.dumps(scene(buffer=buffer, **changes)).encode()


def glb(text: bytes | None = None, *, length: int | None = None) -> bytes:
    text = json.dumps(scene()).encode() if text is None else text
    text += b" " * (-len(text) % 4)
    data = DATA + b"\0" * (-len(DATA) % 4)
    chunks = struct.pack("<I4s", len(text) if length is None else length, b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def x3d(before: str = "", inside: str = "", header: str = "") -> bytes:
    points = " ".join(str(value) for row in VERTICES for value in row)
    corners = " -1 ".join(" ".join(map(str, face)) for face in FACES) + " -1"
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>{before}<X3D>{header}<Scene>{inside}<Shape>'
        f'<IndexedFaceSet coordIndex="{corners}"><Coordinate point="{points}"/></IndexedFaceSet>'
        "</Shape></Scene></X3D>"
    ).encode()


def wrl(before: str = "") -> bytes:
    points = ", ".join(" ".join(map(str, row)) for row in VERTICES)
    corners = ", -1, ".join(", ".join(map(str, face)) for face in FACES) + ", -1"
    return (
        f"#VRML V2.0 utf8\n{before}\nShape {{ geometry IndexedFaceSet {{ coord Coordinate "
        f"{{ point [ {points} ] }} coordIndex [ {corners} ] }} }}\n"
    ).encode()


def dae(before: str = "", image: str = "good.png") -> bytes:
    points = " ".join(str(value) for row in VERTICES for value in row)
    corners = " ".join(str(i) for face in FACES for i in face)
    return (
        f'<?xml version="1.0" encoding="utf-8"?>{before}<COLLADA '
        'xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f'<library_images><image id="t"><init_from>{image}</init_from></image></library_images>'
        '<library_geometries><geometry id="g"><mesh><source id="p">'
        f'<float_array id="a" count="{3 * len(VERTICES)}">{points}</float_array>'
        f'<technique_common><accessor count="{len(VERTICES)}" source="#a" stride="3">'
        '<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>'
        '</accessor></technique_common></source><vertices id="v">'
        '<input semantic="POSITION" source="#p"/></vertices>'
        f'<triangles count="{len(FACES)}"><input offset="0" semantic="VERTEX" source="#v"/>'
        f"<p>{corners}</p></triangles></mesh></geometry></library_geometries>"
        '<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/>'
        '</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/>'
        "</scene></COLLADA>"
    ).encode()


BOMB = '<!DOCTYPE x [<!ENTITY a "haha">' + "".join(
    f'<!ENTITY {after} "{f"&{before};" * 10}">'
    for before, after in zip("abcdefghi", "bcdefghij", strict=True)
)
BOMB += "]>"
OUTER = '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
NOISE = np.random.default_rng(1).bytes(3000)

SCENES = (
    Hostile("gl/good.gltf", gltf(), FILLED),
    Hostile("gl/good.glb", glb(), FILLED),
    Hostile("gl/image.gltf", gltf(image="good.png"), FILLED),
    Hostile("gl/pipe.gltf", gltf("pipe.bin"), REFUSED, PIPE),
    Hostile("gl/pipe_escaped.gltf", gltf("pipe%2Ebin"), REFUSED, PIPE),
    Hostile("gl/device.gltf", gltf("/dev/zero"), REFUSED, DEVICE),
    Hostile("gl/up.gltf", gltf("../../outside.png"), REFUSED, NOT_OPENED),
    Hostile("gl/up_escaped.gltf", gltf("%2e%2e/%2e%2e/outside.png"), REFUSED, NOT_OPENED),
    Hostile("gl/missing.gltf", gltf("nowhere.bin"), REFUSED, "can't be read"),
    Hostile("gl/image_up.gltf", gltf(image="../../outside.png"), REFUSED, NOT_OPENED),
    Hostile("gl/image_pipe.gltf", gltf(image="pipe.png"), REFUSED, PIPE),
    Hostile("gl/image_lock.gltf", gltf(image=".manifest.lock"), REFUSED, NOT_OPENED),
    Hostile("gl/deep.gltf", b"[" * 100_000, REFUSED, "can't be read"),
    Hostile(
        "gl/twice.gltf",
        gltf().replace(b'"uri"', b'"uri": "/dev/zero", "uri"', 1),
        REFUSED,
        "JSON is damaged",
    ),
    Hostile("gl/after.gltf", gltf("/dev/zero") + b" x", REFUSED, "JSON is damaged"),
    Hostile("gl/padded.glb", glb(json.dumps(scene()).encode() + b"\0\0\0\0"), FILLED),
    Hostile("gl/null.gltf", b"null", REFUSED, "can't be read"),
    Hostile("gl/lists.gltf", b'{"buffers": 3, "images": [[], null]}', REFUSED, "can't be read"),
    Hostile("gl/cut.glb", glb()[:-100], REFUSED, "can't be read"),
    Hostile("gl/length.glb", glb(length=0xFFFFFFF0), REFUSED, "can't be read"),
    Hostile("gl/empty.glb", b"", REFUSED, "can't be read"),
    Hostile("x3d/good.x3d", x3d(), FILLED),
    Hostile("x3d/bomb.x3d", x3d(BOMB, "&j;"), REFUSED, ENTITIES),
    Hostile("x3d/outer.x3d", x3d(OUTER, "&a;"), REFUSED, ENTITIES),
    Hostile("x3d/inline.x3d", x3d(inside='<Inline url="good.x3d"/>'), REFUSED, "other files"),
    Hostile("x3d/device.x3d", x3d(inside='<ImageTexture url="/dev/zero"/>'), REFUSED, DEVICE),
    Hostile("x3d/cut.x3d", x3d()[:-40], REFUSED, "can't be read"),
    Hostile("x3d/empty.x3d", b"", REFUSED, "can't be read"),
    Hostile("wrl/good.wrl", wrl(), FILLED),
    Hostile("wrl/inline.wrl", wrl('Inline { url "good.wrl" }'), REFUSED, "other files"),
    Hostile("wrl/noise.wrl", b"#VRML V2.0 utf8\n" + NOISE, REFUSED, ""),
    Hostile("dae/good.dae", dae(), FILLED),
    Hostile("dae/bomb.dae", dae(BOMB, "&j;"), REFUSED, ENTITIES),
    Hostile("dae/outer.dae", dae(OUTER, "&a;"), REFUSED, ENTITIES),
    Hostile("dae/device.dae", dae(image="/dev/zero"), REFUSED, DEVICE),
    Hostile("dae/coded.dae", dae(image="&#47;dev&#x2f;zero"), REFUSED, DEVICE),
    Hostile("dae/url.dae", dae(image="file:///dev/zero"), REFUSED, DEVICE),
    Hostile("dae/up.dae", dae(image="a/../../outside.png"), REFUSED, NOT_OPENED),
    Hostile("dae/pipe.dae", dae(image="pipe.png"), REFUSED, PIPE),
    Hostile("dae/cut.dae", dae()[:-300], REFUSED, "can't be read"),
    *(
        Hostile(f"noise/noise{suffix}", NOISE, REFUSED, "")
        for suffix in (".3ds", ".3mf", ".ctm", ".glb", ".x3dv")
    ),
    Hostile("noise/noise.fbx", NOISE, CRASHED, "process died"),
    Hostile("noise/cut.3mf", b"PK\3\4" + NOISE, REFUSED, ""),
    Hostile("noise/cut.ctm", b"OCTM\5\0\0\0RAW\0\xff\xff\xff\x7f\xff\xff\xff\x7f", REFUSED, ""),
)


def make_all(folder: Path) -> None:
    """Write them and what they name, in each of their folders."""
    for item in SCENES:
        item.make(folder)
    for below in ("gl", "dae"):
        make_companions(folder / below)


if __name__ == "__main__":
    make_all(Path(sys.argv[1]))
