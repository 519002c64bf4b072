"""One run: a filler in a process of its own, then its figures."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cases import Problem
from meshlab_lowrank.comparison.figures import error_figures, shape_figures
from meshlab_lowrank.comparison.task import perform
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray

Result = dict[str, Any]
Mesh = tuple[FloatArray, IntArray]

MARGIN = 30.0  # edge lengths of surroundings that are measured with the fill


def run_filler(problem: Problem, filler: str, time_limit: float) -> tuple[Result, Mesh | None]:
    """Run a filler on a problem in a new process.

    Parameters
    ----------
    problem : Problem
    filler : str
        Name in the registry, or path.
    time_limit : float
        Seconds after which the process is ended.

    Returns
    -------
    report : dict
        As of `meshlab_lowrank.comparison.task.perform`; status also "crashed" or "timed out".
    mesh : (vertices, faces) or None
    """
    with tempfile.TemporaryDirectory(prefix="meshlab-lowrank-benchmark-") as name:
        folder = Path(name)
        source, target, report = (folder / part for part in ("in.npz", "out.npz", "report.json"))
        np.savez(source, vertices=problem.vertices, faces=problem.faces, selected=problem.selected)
        call = {"filler": filler, "source": str(source), "target": str(target)}
        command = [sys.executable, "-m", __name__, json.dumps(call), str(report)]
        try:
            ended = subprocess.run(command, timeout=time_limit, capture_output=True, check=False)
        except subprocess.TimeoutExpired:
            return {"status": "timed out", "reason": f"ended after {time_limit:g} s"}, None
        if not report.exists():
            lines = ended.stderr.decode(errors="replace").strip().splitlines()
            reason = lines[-1] if lines else f"exit code {ended.returncode}"
            return {"status": "crashed", "reason": reason}, None
        facts: Result = json.loads(report.read_text(encoding="utf-8"))
        if facts["status"] != "filled":
            return facts, None
        with np.load(target) as arrays:
            return facts, (arrays["vertices"], arrays["faces"])


def measure_run(problem: Problem, filler: str, facts: Result, mesh: Mesh | None) -> Result:
    """Give the flat result of a run, ready for JSON; what is not known is None."""
    cell, length = problem.cell, problem.edge_length
    diagonal = float(np.linalg.norm(np.ptp(problem.vertices, axis=0)))
    row: Result = {
        "model": cell.model.name,
        "kind": cell.model.kind,
        "held_out": cell.model.held_out,
        "hole": cell.hole.name,
        "radius": cell.hole.radius,
        "seed": cell.seed,
        "filler": filler,
        "status": facts["status"],
        "reason": facts["reason"],
        "vertices": len(problem.vertices),
        "boundary_edges": len(problem.loop.vertices),
        "seconds": facts.get("seconds"),
        "cpu_seconds": facts.get("cpu_seconds"),
        "memory_bytes": facts.get("memory"),
    }
    if mesh is None:
        return row
    filled = problem.known.locate(*mesh)
    reach = problem.radius + MARGIN * length
    fill = filled.surface(problem.loop.id).cut_out(problem.centre, reach)
    truth = problem.truth.cut_out(problem.centre, reach)
    if not filled.closed[problem.loop.id]:
        row["status"] = "left open"
    row["known_surface_kept"] = filled.kept
    row["missing_vertices"] = len(problem.truth.vertices) - len(problem.vertices)
    row["new_vertices"] = len(mesh[0]) - len(problem.vertices)
    if not fill.part.any():
        return row
    mine = filled.loop == problem.loop.id
    error = error_figures(fill, truth, length)
    shape = shape_figures(fill, length)
    row |= {
        "rms_in_edges": error.rms / length,
        "max_in_edges": error.maximum / length,
        "rms_over_diagonal": error.rms / diagonal,
        "max_over_diagonal": error.maximum / diagonal,
        "normal_error_degrees": error.normal_error,
        "roughness": error.roughness,
        "dihedral": error.dihedral,
        "looks_right": error.looks_right,
        "rim_angle_degrees": shape.rim_angle,
        "new_faces": shape.faces,
        "flipped": max(shape.flipped, int((filled.turned & mine).sum())),
        "degenerate": shape.degenerate,
        "self_crossing": shape.self_crossing,
    }
    return {name: None if _is_unknown(value) else value for name, value in row.items()}


def _is_unknown(value: object) -> bool:
    return isinstance(value, float) and not math.isfinite(value)


if __name__ == "__main__":
    report = perform(json.loads(sys.argv[1]), lambda _: None)
    Path(sys.argv[2]).write_text(json.dumps(report), encoding="utf-8")
