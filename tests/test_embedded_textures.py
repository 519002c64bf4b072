"""Scenes that MeshLab only reads, and the images inside them."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.folders import batch
from meshlab_lowrank.folders.plan import output_names
from meshlab_lowrank.mesh_files import load_mesh, save_mesh
from tests.hostile_files import VERTICES
from tests.hostile_scenes import BASE64, DATA, scene
from tests.test_mesh_files import tiny_png


def coordinates() -> bytes:
    return np.linspace(0.0, 1.0, 2 * len(VERTICES), dtype=np.float32).tobytes()


def textured_scene(*images: dict[str, Any], data: bytes, **changes: Any) -> dict[str, Any]:
    """Give a scene whose faces have the first image; the data ends in what the view 3 shows."""
    document = scene(**changes)
    start, end = len(DATA), len(DATA) + len(coordinates())
    document["buffers"][0]["byteLength"] = len(data)
    document["bufferViews"] += [
        {"buffer": 0, "byteOffset": start, "byteLength": end - start},
        {"buffer": 0, "byteOffset": end, "byteLength": len(data) - end},
    ]
    corners = {"bufferView": 2, "componentType": 5126, "count": len(VERTICES), "type": "VEC2"}
    document["accessors"].append(corners)
    document["images"] = list(images)
    document["textures"] = [{"source": 0}]
    document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    primitive = document["meshes"][0]["primitives"][0]
    primitive["attributes"]["TEXCOORD_0"] = 2
    primitive["material"] = 0
    document["nodes"][0]["scale"] = [2.0, 2.0, 2.0]
    return document


def write_glb(path: Path, image: bytes, *, view: int = 3) -> Path:
    data = DATA + coordinates() + image
    inside = {"bufferView": view, "mimeType": "image/png"}
    text = json.dumps(textured_scene(inside, data=data)).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def write_gltf(path: Path, *images: dict[str, Any], tail: bytes = b"", buffer: str = "") -> Path:
    data = DATA + coordinates() + tail
    if buffer:
        (path.parent / buffer).write_bytes(data)
    uri = buffer or BASE64 + base64.b64encode(data).decode()
    path.write_text(json.dumps(textured_scene(*images, data=data, buffer=uri)))
    return path


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    folder = tmp_path / "scans"
    folder.mkdir()
    return folder


def test_a_scene_becomes_ply_with_its_image_beside(scans: Path, tmp_path: Path) -> None:
    write_glb(scans / "a.glb", tiny_png())
    out = tmp_path / "out"
    result = batch(scans, out, parameters={"detail": "none"}, pictures=False)
    (record,) = result.records
    assert (record.status, record.output) == ("done", "a.ply")
    assert record.notes[0] == (
        "MeshLab can't write .glb, so the output is PLY; --format chooses another."
    )
    assert record.notes[0] in result.notes
    assert files(out) == {"a.ply", "a_texture0.png", "manifest.jsonl", "summary.html"}
    assert (out / "a_texture0.png").read_bytes() == tiny_png()
    ms = pymeshlab.MeshSet(verbose=False)
    ms.load_new_mesh(str(out / "a.ply"))
    mesh = ms.current_mesh()
    assert list(mesh.textures()) == ["a_texture0.png"]
    known = mesh.vertex_matrix()[: len(VERTICES)]
    np.testing.assert_array_equal(known, 2.0 * np.float32(VERTICES).astype(np.float64))
    first = mesh.face_matrix()[0]
    corners = np.frombuffer(coordinates(), np.float32).reshape(-1, 2) * [1, -1] + [0, 1]
    np.testing.assert_allclose(mesh.wedge_tex_coord_matrix()[:3], corners[first], atol=1e-6)
    again = batch(scans, out, parameters={"detail": "none"}, pictures=False)
    assert again.counts == {"skipped": 1}


def test_the_format_still_decides(scans: Path, tmp_path: Path) -> None:
    write_glb(scans / "a.glb", tiny_png())
    out = tmp_path / "out"
    result = batch(scans, out, parameters={"detail": "none"}, suffix=".obj", pictures=False)
    assert result.records[0].output == "a.obj"
    assert result.notes == ()
    assert not any("can't write" in note for note in result.records[0].notes)
    assert (out / "a_texture0.png").read_bytes() == tiny_png()
    assert "map_Kd a_texture0.png" in (out / "a.obj.mtl").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["data URI", "view of a data URI", "view of a file"])
def test_images_inside_text_are_written_out(scans: Path, tmp_path: Path, kind: str) -> None:
    view = {"bufferView": 3, "mimeType": "image/png"}
    image = {"uri": "data:image/png;base64," + base64.b64encode(tiny_png()).decode()}
    path = scans / "a.gltf"
    if kind == "data URI":
        write_gltf(path, image)
    else:
        write_gltf(path, view, tail=tiny_png(), buffer="a.bin" if "file" in kind else "")
    save_mesh(load_mesh(path), tmp_path / "b.ply")
    assert (tmp_path / "a_texture0.png").read_bytes() == tiny_png()
    assert b"TextureFile a_texture0.png" in (tmp_path / "b.ply").read_bytes()[:300]


def test_images_get_names_that_are_free(scans: Path, tmp_path: Path) -> None:
    write_glb(scans / "a b.glb", tiny_png())
    out = tmp_path / "out"
    out.mkdir()
    (out / "a_b_texture0.png").write_bytes(b"something else")
    result = batch(scans, out, parameters={"detail": "none"}, pictures=False)
    assert result.records[0].status == "done"
    assert (out / "a_b_texture0.png").read_bytes() == b"something else"
    (image,) = out.glob("a_b_texture0_*.png")
    assert image.read_bytes() == tiny_png()


@pytest.mark.parametrize("view", [3, 99, -1])
def test_what_is_no_image_is_left_out(scans: Path, view: int) -> None:
    loaded = load_mesh(write_glb(scans / "a.glb", b"no image", view=view))
    (note,) = [note for note in loaded.notes if "left out" in note]
    assert note == "Image 0 of the file is left out, since it is neither PNG nor JPEG."
    assert loaded.images == {}


def test_two_inputs_never_get_one_name() -> None:
    inputs = [Path("a.glb"), Path("a.ply"), Path("b.GLTF"), Path("c.obj"), Path("d.x3dv")]
    outputs = ["a.glb.ply", "a.ply", "b.ply", "c.obj", "d.ply"]
    assert output_names(inputs, None) == [Path(name) for name in outputs]
    with pytest.raises(InvalidParameterError, match=r"2 inputs would be written to a\.glb\.ply"):
        output_names([Path("a.glb"), Path("a.ply"), Path("a.glb.ply")], None)
