"""Measure what many holes, plain holes and large meshes cost: tables for docs/scaling.md.

    python -m benchmarks.scaling --models FOLDER --scans FOLDER

Every run is a process of its own that loads a file and applies one filter.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pymeshlab

from benchmarks.sheets import one_ring_holes, scattered_holes, sheet
from benchmarks.tables import table
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, edge_lengths
from meshlab_lowrank.threads import THREADS_VARIABLE

CODE = """
import json, sys, time
import pymeshlab
path, task, length = sys.argv[1], sys.argv[2], float(sys.argv[3])
if task in ("calibrated", "none"):
    import meshlab_lowrank

def memory(field):
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) * 1024e-6 for line in lines if line.startswith(field))

ms = pymeshlab.MeshSet(verbose=False)
before = memory("VmRSS")
ms.load_new_mesh(path)
held, wall, cpu = memory("VmRSS") - before, time.perf_counter(), time.process_time()
count = ms.current_mesh().vertex_number()
reasons = {}
if task in ("calibrated", "none"):
    for hole in ms.meshing_inpaint_lowrank(detail=task)["holes"]:
        name = "detail" if hole["trust"] else hole["reason"] or "smooth"
        reasons[name] = reasons.get(name, 0) + 1
else:
    ms.meshing_close_holes(
        maxholesize=1000, selected=False, refinehole=task == "close-refine",
        refineholeedgelen=pymeshlab.PureValue(length),
    )
print(json.dumps({
    "cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall, "held": held,
    "peak": memory("VmHWM") - before, "made": ms.current_mesh().vertex_number() - count,
    "reasons": reasons,
}))
"""


@dataclass(frozen=True)
class Cost:
    """Figures of one process: seconds, megabytes, new vertices and what became of the holes."""

    cpu: float
    wall: float
    held: float
    peak: float
    made: int
    reasons: dict[str, int]


def measure(
    path: Path, task: str, *, length: float = 1.0, threads: int = 1, checkout: Path | None = None
) -> Cost:
    """Load a file and apply one filter, of this package or of another checkout of it."""
    values = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    values[THREADS_VARIABLE] = str(threads)
    command = [sys.executable, "-c", CODE, str(path.absolute()), task, str(length)]
    # the folder in which Python is started comes before what is installed
    done = subprocess.run(
        command, env=os.environ | values, capture_output=True, check=True, cwd=checkout
    )
    cost = Cost(**json.loads(done.stdout.splitlines()[-1]))
    print(path.name, task, threads, "old" if checkout else "", cost, flush=True)
    return cost


def save(path: Path, vertices: FloatArray, faces: IntArray) -> Path:
    """Write a mesh of vertices (n, 3) and faces (m, 3) without attributes."""
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(vertices, faces))
    options = ("save_vertex_color", "save_vertex_quality", "save_vertex_normal")
    ms.save_current_mesh(str(path), **dict.fromkeys(options, False))
    return path


def arrays(path: Path, *, subdivided: bool) -> tuple[FloatArray, IntArray]:
    """Read a mesh, (n, 3) and (m, 3); each face as four of a smooth surface if asked for."""
    ms = pymeshlab.MeshSet(verbose=False)
    ms.load_new_mesh(str(path))
    if subdivided:
        ms.meshing_surface_subdivision_loop(iterations=1, threshold=pymeshlab.PercentageValue(0))
    mesh = ms.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def report(folder: Path, models: Path, scans: Path, *, before: Path | None) -> list[str]:
    """Measure; give the parts of the page."""
    fine = arrays(models / "igea.ply", subdivided=True)
    length = float(edge_lengths(*fine).mean())
    hundred = save(folder / "igea100.ply", *scattered_holes(*fine, 100, 12))
    thousand = save(folder / "igea1000.ply", *scattered_holes(*fine, 1000, 12))
    rings = save(folder / "rings.ply", *one_ring_holes(311, 2000))
    bumps = save(folder / "bumps100.ply", *scattered_holes(*sheet(600_000), 100, 60))
    large = save(folder / "large.ply", *scattered_holes(*sheet(5_000_000), 50, 12))
    del fine
    camel = scans / "camelhead.off"
    lines: list[list[str]] = []

    def add(name: str, cost: Cost, over: str, other: float | None) -> None:
        ratio = "" if other is None else f"{cost.cpu / other:.3f}"
        became = "; ".join(f"{count} {reason}" for reason, count in cost.reasons.items())
        size = [f"{cost.cpu:.2f}", over, ratio, f"{cost.peak:.0f}", f"{cost.peak / cost.held:.2f}"]
        lines.append([name, *size, became])

    for name, path in (("100 holes, 536,000 vertices", hundred), ("1000 holes", thousand)):
        ours, none = measure(path, "calibrated"), measure(path, "none")
        if path == hundred:
            first, theirs = ours, measure(path, "close-refine", length=length)
            add(name, ours, "close with refinement", theirs.cpu)
            if before:
                add(f"{name}, before", measure(path, "none", checkout=before), "no detail", None)
        else:
            add(name, ours, "100 holes", first.cpu)
        add(name, ours, "no detail", none.cpu)
    ours = measure(rings, "calibrated")
    add(f"2000 holes of one ring: {1000.0 * ours.cpu / 2000.0:.1f} ms a hole", ours, "", None)
    ours, none = measure(camel, "calibrated"), measure(camel, "none")
    add("camelhead.off", ours, "no detail", none.cpu)
    if before:
        add("camelhead.off, before", measure(camel, "calibrated", checkout=before), "", None)
    ours = measure(large, "calibrated")
    add("50 holes, 5,000,000 vertices", ours, "", None)
    walls = [measure(bumps, "calibrated", threads=threads) for threads in (1, 2)]
    wall = walls[1].wall / walls[0].wall
    add(
        f"100 holes of repeated detail: wall time of 2 threads over 1: {wall:.2f}",
        walls[1],
        "",
        None,
    )
    new = folder_cpu(scans, folder / "new", None)
    batch = [f"{new:.0f} s"]
    if before:
        old = folder_cpu(scans, folder / "old", before)
        batch.append(f"{old:.0f} s before: {new / old:.3f} of it")
    head = ["case", "CPU, s", "over", "ratio", "peak, MB", "peak over mesh", "holes"]
    return [
        "\n## Many holes, plain ones, large meshes\n",
        table(head, lines),
        f"\nAll scans through `batch`, one worker, CPU time: {'; '.join(batch)}.",
    ]


def folder_cpu(scans: Path, out: Path, checkout: Path | None) -> float:
    """CPU seconds of a batch run over a folder."""
    values = {THREADS_VARIABLE: "1", "OPENBLAS_NUM_THREADS": "1"}
    options = ["--workers", "1", "--no-pictures", "--timeout", "1800"]
    code = "import sys; from meshlab_lowrank.cli import main; sys.exit(main())"
    folders = [str(scans.absolute()), str(out.absolute())]
    command = [sys.executable, "-c", code, "batch", *folders, *options]
    begun = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, env=os.environ | values, capture_output=True, check=False, cwd=checkout)
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return ended.ru_utime + ended.ru_stime - begun.ru_utime - begun.ru_stime
