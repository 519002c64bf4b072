"""What an isolated process does for the comparison: run one filler on one mesh."""

from __future__ import annotations

import importlib
import time
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.comparison.loading import find_filler
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray


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


def perform(job: dict[str, Any]) -> dict[str, Any]:
    """Run a filler and store the mesh that it makes.

    Parameters
    ----------
    job : dict
        ``filler``: name or path; ``source``: an .npz file with ``vertices``, ``faces`` and
        ``selected``; ``target``: the .npz file to write, with ``vertices`` and ``faces``.

    Returns
    -------
    dict
        ``status``: "filled", "not installed" or "failed"; ``reason``; ``seconds`` and
        ``cpu_seconds`` of the filler alone; ``memory``: bytes at its peak beyond what the process
        held before, 0 if not known.
    """
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
    mesh = ms.current_mesh()
    if not mesh.is_compact():
        mesh.compact()
    vertices = np.asarray(mesh.vertex_matrix(), dtype=np.float64)
    faces = np.asarray(mesh.face_matrix(), dtype=np.int64)
    if len(faces) == 0 or not np.isfinite(vertices).all():
        reason = "The result has no faces, or coordinates that are not finite."
        return {"status": "failed", "reason": reason}
    np.savez(job["target"], vertices=vertices, faces=faces)
    return {
        "status": "filled",
        "reason": "",
        "seconds": seconds,
        "cpu_seconds": cpu_seconds,
        "memory": max(0, _memory("VmHWM") - before),
    }


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
