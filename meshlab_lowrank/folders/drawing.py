"""What an isolated process does to draw holes: find them again in input and output."""

from __future__ import annotations

import base64
import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pymeshlab

from meshlab_lowrank.errors import LowrankError
from meshlab_lowrank.filters.reading import mesh_arrays
from meshlab_lowrank.folders.hole_pictures import KINDS
from meshlab_lowrank.isolation.jobs import Emit, Report, tell
from meshlab_lowrank.mesh.filled_mesh import KnownSurface
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.mesh_files import Marks, load_mesh, marks_of, take_marks
from meshlab_lowrank.report.pictures import Picture, bar_map, draw
from meshlab_lowrank.report.view import View
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop, boundary_loops

_CHANGED = "The hole is not in the input, which the chain changed before it was filled."
_OPEN = "The output has no fill there."
_SAME = 1e-6  # relative difference of lengths that single precision explains


def perform(job: dict[str, Any], emit: Emit) -> Report:
    """Draw holes before and after: a function for `isolation.jobs`.

    Parameters
    ----------
    job : dict
        ``holes``: dicts with the path of the ``source``, that of the ``target``, if there is one,
        and the record of the ``hole``.
    emit : callable

    Returns
    -------
    dict
        ``pictures``: one dict a hole, in order, with ``before``, ``after`` and ``bars`` (JPEG
        files in base64, or empty) and the ``reason`` why one is missing. ``reason``: why there are
        none.
    """
    tell(emit, "drawing", 0.0)
    items = job["holes"]
    pictures: dict[tuple[int, str], Picture] = {}
    reasons = [""] * len(items)
    order = sorted(range(len(items)), key=lambda i: (items[i]["source"], i))
    for _, group in itertools.groupby(order, key=lambda i: items[i]["source"]):
        numbers = list(group)
        first = items[numbers[0]]
        try:
            views = _views(first["source"], first["target"], [items[i]["hole"] for i in numbers])
            for number, (own, reason) in zip(numbers, views, strict=True):
                reasons[number] = reason
                pictures |= {(number, kind): picture for kind, picture in own.items()}
        except (LowrankError, pymeshlab.PyMeshLabException, OSError) as error:
            for number in numbers:
                reasons[number] = str(error)
    files, missing = draw(pictures)
    drawn = [
        {kind: _text(files.get((number, kind), b"")) for kind in KINDS} | {"reason": reason}
        for number, reason in enumerate(reasons)
    ]
    return {"status": "done", "reason": missing, "pictures": drawn}


def _views(
    source: str, target: str, holes: Sequence[dict[str, Any]]
) -> Iterator[tuple[dict[str, Picture], str]]:
    """Give the pictures of the holes of one file by their kind, and why one is missing."""
    vertices, faces, _ = _arrays(source)
    loops = boundary_loops(vertices, faces)
    filled, marks = None, None
    if target:
        known = KnownSurface(vertices, faces, [loop.vertices for loop in loops])
        whole, triangles, marks = _arrays(target)
        filled = known.locate(whole, triangles)
    for hole in holes:
        loop = _find(hole, loops)
        if loop is None:
            yield {}, _CHANGED
            continue
        view = View.of_loop(vertices, faces, loop.vertices)
        nothing = SurfacePart(vertices, faces, faces[:, 0] < 0)
        before = {"before": Picture(view, view.scene(nothing))}
        fill = filled.surface(loop.id) if filled else nothing
        if hole["status"] == "failed":
            yield before, ""
        elif not fill.part.any():
            yield before, _OPEN
        else:
            after = {"after": Picture(view, view.scene(fill), marked=True)}
            bars = bar_map(fill, marks.error) if marks else None
            if bars and hole["largest_error"]:
                scene, limit = view.scene(fill), hole["largest_error"]
                after["bars"] = Picture(view, scene, bars, limit)
            yield before | after, ""


def _arrays(path: str) -> tuple[FloatArray, IntArray, Marks | None]:
    meshset = load_mesh(Path(path)).meshset
    mesh = meshset.current_mesh()
    take_marks(mesh, Path(path))
    mesh.compact()
    return (*mesh_arrays(mesh), marks_of(mesh))


def _find(hole: dict[str, Any], loops: Sequence[BoundaryLoop]) -> BoundaryLoop | None:
    """Find the loop of a record: the same in size, and if there are several, in number."""
    same = [
        loop
        for loop in loops
        if len(loop.vertices) == hole["boundary_edges"]
        and math.isclose(loop.perimeter, hole["perimeter"], rel_tol=_SAME)
    ]
    return next((loop for loop in same if loop.id == hole["id"]), same[0] if same else None)


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
