"""What mesh files name is opened only where that is harmless, and copied over nothing."""

import os
from pathlib import Path

import pytest

from meshlab_lowrank.errors import InvalidMeshError, InvalidParameterError
from meshlab_lowrank.folders import batch
from meshlab_lowrank.folders.file_run import publish
from meshlab_lowrank.mesh_files import copy_mesh, load_mesh, save_mesh
from meshlab_lowrank.mesh_files.materials import rewritten
from meshlab_lowrank.mesh_files.name_search import image_names, paths_away
from meshlab_lowrank.mesh_files.names import find_companion, find_image, safe_name
from tests.hostile_files import (
    WHOLE_FACES,
    WHOLE_VERTICES,
    make_companions,
    obj,
    png,
    textured,
    with_texture,
)

posix = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs POSIX")


def whole(library: str) -> bytes:
    return obj(library, vertices=WHOLE_VERTICES, faces=WHOLE_FACES)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "in"
    path.mkdir()
    make_companions(path)
    return path


def files(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize(
    "name",
    [
        *("", ".", "..", "../a.png", "a/../../b.png", "/a.png", "\\a.png", "C:\\a.png", "C:a.png"),
        *(".a.png", "a/.b/c.png", ".manifest.lock", "a\n.png", "a\0.png", "a\x1b[1m.png"),
        *("a\u202eb.png", "a\udcff.png", "x" * 300, "a.ply/b.png", "A.OBJ/b.png", " a.png"),
        *("manifest.jsonl/a.png", "a?.png", 'a".png'),
    ],
)
def test_names_that_no_output_may_have(name: str) -> None:
    assert safe_name(name) == ""


@pytest.mark.parametrize(
    ("name", "safe"),
    [
        ("t.png", "t.png"),
        ("./a b/ü.png", "a b/ü.png"),
        ("images\\t.png", "images/t.png"),
        ("v1.2/t.png", "v1.2/t.png"),
    ],
)
def test_names_that_outputs_may_have(name: str, safe: str) -> None:
    assert safe_name(name) == safe


@posix
def test_only_files_in_the_folder_are_found(folder: Path) -> None:
    mesh = folder / "a.obj"
    for name in ("good.png", "images\\good.png", '"good.png"', "images/../good.png"):
        assert find_image(mesh, name)
    assert find_image(mesh, str(folder / "good.png")) == (folder / "good.png").resolve()
    for name in ("../outside.png", "linked.png", "round.png", ".secret.png", ".hidden/t.png"):
        assert find_companion(mesh, name) is None
    for name in (str(folder.parent / "outside.png"), "nowhere.png", "a\0.png", "", "x" * 5000):
        assert find_companion(mesh, name) is None
    for name in ("text.png", "good.mtl", ".manifest.lock", "manifest.jsonl"):
        assert find_image(mesh, name) is None
    for name in ("pipe.png", "null.png", "zero.mtl", "socket.mtl", "images", ".", "/dev/zero"):
        with pytest.raises(InvalidMeshError, match=r"^a\.obj names .* no file; take .*\.$"):
            find_companion(mesh, name)


def test_materials_are_written_from_their_parameters() -> None:
    text = (
        "# planted\nnewmtl one two\nkd 1 0.5 0\nKs 1 nan 0\nKa inf 0 0\nd 0.25 rubbish\n"
        "illum\nmap_kd -s 1 2 -clamp on a b.png\nbump x.png\n#!/bin/sh\nrm -rf /\nnewmtl a\x1bb\n"
    )
    names = {"a b.png": "t.png", "x.png": ""}
    kept = "newmtl one two\nKd 1 0.5 0\nd 0.25\nmap_Kd -s 1 2 -clamp on t.png\n"
    assert rewritten(text.split("\n"), names.__getitem__) == kept
    assert "map_Kd t.png\n" in rewritten(kept.splitlines(), options=False)


@posix
def test_a_copied_mesh_takes_its_materials_and_images_along(folder: Path, tmp_path: Path) -> None:
    (folder / "a.obj").write_bytes(whole("mtllib good.mtl"))
    (folder / "good.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd good.png\n#!/bin/sh\n")
    out = tmp_path / "out"
    assert batch(folder, out, pictures=False).complete
    assert (out / "a.obj").read_bytes() == (folder / "a.obj").read_bytes()
    assert (out / "good.mtl").read_text(encoding="utf-8") == "newmtl m\nKd 1 1 1\nmap_Kd good.png\n"
    (folder / "b.obj").write_bytes(textured("mtllib good.mtl"))
    assert batch(folder, out, pictures=False, parameters={"detail": "none"}).complete
    assert (out / "good.png").read_bytes() == png()
    assert "map_Kd good.png" in (out / "b.obj.mtl").read_text(encoding="utf-8")


@posix
@pytest.mark.parametrize("library", ["a.obj.mtl", "./a.obj.mtl"])
def test_a_mesh_that_meshlab_wrote_is_copied_byte_for_byte(
    folder: Path, tmp_path: Path, library: str
) -> None:
    (folder / "a.obj").write_bytes(whole(f"mtllib {library}"))
    (folder / "a.obj.mtl").write_text("newmtl m\nmap_Kd ./good.png\n")
    out = tmp_path / "out"
    for colour in ("1 0 0", "0 1 0"):
        (folder / "a.obj.mtl").write_text(f"newmtl m\nKd {colour}\n")
        assert batch(folder, out, pictures=False).complete
        assert (out / "a.obj").read_bytes() == (folder / "a.obj").read_bytes()
        (out / "a.obj").unlink()


@posix
def test_a_material_library_that_is_there_already_stays(folder: Path, tmp_path: Path) -> None:
    (folder / "a.obj").write_bytes(whole("mtllib good.mtl"))
    out = tmp_path / "out"
    out.mkdir()
    (out / "good.mtl").write_text("precious")
    assert batch(folder, out, pictures=False).complete
    assert (out / "good.mtl").read_text(encoding="utf-8") == "precious"
    assert b"good.mtl" not in (out / "a.obj").read_bytes()


@posix
def test_the_library_of_another_output_is_left_alone(folder: Path, tmp_path: Path) -> None:
    (folder / "a.obj").write_bytes(whole("mtllib b.obj.mtl"))
    (folder / "b.obj.mtl").write_text("newmtl m\nKd 1 0 0\n")
    assert batch(folder, tmp_path / "out", pictures=False).complete
    assert not (tmp_path / "out" / "b.obj.mtl").exists()


@posix
@pytest.mark.parametrize("library", [".manifest.lock", "../x.mtl", "x.ply/a.mtl", "summary.html"])
def test_a_material_library_gets_no_name_of_its_authors_choice(
    folder: Path, tmp_path: Path, library: str
) -> None:
    (folder / "x.ply").mkdir()
    (folder / "summary.html").write_text("newmtl m\nKd 1 0 0\n")
    (folder / "x.ply" / "a.mtl").write_text("newmtl m\nKd 1 0 0\n")
    (folder / "a.obj").write_bytes(whole(f"mtllib {library}"))
    out = tmp_path / "out" / "deep"
    out.mkdir(parents=True)
    copy_mesh(load_mesh(folder / "a.obj", target=out / "a.obj"), out / "a.obj")
    assert files(tmp_path / "out") <= {"deep/a.obj", "deep/a.obj.mtl"}
    assert library.encode() not in (out / "a.obj").read_bytes()


@posix
@pytest.mark.parametrize("suffix", [".ply", ".obj", ".dae"])
@pytest.mark.parametrize("name", [".manifest.lock", "../outside.png", "..\\outside.png", "x.png"])
def test_textures_stay_in_the_output_folder(
    folder: Path, tmp_path: Path, suffix: str, name: str
) -> None:
    (folder / "a.ply").write_bytes(with_texture(name))
    (folder / "x.png").symlink_to(folder.parent / "outside.png")
    out = tmp_path / "out" / "deep"
    out.mkdir(parents=True)
    loaded = load_mesh(folder / "a.ply", target=out / f"b{suffix}")
    assert loaded.textures == {}
    assert len(loaded.notes) == 1
    assert name in loaded.notes[0]
    save_mesh(loaded, out / f"b{suffix}")
    written = {f"deep/b{suffix}", "deep/b.obj.mtl", "deep/dummy.png"}
    assert files(tmp_path / "out") <= written


@posix
def test_an_image_that_is_there_already_stays_and_ours_gets_another_name(
    folder: Path, tmp_path: Path
) -> None:
    (folder / "a.ply").write_bytes(with_texture("good.png"))
    out = tmp_path / "out"
    out.mkdir()
    (out / "good.png").write_bytes(b"precious")
    result = batch(folder, out, pictures=False, parameters={"detail": "none"})
    assert result.complete
    assert (out / "good.png").read_bytes() == b"precious"
    (name,) = load_mesh(out / "a.ply").textures
    assert name.startswith("good_")
    assert (out / name).read_bytes() == png()


def test_publishing_replaces_no_other_file(tmp_path: Path) -> None:
    scratch, target = tmp_path / "scratch", tmp_path / "a.obj"
    scratch.mkdir()
    for name in ("a.obj", "a.obj.mtl", "t.png"):
        (scratch / name).write_text("new")
        (tmp_path / name).write_text("old")
    with pytest.raises(FileExistsError, match=r"t\.png"):
        publish(scratch, target)
    assert target.read_text(encoding="utf-8") == "old"
    (tmp_path / "t.png").write_text("new")
    publish(scratch, target)
    assert (
        target.read_text(encoding="utf-8")
        == (tmp_path / "a.obj.mtl").read_text(encoding="utf-8")
        == "new"
    )


@posix
def test_a_mesh_that_is_no_regular_file_is_a_wrong_call(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.ply")
    (tmp_path / "null.ply").symlink_to("/dev/null")
    (tmp_path / "round.ply").symlink_to("round.ply")
    for name, kind in (("pipe", "a pipe"), ("null", "a device"), ("round", "levels of symbolic")):
        with pytest.raises(InvalidParameterError, match=kind):
            load_mesh(tmp_path / f"{name}.ply")


def test_names_are_found_in_any_bytes() -> None:
    data = b'\x01S\x0c\0\0\0a/t.pngS\0<x url="up/../../b.jpg /dev/zero"/>\n../c d.tif|'
    data += b"\\\\host\\e.bmp\0"
    assert {"a/t.png", "../c d.tif", "up/../../b.jpg"} <= set(image_names(data))
    away = set(paths_away(data))
    assert {"/dev/zero", "up/../../b.jpg", "../c d.tif", "\\\\host\\e.bmp"} <= away
    assert "a/t.pngS" not in away
