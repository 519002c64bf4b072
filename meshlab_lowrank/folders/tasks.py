"""What an isolated process does with one mesh file: functions for `isolation.jobs`."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from meshlab_lowrank import filters
from meshlab_lowrank.chains import load_chain
from meshlab_lowrank.chains.script_chain import ScriptChain
from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.filters.reading import mesh_arrays
from meshlab_lowrank.filters.text_values import filter_value
from meshlab_lowrank.folders.repairing import repair
from meshlab_lowrank.hole_table import hole_table
from meshlab_lowrank.isolation.jobs import Emit, Report, tell
from meshlab_lowrank.mesh_files import (
    LoadedMesh,
    copy_mesh,
    load_mesh,
    marks_of,
    save_mesh,
    take_marks,
)
from meshlab_lowrank.picking import NOT_PICKED
from meshlab_lowrank.report.hole_map import draw_hole_map
from meshlab_lowrank.result import ProgressEvent
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop, find_boundary
from meshlab_lowrank.threads import THREADS_VARIABLE

_FEW_HOLES = 3  # whose stages are told one by one
_TENTHS = 10


def holes(job: dict[str, Any], emit: Emit) -> Report:
    """Tabulate the holes of the mesh in ``source``, and draw them if it has a ``picture``."""
    loaded = _load(job, emit)
    mesh = loaded.meshset.current_mesh()
    mesh.compact()
    vertices, faces = mesh_arrays(mesh)
    boundary = find_boundary(vertices, faces)
    table = hole_table(vertices, faces, boundary.loops)
    rows = [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]
    notes = [*loaded.notes, *boundary.notes]
    if job.get("picture"):
        tell(emit, "drawing", 0.5)
        seen = _seen(boundary.loops, table)
        note = draw_hole_map(vertices, faces, **seen, target=Path(job["picture"]))
        notes += [note] if note else []
    return {"status": "done", "notes": notes, "holes": rows, **_size(loaded)}


def process(job: dict[str, Any], emit: Emit) -> Report:
    """Fill the holes of the mesh in ``source``, or run a chain on it, and write ``target``.

    Parameters
    ----------
    job : dict
        ``source`` and ``target``: paths; ``parameters`` of the filter as text, or the path of a
        ``chain``; ``repair``, whether the mesh is repaired first; the number of ``threads``;
        ``picture``, where one is drawn of the fills and their error bars, if there is any.
    emit : callable

    Returns
    -------
    dict
        ``status``: "done", "nothing to fill", "partly filled" or "failed"; ``written``, if the
        target is whole; ``holes``, ``notes`` and ``filter_seconds``.
    """
    target = Path(job["target"])
    chain = load_chain(job["chain"]) if job["chain"] else None
    values = {name: filter_value(name, text) for name, text in job["parameters"].items()}
    if job["threads"]:
        os.environ[THREADS_VARIABLE] = str(job["threads"])
    loaded = _load(job, emit, target)
    note = take_marks(loaded.meshset.current_mesh(), Path(job["source"]))
    notes = [*loaded.notes, note] if note else list(loaded.notes)
    started = time.monotonic()
    if job["repair"]:
        tell(emit, "repairing", 0.0)
        notes.append(repair(loaded.meshset))
    if chain:
        results = chain.run(loaded.meshset, _step_callback(emit, chain.length))
    else:
        if values.get("selected"):
            _refuse_unselected(loaded)
        holes = _holes_to_draw(loaded) if job.get("picture") else None
        if values.get("showtrust") in (None, "quality") and target.suffix.lower() != ".ply":
            values["showtrust"] = "none"  # no other format holds quality, and CTM crashes MeshLab
        progress = _hole_callback(emit)
        results = [filters.meshing_inpaint_lowrank(loaded.meshset, progress=progress, **values)]
        if holes:
            tell(emit, "drawing", 1.0)
            notes += _draw_bars(loaded, holes, Path(job["picture"]))
    seconds = time.monotonic() - started
    tell(emit, "writing", 1.0)
    unchanged = not chain and not job["repair"] and not results[0]["new_faces"]
    notes += (copy_mesh if unchanged else save_mesh)(loaded, target)
    remedy = "" if chain or job["repair"] else " Or run again with --repair."
    for result in results:
        notes += [note + remedy for note in result.get("notes", ())]
        notes += result.get("texture_notes", ())
    return {**_outcome(results), "written": True, "notes": notes, "filter_seconds": seconds}


def _seen(loops: Sequence[BoundaryLoop], table: dict[str, list[Any]]) -> dict[str, Any]:
    """Give what a picture shows of holes: rims, normals, and which are outer ones."""
    return {
        "rims": [loop.vertices for loop in loops],
        "normals": np.array(table["normal"]).reshape(-1, 3),
        "outer": np.array(table["is_rim"], dtype=np.bool_),
    }


def _holes_to_draw(loaded: LoadedMesh) -> dict[str, Any]:
    mesh = loaded.meshset.current_mesh()
    mesh.compact()
    vertices, faces = mesh_arrays(mesh)
    loops = find_boundary(vertices, faces).loops
    return _seen(loops, hole_table(vertices, faces, loops))


def _draw_bars(loaded: LoadedMesh, seen: dict[str, Any], target: Path) -> list[str]:
    """Draw the filled mesh with its error bars; give what is to be said of the picture."""
    mesh = loaded.meshset.current_mesh()
    marks = marks_of(mesh)
    if marks is None:
        return []
    vertices, faces = mesh_arrays(mesh)
    note = draw_hole_map(
        vertices, faces, **seen, target=target, filled=marks.faces, bars=marks.error
    )
    return [note] if note else []


def check(job: dict[str, Any], emit: Emit) -> Report:
    """Try a ``step`` of a ``chain``, if that is a filter script."""
    chain = load_chain(job["chain"])
    if isinstance(chain, ScriptChain):
        tell(emit, chain.steps[job["step"]].name, 0.0)
        chain.check(job["step"])
    return {"status": "done"}


def _step_callback(emit: Emit, steps: int) -> Callable[[int, str], None]:
    return lambda number, name: tell(emit, name, number / steps)


def _hole_callback(emit: Emit) -> Callable[[ProgressEvent], None]:
    def show(event: ProgressEvent) -> None:
        if event.stage in {"closing", "fairing"} and event.holes > 1:
            text = f"{event.holes} holes: {event.stage}"
        elif event.holes <= _FEW_HOLES:
            text = f"hole {event.hole + 1} of {event.holes}: {event.stage}"
        else:
            tenth = _TENTHS * event.hole // event.holes
            text = f"{event.holes * tenth // _TENTHS} of {event.holes} holes done"
        tell(emit, text, event.fraction)

    return show


def _load(job: dict[str, Any], emit: Emit, target: Path | None = None) -> LoadedMesh:
    tell(emit, "reading", 0.0)
    source = Path(job["source"])
    if target is None:
        return load_mesh(source)
    scratch = target.parent  # what a kill leaves there is cleared away
    return load_mesh(source, scratch=scratch, target=scratch.parent / target.name)


def _refuse_unselected(loaded: LoadedMesh) -> None:
    if loaded.meshset.current_mesh().selected_face_number() == 0:
        msg = (
            f"No face is selected in {loaded.path.name}; only PLY files keep a selection, if they "
            "are saved with the flags of the faces."
        )
        raise InvalidMeshError(msg)


def _size(loaded: LoadedMesh) -> Report:
    mesh = loaded.meshset.current_mesh()
    return {"vertices": mesh.vertex_number(), "faces": mesh.face_number()}


def _stayed_open(hole: dict[str, Any]) -> bool:
    """Whether a hole was to be filled and is not."""
    bad = hole["shape"] == "bad edges" and hole["reason"] != NOT_PICKED
    return bool(hole["status"] == "failed" or bad)


def _outcome(results: list[dict[str, Any]]) -> Report:
    """Sum up what the filters gave: a status, a reason, the records of the holes."""
    holes = [hole for result in results for hole in result.get("holes", ())]
    failed = [hole for hole in holes if _stayed_open(hole)]
    filled = [hole for hole in holes if hole["status"] == "filled"]
    if failed:
        status = "partly filled" if filled else "failed"
        reason = f"{len(failed)} of {len(filled) + len(failed)} holes stayed open: "
        return {"status": status, "reason": reason + failed[0]["reason"], "holes": holes}
    if filled or not any("closed_holes" in result for result in results):
        return {"status": "done", "holes": holes}
    reason = "There is no hole." if not holes else f"No hole to fill: {holes[0]['reason']}"
    return {"status": "nothing to fill", "reason": reason, "holes": holes}
