"""What MeshLab's loaders don't notice: faces that name missing vertices, counts that can't be."""

from __future__ import annotations

import itertools
import struct
from pathlib import Path
from typing import NoReturn

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh_files.obj_lines import obj_lines
from meshlab_lowrank.mesh_files.ply_header import PlyHeader

_STL_HEADER, _STL_FACE = 84, 50  # bytes
_PLURALS = {"edge": "edges", "face": "faces", "vertex": "vertices"}
_OFF_VERTEX, _OFF_FACE = 6, 4  # bytes at least


def refuse_damaged(path: Path) -> None:
    """Refuse files that the loaders crash on, take apart silently or don't get done with.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InvalidMeshError
    """
    check = {".obj": _check_obj, ".off": _check_off, ".ply": _check_ply, ".stl": _check_stl}
    check.get(path.suffix.lower(), lambda _: None)(path)


def _check_obj(path: Path) -> None:
    vertices = highest = 0
    with path.open("rb") as file:
        for number, line in enumerate(obj_lines(file), 1):
            if line.startswith((b"v ", b"v\t")):
                vertices += 1
            elif line.startswith((b"f ", b"f\t")) or line.strip() == b"f":
                try:
                    corners = [abs(int(item.partition(b"/")[0])) for item in line.split()[1:]]
                except ValueError:
                    corners = []
                if len(corners) < 3 or not all(corners):
                    msg = (
                        f"{path.name} has a face, in line {number}, without three vertices or "
                        "more, numbered from 1; the file is damaged, export it again."
                    )
                    raise InvalidMeshError(msg)
                highest = max(highest, *corners)
    _refuse_missing(path, highest, vertices)


def _check_off(path: Path) -> None:
    with path.open("rb") as file:
        rows = filter(None, (line.partition(b"#")[0].split() for line in file))
        try:
            counts = next(rows)
            if counts[0].endswith(b"OFF"):
                counts = counts[1:] or next(rows)
            vertices, faces = int(counts[0]), int(counts[1])
            if min(vertices, faces) < 0:
                _refuse_negative(path)
            if vertices * _OFF_VERTEX + faces * _OFF_FACE > path.stat().st_size:
                _refuse_counts(path, f"{vertices} vertices and {faces} faces")
            polygons = itertools.islice(rows, vertices, vertices + faces)
            corners = (corner for row in polygons for corner in row[1 : 1 + int(row[0])])
            highest = 1 + max(map(int, corners), default=-1)
        except InvalidMeshError:
            raise
        except (IndexError, StopIteration, ValueError):
            return  # the loader says what is wrong with it
    _refuse_missing(path, highest, vertices)


def _check_ply(path: Path) -> None:
    header = PlyHeader.read(path)
    if header.least_bytes() > path.stat().st_size - header.size:
        counts = (f"{e.count} {_PLURALS.get(e.name, e.name)}" for e in header.elements if e.count)
        _refuse_counts(path, " and ".join(counts))


def _check_stl(path: Path) -> None:
    with path.open("rb") as file:
        start = file.read(1000)
    named = b"facet" in start or start.lstrip()[:5].lower() == b"solid"
    if len(start) < _STL_HEADER or (named and start.isascii()):
        return  # it is text
    (faces,) = struct.unpack_from("<I", start, _STL_HEADER - 4)
    if _STL_HEADER + faces * _STL_FACE > path.stat().st_size:
        _refuse_counts(path, f"{faces} faces")


def _refuse_missing(path: Path, highest: int, vertices: int) -> None:
    if highest > vertices:
        msg = (
            f"{path.name} has faces that name vertex number {highest} of {vertices}; "
            "the file is damaged, export it again."
        )
        raise InvalidMeshError(msg)


def _refuse_negative(path: Path) -> NoReturn:
    msg = f"{path.name} can't be read: it doesn't say how many elements it has."
    raise InvalidMeshError(msg)


def _refuse_counts(path: Path, counts: str) -> NoReturn:
    msg = f"{path.name} can't be read: it is too short for the {counts} that it promises."
    raise InvalidMeshError(msg)
