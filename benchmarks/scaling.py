"""Measure how the cost of a fill grows with the hole and with the rest of the mesh.

    python -m benchmarks.scaling

The mesh is a bumpy sheet; what makes it larger is a second sheet far below, so that the hole and
its surroundings stay the same. Every run is a process of its own; CPU time and peak memory are
those of the filler beyond reading and writing, the least of several runs. The tables go to the
standard output and to docs/scaling.md.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.cases import Cell, Problem
from benchmarks.catalogue import Hole, Model
from benchmarks.runs import Result, run_filler
from benchmarks.tables import table
from meshlab_lowrank.comparison.surface import SurfacePart
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.stage0_boundary_loops import boundary_loops
from sample_meshes.bodies import HEXAGON
from sample_meshes.holes import disc, remove_faces

OURS, MESHLAB = "lowrank", "close-refine"
COPY = "def chain(ms):\n    ms.generate_copy_of_current_mesh()\n"  # what it costs to hold a mesh
FAR = 1000.0
TEXT = """# Cost

Made by

    {command}

CPU time in seconds and peak memory in megabytes of `ms.meshing_inpaint_lowrank()` with its defaults
and of MeshLab's own close with refinement, beyond reading and writing, the least of {repeats}
run(s) each. The hole is round, in a sheet of bumps that repeat after 9 mean edge lengths.
"""


def sheet(count: int) -> tuple[FloatArray, IntArray]:
    """Make a square sheet of bumps, (n, 3) and (m, 3), slightly jittered, with edge length 1."""
    side = round(np.sqrt(count))
    i, j = np.mgrid[:side, :side]
    x, y = j + 0.5 * (i % 2), HEXAGON * i
    corner = (i * side + j)[:-1, :-1]
    a, b, c, d = corner, corner + 1, corner + side, corner + side + 1
    odd = (i % 2 == 1)[:-1, :-1, None]
    faces = np.where(
        odd, np.stack([a, b, d, a, d, c], axis=-1), np.stack([a, b, c, b, d, c], axis=-1)
    )
    jitter = np.random.default_rng(0).uniform(-0.2, 0.2, (2, side, side))
    x, y = x + jitter[0], y + jitter[1]
    wave = 2.0 * np.pi / 9.0
    height = 1.1 * np.sin(wave * x) * np.sin(wave * y)
    return np.stack([x, y, height], axis=-1).reshape(-1, 3), faces.reshape(-1, 3).astype(np.int64)


def problem_of(missing: int, count: int) -> Problem:
    """Punch a hole into the middle of a sheet."""
    vertices, faces = sheet(count)
    radius = float(np.sqrt(missing * HEXAGON / np.pi))
    removed = disc(vertices, faces, vertices.mean(axis=0), radius)
    cut = remove_faces(vertices, faces, removed)
    loops = boundary_loops(cut.vertices, cut.faces)
    loop = min(loops, key=lambda loop: loop.perimeter)
    cell = Cell(Model(Path("sheet"), "repeated"), Hole(radius), 0)
    truth = SurfacePart(vertices, faces, removed)
    return Problem(cell, cut.vertices, cut.faces, loops, loop, truth)


def enlarged(problem: Problem, count: int) -> Problem:
    """Add a second sheet far below, up to a number of vertices in all."""
    before = len(problem.vertices)
    vertices, faces = sheet(count - before)
    vertices = np.concatenate([problem.vertices, vertices - [0.0, 0.0, FAR]])
    return replace(
        problem, vertices=vertices, faces=np.concatenate([problem.faces, faces + before])
    )


def least(problem: Problem, filler: str, options: argparse.Namespace) -> Result:
    """Give the least CPU time and memory of several runs."""
    rows: list[Result] = []
    for _ in range(options.repeats):
        facts, _mesh = run_filler(problem, filler, options.time_limit)
        if facts["status"] != "filled":
            return {"cpu": None, "memory": None}
        rows.append(facts)
    found = {
        "cpu": min(row["cpu_seconds"] for row in rows),
        "memory": min(row["memory"] for row in rows) / 1e6,
    }
    radius = problem.cell.hole.radius
    print(f"{len(problem.vertices)} vertices, {radius:.1f} h, {filler}: {found}", flush=True)
    return found


def number(value: float | None, form: str) -> str:
    """Give a number as text, a dash for one that is not known."""
    return "-" if value is None else format(value, form)


def quotient(one: float | None, other: float | None) -> str:
    """Give a ratio as text."""
    return "-" if one is None or not other else f"{one / other:.2f}"


def by_hole(options: argparse.Namespace) -> str:
    """Table of holes of growing size in one mesh."""
    lines = []
    for missing in options.missing:
        problem = problem_of(missing, options.vertices[0])
        truly = len(problem.truth.vertices) - len(problem.vertices)
        ours, theirs = (least(problem, name, options) for name in (OURS, MESHLAB))
        each = None if ours["cpu"] is None else 1000.0 * ours["cpu"] / truly
        lines.append(
            [
                str(truly),
                number(ours["cpu"], ".2f"),
                number(theirs["cpu"], ".2f"),
                quotient(ours["cpu"], theirs["cpu"]),
                number(each, ".2f"),
                number(ours["memory"], ".0f"),
                number(theirs["memory"], ".0f"),
            ]
        )
    header = [
        "missing vertices",
        "CPU, s",
        "MeshLab's CPU, s",
        "ratio",
        "ms a missing vertex",
        "memory, MB",
        "MeshLab's memory, MB",
    ]
    return table(header, lines)


def by_mesh(options: argparse.Namespace) -> str:
    """Table of one hole in meshes of growing size."""
    lines = []
    small = problem_of(options.hole, options.vertices[0])
    first: float | None = None
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "copy.py")
        copy.write_text(COPY, encoding="utf-8")
        for count in options.vertices:
            more = count > 1.1 * len(small.vertices)
            problem = enlarged(small, count) if more else small
            ours, theirs, held = (
                least(problem, name, options) for name in (OURS, MESHLAB, str(copy))
            )
            first = ours["cpu"] if first is None else first
            lines.append(
                [
                    str(len(problem.vertices)),
                    number(ours["cpu"], ".2f"),
                    quotient(ours["cpu"], first),
                    number(theirs["cpu"], ".2f"),
                    number(ours["memory"], ".0f"),
                    number(theirs["memory"], ".0f"),
                    number(held["memory"], ".0f"),
                ]
            )
    header = [
        "vertices of the mesh",
        "CPU, s",
        "over the smallest",
        "MeshLab's CPU, s",
        "memory, MB",
        "MeshLab's memory, MB",
        "pymeshlab holds the mesh in, MB",
    ]
    return table(header, lines)


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.scaling",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--vertices", nargs="+", type=int, default=[70_000, 1_000_000])
    parser.add_argument("--missing", nargs="+", type=int, default=[200, 800, 2500, 10_000])
    parser.add_argument("--hole", type=int, default=800, help="missing vertices, for the meshes")
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--time-limit", type=float, default=600.0, help="seconds a run")
    parser.add_argument("--page", type=Path, default=Path("docs/scaling.md"))
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = parse(given)
    command = " ".join(["python -m benchmarks.scaling", *given])
    parts = [
        TEXT.format(command=command, repeats=options.repeats),
        f"## Growing holes, in a mesh of {options.vertices[0]} vertices\n",
        by_hole(options) + "\n",
        f"## A hole of about {options.hole} missing vertices, in growing meshes\n",
        by_mesh(options),
    ]
    page = "\n".join(parts) + "\n"
    print(page)
    options.page.write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
