"""What an isolated process does with one mesh file."""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import pymeshlab

from meshlab_lowrank import filters
from meshlab_lowrank.chains import load_chain
from meshlab_lowrank.chains.script_chain import ScriptChain, filter_value
from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.mesh_files import (
    WRITE_SUFFIXES,
    LoadedMesh,
    copy_mesh,
    load_mesh,
    meshlab_reason,
    save_mesh,
)
from meshlab_lowrank.result import ProgressEvent
from meshlab_lowrank.threads import THREADS_VARIABLE

Emit: TypeAlias = Callable[[dict[str, Any]], object]
Report: TypeAlias = dict[str, Any]


def perform(job: dict[str, Any], emit: Emit) -> Report:
    """Do one job; whatever goes wrong is told in the report.

    Parameters
    ----------
    job : dict
        ``task``: "holes"; "process", with ``parameters`` of the filter as text or the path of a
        ``chain``, and the number of ``threads``; "check", with a ``chain`` and the number of a
        ``step``; "compare" (see `comparison.task`); or "pictures" (see `drawing`). ``source`` and
        ``target``: paths.
    emit : callable
        Called with progress events.

    Returns
    -------
    dict
        ``status``: "done", "nothing to fill", "partly filled" or "failed"; ``reason``: one
        sentence; ``wrong_call``: whether the call is to blame rather than the mesh; ``written``,
        if the target is whole; and what the task found.
    """
    try:
        return {"reason": "", "wrong_call": False, **_TASKS[job["task"]](job, emit)}
    except InvalidParameterError as error:
        return _failed(error, wrong_call=True)
    except (LowrankError, pymeshlab.PyMeshLabException) as error:
        return _failed(error)
    except MemoryError:
        return {"status": "failed", "reason": "The memory ran out.", "wrong_call": False}
    except OSError as error:
        reason = f"{error.strerror or error}: {error.filename or job.get('target')}."
        return {"status": "failed", "reason": reason, "wrong_call": False}
    except Exception as error:  # noqa: BLE001  a bug must cost one file, not the run
        reason = (
            f"{type(error).__name__}: {meshlab_reason(error)}; this is a bug, please report it."
        )
        return {**_failed(error), "reason": reason, "traceback": traceback.format_exc()}


def _failed(error: Exception, *, wrong_call: bool = False) -> Report:
    return {"status": "failed", "reason": f"{meshlab_reason(error)}.", "wrong_call": wrong_call}


def _holes(job: dict[str, Any], emit: Emit) -> Report:
    loaded = _load(job, emit)
    table = filters.get_hole_measures(loaded.meshset)
    rows = [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]
    return {"status": "done", "notes": list(loaded.notes), "holes": rows, **_size(loaded)}


def _process(job: dict[str, Any], emit: Emit) -> Report:
    target = Path(job["target"])
    if target.suffix.lower() not in WRITE_SUFFIXES:
        msg = (
            f"MeshLab reads {target.suffix} but can't write it; choose the format of the outputs, "
            "as in --format ply."
        )
        raise InvalidParameterError(msg)
    chain = load_chain(job["chain"]) if job["chain"] else None
    values = {name: filter_value(name, text) for name, text in job["parameters"].items()}
    if job["threads"]:
        os.environ[THREADS_VARIABLE] = str(job["threads"])
    loaded = _load(job, emit)
    started = time.monotonic()
    if chain:
        results = chain.run(loaded.meshset, _step_callback(emit, chain.length))
    else:
        progress = _hole_callback(emit)
        results = [filters.meshing_inpaint_lowrank(loaded.meshset, progress=progress, **values)]
    seconds = time.monotonic() - started
    _tell(emit, "writing", 1.0)
    unchanged = not chain and not results[0]["new_faces"]
    (copy_mesh if unchanged else save_mesh)(loaded, target)
    untextured = sum(result.get("untextured_faces", 0) for result in results)
    notes = [*loaded.notes, *([f"No texture fits {untextured} new faces."] if untextured else ())]
    return {**_outcome(results), "written": True, "notes": notes, "filter_seconds": seconds}


def _check(job: dict[str, Any], emit: Emit) -> Report:
    chain = load_chain(job["chain"])
    if isinstance(chain, ScriptChain):
        _tell(emit, chain.steps[job["step"]].name, 0.0)
        chain.check(job["step"])
    return {"status": "done"}


def _compare(job: dict[str, Any], emit: Emit) -> Report:
    from meshlab_lowrank.comparison import task  # noqa: PLC0415  needs what an ordinary run does not

    _tell(emit, job["filler"], 0.0)
    return task.perform(job)


def _pictures(job: dict[str, Any], emit: Emit) -> Report:
    from meshlab_lowrank.folders import drawing  # noqa: PLC0415  as above

    _tell(emit, "drawing", 0.0)
    return drawing.perform(job)


_TASKS: dict[str, Callable[[dict[str, Any], Emit], Report]] = {
    "holes": _holes,
    "process": _process,
    "check": _check,
    "compare": _compare,
    "pictures": _pictures,
}


def _step_callback(emit: Emit, steps: int) -> Callable[[int, str], None]:
    return lambda number, name: _tell(emit, name, number / steps)


def _hole_callback(emit: Emit) -> Callable[[ProgressEvent], None]:
    return lambda event: _tell(
        emit, f"hole {event.hole + 1} of {event.holes}: {event.stage}", event.fraction
    )


def _tell(emit: Emit, stage: str, fraction: float) -> None:
    emit({"event": "progress", "stage": stage, "fraction": fraction})


def _load(job: dict[str, Any], emit: Emit) -> LoadedMesh:
    _tell(emit, "reading", 0.0)
    return load_mesh(Path(job["source"]))


def _size(loaded: LoadedMesh) -> Report:
    mesh = loaded.meshset.current_mesh()
    return {"vertices": mesh.vertex_number(), "faces": mesh.face_number()}


def _outcome(results: list[dict[str, Any]]) -> Report:
    """Sum up what the filters gave: a status, a reason, the records of the holes."""
    holes = [hole for result in results for hole in result.get("holes", ())]
    failed = [hole for hole in holes if hole["status"] == "failed"]
    filled = [hole for hole in holes if hole["status"] == "filled"]
    if failed:
        status = "partly filled" if filled else "failed"
        reason = f"{len(failed)} of {len(filled) + len(failed)} holes stayed open: "
        return {"status": status, "reason": reason + failed[0]["reason"], "holes": holes}
    if filled or not any("closed_holes" in result for result in results):
        return {"status": "done", "holes": holes}
    reason = "There is no hole." if not holes else f"No hole to fill: {holes[0]['reason']}"
    return {"status": "nothing to fill", "reason": reason, "holes": holes}
