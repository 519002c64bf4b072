"""What an isolated process does for the comparison: read a mesh, or run one filler on one."""

from __future__ import annotations

import importlib
import time
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.comparison.loading import find_filler
from meshlab_lowrank.isolation.jobs import Emit, Report, tell
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh_files import load_mesh, marks_of

FUNCTION = "meshlab_lowrank.comparison.task:perform"
READING = "reading"


def mesh_set(vertices: FloatArray, faces: IntArray, selected: BoolArray) -> Any:
    """Give a MeshSet with one mesh and some of its faces selected.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    selected : (m,) bool

    Returns
    -------
    pymeshlab.MeshSet
    """
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(vertices, faces, f_scalar_array=selected.astype(np.float64)))
    ms.compute_selection_by_condition_per_face(condselect="fq > 0.5")
    return ms


def perform(job: dict[str, Any], emit: Emit) -> Report:
    """Run a filler and store the mesh that it makes; with `READING` for filler, read a mesh file.

    Parameters
    ----------
    job : dict
        ``filler``: name or path; ``source``: an .npz file with ``vertices``, ``faces`` and
        ``selected``, or the mesh file to read; ``target``: the .npz file to write, with
        ``vertices`` and ``faces``, and ``bars`` (n,) where the filler gave error bars.
    emit : callable
        Told of the filler.

    Returns
    -------
    dict
        ``status``: "filled", "not installed", "failed" or "read"; ``reason``; ``seconds`` and
        ``cpu_seconds`` of the filler alone; ``memory``: bytes at its peak beyond what the process
        held before, 0 if not known.
    """
    tell(emit, job["filler"], 0.0)
    if job["filler"] == READING:
        loaded = load_mesh(Path(job["source"]), scratch=Path(job["target"]).parent)
        _store(loaded.meshset, job["target"])
        return {"status": "read", "reason": "", "notes": list(loaded.notes)}
    filler = find_filler(job["filler"])
    try:
        for package in filler.packages:
            importlib.import_module(package)
    except ImportError as error:
        reason = f"{_in_one_line(error)}; pip install 'meshlab-lowrank[peers]'"
        return {"status": "not installed", "reason": reason}
    with np.load(job["source"]) as arrays:
        ms = mesh_set(arrays["vertices"], arrays["faces"], arrays["selected"])
    before = _memory("VmRSS")
    start, cpu_start = time.perf_counter(), time.process_time()
    try:
        filler.run(ms)
    except Exception as error:  # noqa: BLE001  whatever a filler raises is a row of the report
        return {"status": "failed", "reason": _in_one_line(error)}
    seconds, cpu_seconds = time.perf_counter() - start, time.process_time() - cpu_start
    vertices, faces = _store(ms, job["target"])
    if len(faces) == 0 or not np.isfinite(vertices).all():
        reason = "The result has no faces, or coordinates that are not finite."
        return {"status": "failed", "reason": reason}
    return {
        "status": "filled",
        "reason": "",
        "seconds": seconds,
        "cpu_seconds": cpu_seconds,
        "memory": max(0, _memory("VmHWM") - before),
    }


def current_arrays(ms: Any) -> tuple[FloatArray, IntArray]:
    """Give the current mesh of a MeshSet, its transformation applied, without changing it.

    Parameters
    ----------
    ms : pymeshlab.MeshSet

    Returns
    -------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    """
    mesh = ms.current_mesh()
    if not mesh.is_compact():
        copy = pymeshlab.MeshSet(verbose=False)
        copy.add_mesh(mesh)
        mesh = copy.current_mesh()
        mesh.compact()
    faces = np.asarray(mesh.face_matrix(), dtype=np.int64)
    return np.asarray(mesh.transformed_vertex_matrix(), dtype=np.float64), faces


def _store(ms: Any, target: str) -> tuple[FloatArray, IntArray]:
    vertices, faces = current_arrays(ms)
    mesh = ms.current_mesh()
    marks = marks_of(mesh) if mesh.is_compact() else None
    if marks is None:
        np.savez(target, vertices=vertices, faces=faces)
    else:
        np.savez(target, vertices=vertices, faces=faces, bars=marks.error)
    return vertices, faces


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__


def _memory(field: str) -> int:
    """Bytes that the process holds (VmRSS) or held at its peak (VmHWM); 0 if not on Linux."""
    status = Path("/proc/self/status")
    if not status.is_file():
        return 0
    for line in status.read_text().splitlines():
        if line.startswith(field):
            return int(line.split()[1]) * 1024
    return 0
