"""Measure how the cost of a fill grows with the hole and with the rest of the mesh.

    python -m benchmarks.scaling

The mesh is a bumpy sheet; what makes it larger is a second sheet far below, so that the hole and
its surroundings stay the same. Every run is a process of its own that loads a file and applies one
filter. The tables go to the standard output and to docs/scaling.md.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path

import numpy as np
import pymeshlab

import meshlab_lowrank  # noqa: F401  binds the filters
from benchmarks import many_holes
from benchmarks.sheets import WAVELENGTH, sheet
from benchmarks.tables import table
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from sample_meshes.bodies import HEXAGON
from sample_meshes.holes import disc, remove_faces

OURS, MESHLAB = "ours", "meshlab"
FAR = 1000.0
TEXT = """# Cost

Made by

    {command}

CPU time in seconds of `ms.meshing_inpaint_lowrank()` with its defaults and of MeshLab's
`ms.meshing_close_holes(refinehole=True)` with the edge length of the surroundings, beyond reading
the file. Memory is resident memory in megabytes, beyond that of the process before it reads the
file: what the mesh takes once it is read, and the peak until the filter is done. Each run is a
process of its own, with one thread for numerical libraries; ours are the least figures of {repeats}
runs. The hole is round, in a sheet of bumps that repeat after {wavelength:g} mean edge lengths.
"""


@dataclass(frozen=True)
class Run:
    """Figures of one process.

    Attributes
    ----------
    cpu : float
        Seconds that the filter took.
    held : float
        Megabytes of the mesh.
    peak : float
        Most megabytes that were taken until the filter was done.
    made : int
        Vertices that the filter made.
    """

    cpu: float
    held: float
    peak: float
    made: int


def punched(missing: int, count: int, total: int) -> tuple[FloatArray, IntArray, int]:
    """Punch a hole into the middle of a sheet, and add another sheet up to a number of vertices.

    Returns
    -------
    vertices, faces : (n, 3) float64, (m, 3) int64
    missing : int
        Number of vertices that were cut out.
    """
    vertices, faces = sheet(count)
    radius = float(np.sqrt(missing * HEXAGON / np.pi))
    cut = remove_faces(vertices, faces, disc(vertices, faces, vertices.mean(axis=0), radius))
    removed = len(vertices) - len(cut.vertices)
    if total <= count:
        return cut.vertices, cut.faces, removed
    more, more_faces = sheet(total - count)
    return (
        np.concatenate([cut.vertices, more - [0.0, 0.0, FAR]]),
        np.concatenate([cut.faces, more_faces + len(cut.vertices)]),
        removed,
    )


def measure(path: str, task: str, edges: int) -> Run:
    """Load a file and fill its holes of up to a number of edges, in this process."""
    ms = pymeshlab.MeshSet(verbose=False)
    before = memory("VmRSS")
    ms.load_new_mesh(path)
    held = memory("VmRSS") - before
    count = ms.current_mesh().vertex_number()
    start = time.process_time()
    if task == OURS:
        ms.meshing_inpaint_lowrank(maxholesize=edges)
    else:
        length = pymeshlab.PureValue(1.0)
        ms.meshing_close_holes(
            maxholesize=edges + 1, selected=False, refinehole=True, refineholeedgelen=length
        )
    cpu = time.process_time() - start
    made = ms.current_mesh().vertex_number() - count
    return Run(cpu, held, memory("VmHWM") - before, made)


def memory(field: str) -> float:
    """Read what the process holds (VmRSS) or held at its peak (VmHWM), in megabytes; Linux only."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) * 1024e-6 for line in lines if line.startswith(field))


class Bench:
    """Runs both fillers on sheets with a hole, each run in a process of its own.

    Parameters
    ----------
    folder : Path
        For the meshes.
    repeats : int
        Runs of ours of which the least figures count; MeshLab, which takes minutes, runs once.
    """

    def __init__(self, folder: Path, repeats: int) -> None:
        self._folder = folder
        self._repeats = repeats

    def run(self, missing: int, count: int, total: int) -> tuple[int, dict[str, Run]]:
        """Give the true number of missing vertices, and the figures of each filler."""
        vertices, faces, removed = punched(missing, count, total)
        edges = 4 * round(np.sqrt(np.pi * HEXAGON * missing))  # of the hole, and a margin
        path = self._folder / "sheet.ply"
        ms = pymeshlab.MeshSet(verbose=False)
        ms.add_mesh(pymeshlab.Mesh(vertices, faces))
        ms.save_current_mesh(str(path), save_vertex_color=False, save_vertex_quality=False)
        del ms
        found = {}
        for task, repeats in ((OURS, self._repeats), (MESHLAB, 1)):
            runs = [self._process(path, task, edges) for _ in range(repeats)]
            if min(run.made for run in runs) < 0.5 * removed:
                msg = f"{task} left a hole of {removed} vertices open."
                raise RuntimeError(msg)
            fields = zip(*(astuple(run) for run in runs), strict=True)
            found[task] = Run(*(min(values) for values in fields))
            print(f"{len(vertices)} vertices, {removed} missing, {task}: {found[task]}", flush=True)
        return removed, found

    @staticmethod
    def _process(path: Path, task: str, edges: int) -> Run:
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        command = [sys.executable, "-m", "benchmarks.scaling", "--one", str(path), task, str(edges)]
        ended = subprocess.run(command, env=os.environ | threads, capture_output=True, check=True)
        return Run(**json.loads(ended.stdout.splitlines()[-1]))


def by_hole(bench: Bench, holes: Sequence[int], count: int) -> str:
    """Table of holes of growing size in one mesh."""
    lines = []
    for missing in holes:
        removed, found = bench.run(missing, count, count)
        ours, theirs = found[OURS], found[MESHLAB]
        lines.append(
            [
                str(removed),
                f"{ours.cpu:.2f}",
                f"{theirs.cpu:.2f}",
                f"{ours.cpu / theirs.cpu:.2f}",
                f"{1000.0 * ours.cpu / removed:.2f}",
                f"{ours.peak:.0f}",
                f"{theirs.peak:.0f}",
            ]
        )
    return table(
        [
            "missing vertices",
            "CPU, s",
            "MeshLab's CPU, s",
            "ratio",
            "ms a missing vertex",
            "peak, MB",
            "MeshLab's peak, MB",
        ],
        lines,
    )


def by_mesh(bench: Bench, holes: Sequence[int], count: int, totals: Sequence[int]) -> str:
    """Table of the same holes in meshes of growing size."""
    lines = []
    for missing in holes:
        first = None
        for total in (count, *totals):
            removed, found = bench.run(missing, count, total)
            ours, theirs = found[OURS], found[MESHLAB]
            first = first or ours
            lines.append(
                [
                    str(removed),
                    str(total),
                    f"{ours.cpu:.2f}",
                    f"{ours.cpu / first.cpu:.2f}",
                    f"{theirs.cpu:.2f}",
                    f"{ours.held:.0f}",
                    f"{ours.peak:.0f}",
                    f"{ours.peak / ours.held:.2f}",
                    f"{theirs.peak:.0f}",
                ]
            )
    return table(
        [
            "missing vertices",
            "vertices of the mesh",
            "CPU, s",
            "over the smallest",
            "MeshLab's CPU, s",
            "mesh, MB",
            "peak, MB",
            "peak over mesh",
            "MeshLab's peak, MB",
        ],
        lines,
    )


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.scaling",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--vertices", type=int, default=70_000, help="of the sheet of ordinary size")
    add("--holes", nargs="*", type=int, default=[200, 800], help="missing vertices in that sheet")
    add("--enlarged", nargs="*", type=int, default=[1_000_000], help="vertices with a second sheet")
    add("--large", type=int, default=150_000, help="vertices of the sheet for growing holes")
    add("--growing", nargs="*", type=int, default=[200, 800, 2500, 5000, 10_000])
    add("--repeats", type=int, default=2)
    add("--models", type=Path, metavar="FOLDER", help="with igea.ply: many holes are measured too")
    add("--scans", type=Path, metavar="FOLDER", help="files with real holes, for the same")
    add("--before", type=Path, metavar="FOLDER", help="older checkout to measure beside this one")
    add("--page", type=Path, default=Path("docs/scaling.md"))
    add("--one", nargs=3, metavar=("FILE", "TASK", "EDGES"), help="make a single run, and print it")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = parse(given)
    if options.one:
        path, task, edges = options.one
        print(json.dumps(asdict(measure(path, task, int(edges)))))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), options.repeats)
        parts = [
            TEXT.format(
                command=" ".join(["python -m benchmarks.scaling", *given]),
                repeats=options.repeats,
                wavelength=WAVELENGTH,
            ),
            "## The same hole in growing meshes\n",
            by_mesh(bench, options.holes, options.vertices, options.enlarged),
            f"\n## Growing holes in a mesh of {options.large} vertices\n",
            by_hole(bench, options.growing, options.large),
        ]
        if options.models and options.scans:
            parts += many_holes.report(
                Path(folder), options.models, options.scans, before=options.before
            )
    page = "\n".join(parts) + "\n"
    print(page)
    options.page.write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
