import os
import struct
import zlib
from pathlib import Path

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.errors import InvalidMeshError, InvalidParameterError
from meshlab_lowrank.mesh_files import (
    WRITE_SUFFIXES,
    captured_output,
    check_writable,
    copy_mesh,
    load_mesh,
    save_mesh,
)

FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])

PLY_HEADER = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
"""


def points(kind: type = np.float64) -> np.ndarray:
    return (1e3 * np.random.default_rng(0).standard_normal((4, 3))).astype(kind)


def write(path: Path, vertices: np.ndarray) -> Path:
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.add_mesh(pymeshlab.Mesh(vertices.astype(float), FACES))
    meshset.save_current_mesh(str(path))
    return path


def positions(path: Path) -> np.ndarray:
    loaded = load_mesh(path)  # the mesh lives no longer than its set
    return loaded.meshset.current_mesh().vertex_matrix()


def face_number(path: Path) -> int:
    loaded = load_mesh(path)
    return loaded.meshset.current_mesh().face_number()


def write_textured(folder: Path) -> Path:
    (folder / "images").mkdir(parents=True)
    (folder / "a.mtl").write_text("newmtl m\nmap_Kd images/t.png\n")
    lines = [f"v {x} {y} {z}" for x, y, z in points()] + ["vt 0 0", "vt 1 0", "vt 0 1"]
    faces = [f"f {a + 1}/1 {b + 1}/2 {c + 1}/3" for a, b, c in FACES]
    (folder / "a.obj").write_text("\n".join(["mtllib a.mtl", *lines, "usemtl m", *faces]))
    return folder / "a.obj"


def tiny_png() -> bytes:
    """Give a PNG of one red pixel, with trailing bytes that no encoder would write."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        check = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)

    header = struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0)
    pixels = chunk(b"IDAT", zlib.compress(b"\x00\xff\x00\x00"))
    start = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    return start + pixels + chunk(b"IEND", b"") + b"trailing"


def test_doubles_come_back_bit_for_bit_from_ply(tmp_path: Path) -> None:
    source = write(tmp_path / "a.ply", points())
    save_mesh(load_mesh(source), tmp_path / "b.ply")
    assert np.array_equal(positions(tmp_path / "b.ply"), points())


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off"])
def test_single_precision_input_comes_back_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    rows = "".join("{!r} {!r} {!r}\n".format(*map(float, row)) for row in points(np.float32))
    (tmp_path / "a.ply").write_text(PLY_HEADER + rows + "3 0 2 1\n3 0 1 3\n")
    target = tmp_path / f"b{suffix}"
    save_mesh(load_mesh(tmp_path / "a.ply"), target)
    assert np.array_equal(positions(target).astype(np.float32), points(np.float32))


@pytest.mark.parametrize("suffix", WRITE_SUFFIXES)
def test_every_format_that_is_written_is_read(tmp_path: Path, suffix: str) -> None:
    target = tmp_path / f"b{suffix}"
    check_writable(target)
    save_mesh(load_mesh(write(tmp_path / "a.ply", points())), target)
    assert face_number(target) == 4


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_texture_files_go_along_unchanged(tmp_path: Path, suffix: str) -> None:
    source = write_textured(tmp_path / "in")
    image = tiny_png()
    (tmp_path / "in" / "images" / "t.png").write_bytes(image)
    (tmp_path / "out").mkdir()
    loaded = load_mesh(source)
    assert list(loaded.textures) == ["images/t.png"]
    for write_to, name in ((save_mesh, "b"), (copy_mesh, "c")):
        write_to(loaded, tmp_path / "out" / f"{name}{suffix}")
        assert (tmp_path / "out" / "images" / "t.png").read_bytes() == image
        assert load_mesh(tmp_path / "out" / f"{name}{suffix}").textures.keys() == {"images/t.png"}


def test_custom_attributes_are_written_to_ply(tmp_path: Path) -> None:
    loaded = load_mesh(write(tmp_path / "a.ply", points()))
    mesh = loaded.meshset.current_mesh()
    mesh.add_vertex_custom_scalar_attribute(np.arange(4.0), "Mark")
    mesh.add_face_custom_scalar_attribute(np.arange(4.0), "Mark")
    for name in ("b.ply", "b.obj"):
        save_mesh(loaded, tmp_path / name)
    header = (tmp_path / "b.ply").read_bytes().partition(b"end_header")[0]
    assert header.count(b"property double Mark") == 2


def test_a_lost_texture_is_noted(tmp_path: Path) -> None:
    notes = load_mesh(write_textured(tmp_path / "in")).notes
    assert notes == (
        "The texture images/t.png can't be read; put the image beside the mesh and run again.",
    )


def test_properties_that_are_not_read_are_noted(tmp_path: Path) -> None:
    more = "float z\nproperty float quality\nproperty int label\n"
    header = PLY_HEADER.replace("float z\n", more)
    rows = "".join(f"{i} {i * i} 0 1 2\n" for i in range(4))
    (tmp_path / "a.ply").write_text(header + rows + "3 0 1 2\n3 0 2 3\n")
    assert load_mesh(tmp_path / "a.ply").notes == (
        "MeshLab doesn't read label, so what it writes goes without.",
    )


def test_an_unchanged_mesh_is_copied_byte_for_byte(tmp_path: Path) -> None:
    source = tmp_path / "a.off"
    source.write_text("OFF\n# by hand\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    copy_mesh(load_mesh(source), tmp_path / "b.off")
    assert (tmp_path / "b.off").read_bytes() == source.read_bytes()


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("nan.ply", PLY_HEADER + "0 0 0\n1 0 nan\n0 1 0\n1 1 0\n3 0 1 2\n3 2 1 3\n", "1 vertices"),
        ("inf.obj", "v 0 0 0\nv inf 0 0\nv 0 1 0\nv 1 1 1\nf 1 3 4\n", "1 vertices"),
        ("range.ply", PLY_HEADER + "0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 2 1 9\n", "index"),
        ("range.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "number 8 of 3"),
        ("inline.off", "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "number 4 of 3"),
        ("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 9\n", "number 9 of 3"),
        ("negative.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -3\nf -1 -2 -4\n", "number 4 of 3"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n", "no faces"),
        ("empty.ply", "", "can't be read"),
        ("words.stl", "these are words", "can't be read"),
        ("words.off", "these are words", "can't be read"),
    ],
)
def test_bad_files_are_refused_in_one_sentence(
    tmp_path: Path, name: str, text: str, reason: str
) -> None:
    (tmp_path / name).write_text(text)
    here = Path.cwd()
    with pytest.raises(InvalidMeshError, match=reason) as caught:
        load_mesh(tmp_path / name)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)
    assert Path.cwd() == here


def test_wrong_paths_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "nothing.ply", tmp_path, tmp_path / "a.foo"):
        with pytest.raises(InvalidParameterError):
            load_mesh(path)
    for path in (tmp_path / "nowhere" / "a.ply", tmp_path, tmp_path / "a.foo", tmp_path / "a"):
        with pytest.raises(InvalidParameterError):
            check_writable(path)


def test_polygons_and_good_indices_pass(tmp_path: Path) -> None:
    (tmp_path / "quads.off").write_text(
        "OFF\n# between\n4 1 0\n\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
    )
    assert face_number(tmp_path / "quads.off") == 2
    (tmp_path / "quads.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    assert face_number(tmp_path / "quads.obj") == 2


def test_output_of_compiled_code_is_captured() -> None:
    with captured_output() as log:
        os.write(1, b"one ")
        os.write(2, b"two")
    assert log == ["one two"]
    with captured_output() as log:
        pymeshlab.MeshSet(verbose=True).create_cube()
    assert log[0]
