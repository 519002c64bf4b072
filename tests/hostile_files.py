"""Mesh files that mean harm or were harmed, with what is to become of each.

``python -m tests.hostile_files FOLDER`` writes them, to try something else on them.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

FILLED, NOTHING, REFUSED = "done", "nothing to fill", "failed"

Row = tuple[float, ...]


@dataclass(frozen=True)
class Hostile:
    """A file, or what a maker puts in its place.

    Attributes
    ----------
    name : str
    content : bytes or callable
        A callable takes the path.
    status : str
        Of its record.
    words : str
        That stand in its reason or notes.
    """

    name: str
    content: bytes | Callable[[Path], object]
    status: str
    words: str = ""

    def make(self, folder: Path) -> None:
        path = folder / self.name
        path.parent.mkdir(parents=True, exist_ok=True)
        if callable(self.content):
            self.content(path)
        else:
            path.write_bytes(self.content)


def ball(*, whole: bool = False) -> tuple[list[Row], list[tuple[int, ...]]]:
    """Give a sphere of 8 by 5 vertices with two poles, open at one of them unless whole."""
    turns, heights = np.meshgrid(np.arange(8) * np.pi / 4, np.arange(1, 6) * np.pi / 6)
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=2) * np.sin(heights)[..., None]
    rows = np.concatenate([ring, np.cos(heights)[..., None]], axis=2).reshape(-1, 3)
    vertices = [*map(tuple, rows.round(6).tolist()), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)]
    faces = []
    for i in range(32):
        right = i - i % 8 + (i + 1) % 8
        faces += [(i, i + 8, right + 8), (i, right + 8, right)]
    faces += [(32 + i, 40, 32 + (i + 1) % 8) for i in range(8)]
    faces += [(i, (i + 1) % 8, 41) for i in range(8)] if whole else []
    return (vertices, faces) if whole else (vertices[:41], faces)


VERTICES, FACES = ball()
WHOLE_VERTICES, WHOLE_FACES = ball(whole=True)


def lines(*groups: Iterable[str] | str) -> bytes:
    rows = [row for group in groups for row in ([group] if isinstance(group, str) else group)]
    return "\n".join([*rows, ""]).encode(errors="surrogateescape")


def words(rows: Iterable[Iterable[object]], before: str = "") -> list[str]:
    return [before + " ".join(map(str, row)) for row in rows]


def ply(
    *comments: str,
    kind: str = "ascii",
    counts: tuple[object, object] = (len(VERTICES), len(FACES)),
    vertices: Iterable[Row] = VERTICES,
    faces: Iterable[tuple[int, ...]] = FACES,
) -> bytes:
    """Give a PLY file with the counts that its header shall tell."""
    header = ["ply", f"format {kind} 1.0", *comments, f"element vertex {counts[0]}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"element face {counts[1]}", "property list uchar int vertex_indices", "end_header"]
    if kind == "ascii":
        return lines(header, words(vertices), words((len(face), *face) for face in faces))
    order = "<" if kind == "binary_little_endian" else ">"
    body = b"".join(struct.pack(f"{order}3f", *row) for row in vertices)
    body += b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)
    return lines(header) + body


def obj(
    *first: str,
    vertices: Iterable[Row] = VERTICES,
    faces: Iterable[tuple[int, ...]] = FACES,
    last: tuple[str, ...] = (),
) -> bytes:
    numbered = (tuple(i + 1 for i in face) for face in faces)
    return lines(first, words(vertices, "v "), words(numbered, "f "), last)


def textured(library: str) -> bytes:
    """Give an OBJ file that uses the material ``m``."""
    corners = ([f"{i + 1}/1" for i in face] for face in FACES)
    return lines(library, words(VERTICES, "v "), "vt 0 0", "usemtl m", words(corners, "f "))


def off(counts: str = f"{len(VERTICES)} {len(FACES)} 0", head: str = "OFF") -> bytes:
    return lines(head, counts, words(VERTICES), words((len(f), *f) for f in FACES))


def stl(*, count: int = len(FACES), head: bytes = b"binary") -> bytes:
    rows = np.array(VERTICES)[np.array(FACES)].reshape(-1, 9)
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *row, 0) for row in rows)
    return head.ljust(80) + struct.pack("<I", count) + body


def stl_text(*, cut: int = 0) -> bytes:
    rows = ["solid s"]
    for face in FACES:
        corners = words((VERTICES[i] for i in face), "vertex ")
        rows += ["facet normal 0 0 1", "outer loop", *corners, "endloop", "endfacet"]
    text = lines(rows, "endsolid s")
    return text[: len(text) - cut]


def png() -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        checksum = struct.pack(">I", zlib.crc32(kind + data))
        return struct.pack(">I", len(data)) + kind + data + checksum

    header = struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0)
    pixels = chunk(b"IDAT", zlib.compress(b"\x00\xff\x00\x00"))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + pixels + chunk(b"IEND", b"")


def listen(path: Path) -> None:
    here = Path.cwd()
    os.chdir(path.parent)  # names of sockets are short
    try:
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(path.name)
    finally:
        os.chdir(here)


def link(target: str) -> Callable[[Path], None]:
    return lambda path: path.symlink_to(target)


def make_companions(folder: Path) -> None:
    """Put beside the meshes what they name."""
    (folder / "images").mkdir()
    (folder / ".hidden").mkdir()
    for name in ("good.png", "images/good.png", ".secret.png", ".hidden/t.png", ".manifest.lock"):
        (folder / name).write_bytes(png())
    (folder.parent / "outside.png").write_bytes(png())
    (folder.parent / "outside.mtl").write_text("newmtl m\nKd 1 0 0\n")
    (folder / "text.png").write_text("no image\n")
    (folder / "manifest.jsonl").write_text("{}\n")
    (folder / "linked.png").symlink_to(folder.parent / "outside.png")
    (folder / "round.png").symlink_to("round.png")
    (folder / "null.png").symlink_to("/dev/null")
    (folder / "zero.mtl").symlink_to("/dev/zero")
    os.mkfifo(folder / "pipe.png")
    os.mkfifo(folder / "pipe.mtl")
    os.mkfifo(folder / "pipe.bin")
    listen(folder / "socket.mtl")
    libraries = {
        "good": "map_Kd good.png",
        "deep": "map_Kd -s 1 1 1 images\\good.png",
        "up": "map_Kd ../../../outside.png",
        "pipe_map": "map_Kd pipe.png",
        "device_map": "map_Kd /dev/zero",
        "hidden_map": "map_Kd .secret.png",
        "bump_pipe": "bump pipe.png",
        "odd": "Kd nan inf 1e999\nmap_Kd\nnewmtl\nnewmtl m\n\x00\x01\nrm -rf /\nKd 1 1",
    }
    for name, line in libraries.items():
        (folder / f"{name}.mtl").write_text(f"newmtl m\nKd 0.5 0.5 0.5\n{line}\n")


def with_texture(name: str) -> bytes:
    """Give a PLY file with texture coordinates at its wedges."""
    text = ply(f"comment TextureFile {name}").decode(errors="surrogateescape")
    head, end, body = text.partition("end_header\n")
    rows = [row + " 6 0 0 1 0 0 1" * row.startswith("3 ") for row in body.splitlines()]
    return lines(head + "property list uchar float texcoord", end.strip(), rows)


NO_FACE, TOO_SHORT, LEFT_OUT = "without three vertices", "too short", "left out"
PIPE, DEVICE, FOLDER = "which is a pipe", "which is a device", "which is a folder"
NAN, INF = float("nan"), float("inf")


def changed(rows: list[Row], row: Row) -> list[Row]:
    return [*rows[:3], row, *rows[4:]]


PLY_FILES = (
    Hostile("ply/good.ply", ply(), FILLED),
    Hostile("ply/little.ply", ply(kind="binary_little_endian"), FILLED),
    Hostile("ply/big.ply", ply(kind="binary_big_endian"), FILLED),
    Hostile(
        "ply/whole.ply",
        ply(counts=(42, 80), vertices=WHOLE_VERTICES, faces=WHOLE_FACES),
        NOTHING,
    ),
    Hostile("ply/crlf.ply", ply().replace(b"\n", b"\r\n"), FILLED),
    Hostile("ply/long_comment.ply", ply("comment " + "x" * 3000), REFUSED, "can't be read"),
    Hostile("ply/empty.ply", b"", REFUSED, "no PLY header"),
    Hostile("ply/words.ply", b"these are words\n" * 9, REFUSED, "no PLY header"),
    Hostile("ply/one_line.ply", b"ply" + b"x" * 3_000_000, REFUSED, "no PLY header"),
    Hostile("ply/header_only.ply", ply(vertices=(), faces=()), REFUSED, TOO_SHORT),
    Hostile("ply/cut.ply", ply(kind="binary_little_endian")[:-300], REFUSED, "can't be read"),
    Hostile("ply/cut_text.ply", ply()[:-300], REFUSED, "can't be read"),
    Hostile("ply/many.ply", ply(counts=(1 << 31, 1 << 31)), REFUSED, TOO_SHORT),
    Hostile(
        "ply/many_binary.ply",
        ply(kind="binary_little_endian", counts=(1 << 31, 9)),
        REFUSED,
        TOO_SHORT,
    ),
    Hostile("ply/huge.ply", ply(counts=(10**30, 10**30)), REFUSED, TOO_SHORT),
    Hostile("ply/negative.ply", ply(counts=(-1, 9)), REFUSED, "how many"),
    Hostile("ply/wordy.ply", ply(counts=("many", "few")), REFUSED, "how many"),
    Hostile("ply/nan.ply", ply(vertices=changed(VERTICES, (NAN, 0, 0))), REFUSED, "aren't finite"),
    Hostile("ply/inf.ply", ply(vertices=changed(VERTICES, (0, INF, 0))), REFUSED, "aren't finite"),
    Hostile("ply/index.ply", ply(faces=[*FACES[:-1], (0, 1, 2**31 - 1)]), REFUSED, "index"),
    Hostile("ply/below.ply", ply(faces=[*FACES[:-1], (0, 1, -5)]), REFUSED, "index"),
    Hostile("ply/no_faces.ply", ply(counts=(41, 0), faces=()), REFUSED, "no faces"),
    Hostile("ply/no_list.ply", ply().replace(b"list uchar", b"float"), REFUSED, ""),
    Hostile("ply/lock.ply", with_texture(".manifest.lock"), FILLED, LEFT_OUT),
    Hostile("ply/up.ply", with_texture("../../outside.png"), FILLED, LEFT_OUT),
    Hostile("ply/windows_up.ply", with_texture("..\\..\\outside.png"), FILLED, LEFT_OUT),
    Hostile("ply/absolute.ply", with_texture("/etc/passwd"), FILLED, LEFT_OUT),
    Hostile("ply/drive.ply", with_texture("C:\\scans\\t.png"), FILLED, LEFT_OUT),
    Hostile("ply/escape.ply", with_texture("t\x1b]0;x\x07.png"), FILLED, LEFT_OUT),
    Hostile("ply/null_byte.ply", with_texture("t\0.png"), FILLED, LEFT_OUT),
    Hostile("ply/long.ply", with_texture("x" * 900 + ".png"), FILLED, LEFT_OUT),
    Hostile("ply/manifest.ply", with_texture("manifest.jsonl"), FILLED, "can't be read"),
    Hostile("ply/not_utf8.ply", with_texture("t\udcff.png"), FILLED, LEFT_OUT),
    Hostile("ply/zero.ply", with_texture("/dev/zero"), REFUSED, DEVICE),
    Hostile("ply/parent.ply", with_texture(".."), REFUSED, FOLDER),
)

OBJ_FILES = (
    Hostile("good.obj", textured("mtllib good.mtl"), FILLED),
    Hostile("deep.obj", textured("mtllib deep.mtl"), FILLED),
    Hostile(
        "whole.obj", obj("mtllib good.mtl", vertices=WHOLE_VERTICES, faces=WHOLE_FACES), NOTHING
    ),
    Hostile("pipe.obj", textured("mtllib pipe.mtl"), REFUSED, PIPE),
    Hostile("split.obj", textured("mtl\\\nlib pipe.mtl"), FILLED),
    Hostile("spaced.obj", textured("  mtllib\t pipe.mtl "), REFUSED, PIPE),
    Hostile("device.obj", textured("mtllib zero.mtl"), REFUSED, DEVICE),
    Hostile("device_path.obj", textured("mtllib /dev/zero"), REFUSED, DEVICE),
    Hostile("socket.obj", textured("mtllib socket.mtl"), REFUSED, "which is a socket"),
    Hostile("folder.obj", textured("mtllib images"), REFUSED, FOLDER),
    Hostile("missing.obj", textured("mtllib nowhere.mtl"), FILLED, "can't be read"),
    Hostile("outside.obj", textured("mtllib ../outside.mtl"), FILLED, "can't be read"),
    Hostile("lock.obj", textured("mtllib .manifest.lock"), FILLED, "can't be read"),
    Hostile("null_byte.obj", textured("mtllib a\0b.mtl"), FILLED, "can't be read"),
    Hostile("image.obj", textured("mtllib good.png"), FILLED),
    Hostile("up.obj", textured("mtllib up.mtl"), FILLED, LEFT_OUT),
    Hostile("pipe_map.obj", textured("mtllib pipe_map.mtl"), REFUSED, PIPE),
    Hostile("bump.obj", textured("mtllib bump_pipe.mtl"), REFUSED, PIPE),
    Hostile("device_map.obj", textured("mtllib device_map.mtl"), REFUSED, DEVICE),
    Hostile("hidden_map.obj", textured("mtllib hidden_map.mtl"), FILLED, LEFT_OUT),
    Hostile("odd.obj", textured("mtllib odd.mtl"), FILLED),
    Hostile("zeros.obj", obj(last=("f 0 0 0",)), REFUSED, NO_FACE),
    Hostile("bare.obj", obj(last=("f ",)), REFUSED, NO_FACE),
    Hostile("bare_end.obj", obj()[:-1] + b"\nf", REFUSED, NO_FACE),
    Hostile("short.obj", obj(last=("f 1 2",)), REFUSED, NO_FACE),
    Hostile("letters.obj", obj(last=("f a b c",)), REFUSED, NO_FACE),
    Hostile("slashes.obj", obj(last=("f 1// 2// 3//",)), FILLED),
    Hostile("far.obj", obj(last=("f 1 2 99999999999999999999",)), REFUSED, "of 41"),
    Hostile("far_back.obj", obj(last=("f -1 -2 -99",)), REFUSED, "of 41"),
    Hostile(
        "back.obj",
        lines(words(VERTICES, "v "), words(((i - 41 for i in f) for f in FACES), "f ")),
        FILLED,
    ),
    Hostile("quads.obj", obj(last=("f 1 2 3 4 5 6 7 8",)), NOTHING),
    Hostile("nan.obj", obj(vertices=changed(VERTICES, (NAN, 0, 0))), REFUSED, "aren't finite"),
    Hostile("points.obj", obj(faces=()), REFUSED, "no faces"),
    Hostile("empty.obj", b"", REFUSED, ""),
    Hostile("noise.obj", np.random.default_rng(0).bytes(5000), REFUSED, ""),
    Hostile("wide.obj", obj().decode().encode("utf-16"), REFUSED, ""),
)

OTHER_FILES = (
    Hostile("off/good.off", off(), FILLED),
    Hostile("off/headless.off", off(head="# nothing"), REFUSED, "can't be read"),
    Hostile("off/many.off", off("2147483648 2147483648 0"), REFUSED, TOO_SHORT),
    Hostile("off/negative.off", off("-1 -1 0"), REFUSED, "how many"),
    Hostile("off/cut.off", off()[:-200], REFUSED, ""),
    Hostile("off/index.off", off().replace(b"3 39 40 32", b"3 39 99 32"), REFUSED, "of 41"),
    Hostile("off/nan.off", off().replace(b"0.0 0.0 -1.0", b"nan 0 0"), REFUSED, "aren't finite"),
    Hostile("off/empty.off", b"", REFUSED, "can't be read"),
    Hostile("stl/good.stl", stl(), FILLED),
    Hostile("stl/text.stl", stl_text(), FILLED),
    Hostile("stl/cut_text.stl", stl_text(cut=200), REFUSED, "can't be read"),
    Hostile("stl/many.stl", stl(count=0xFFFFFFFF, head=b"\xff"), REFUSED, TOO_SHORT),
    Hostile("stl/solid.stl", stl(head=b"solid but binary"), FILLED),
    Hostile("stl/cut.stl", stl()[:-30], REFUSED, TOO_SHORT),
    Hostile("stl/empty.stl", b"", REFUSED, "can't be read"),
    Hostile("names/line\nbreak.ply", ply(), FILLED),
    Hostile("names/clear\x1b[2J\x07.ply", ply(), FILLED),
    Hostile("names/turned\u202eylp.ply", ply(), FILLED),
    Hostile("names/not_utf8\udcff.ply", ply(), FILLED),
    Hostile("names/not_utf8\udcfe.obj", obj(), FILLED),
    Hostile("names/[bold]x[/red].ply", ply(), FILLED),
    Hostile("names/-rf $(x) 'y' %s {z}.ply", ply(), FILLED),
    Hostile("names/<b>&amp;.ply", ply(), FILLED),
    Hostile(f"names/{'long' * 50}.ply", ply(), FILLED),
    Hostile("names/a.ply", ply(), FILLED),
    Hostile("names/A.PLY", ply(), FILLED),
    Hostile("kinds/pipe.ply", os.mkfifo, REFUSED, "is a pipe"),
    Hostile("kinds/socket.ply", listen, REFUSED, "is a socket"),
    Hostile("kinds/zero.ply", link("/dev/zero"), REFUSED, "is a device"),
    Hostile("kinds/full.obj", link("/dev/full"), REFUSED, "is a device"),
    Hostile("kinds/round.off", link("round.off"), REFUSED, ""),
    Hostile("kinds/gone.stl", link("nowhere.stl"), REFUSED, "No such file"),
    Hostile("kinds/linked.ply", link("../ply/good.ply"), FILLED),
)


FILES = (*PLY_FILES, *OBJ_FILES, *OTHER_FILES)


def make_all(folder: Path) -> None:
    """Write them and what they name."""
    make_companions(folder)
    for item in FILES:
        item.make(folder)


if __name__ == "__main__":
    make_all(Path(sys.argv[1]))
