"""Fill holes in the feathers of a real owl, on its own uneven triangles, with default settings.

    python -m benchmarks.feathers FOLDER
    python -m benchmarks.feathers FOLDER --held-out --pictures FOLDER --page feathers.md

The first folder has owl.obj. Ours is compared with the best of MeshLab's fillers, CGAL and MeshFix.
The last columns tell what the triangles of a fill allow: every new vertex of the smooth fill lies
at the nearest point of the true surface there.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.cases import Cell, Problem, load_model, punched_at
from benchmarks.catalogue import MESHLAB, PEERS, Hole, Model
from benchmarks.full import beside
from benchmarks.full_figures import surfaces
from benchmarks.runs import Result, measure_run, run_filler
from benchmarks.tables import table
from meshlab_lowrank.mesh.distance import TriangleIndex

RADIUS = 8.0  # mean edge lengths
PLACES = {
    "belly 1": (-23.4, -20.0, 44.2),
    "belly 2": (-29.2, -17.3, 37.1),
    "belly 3": (-16.5, -14.5, 32.3),
    "wing 1": (-1.4, 3.1, 42.8),
    "wing 2": (-1.4, 0.6, 50.1),
    "wing 3": (-46.7, -4.9, 40.8),
}
PLACES_HELD_OUT = {
    "belly 4": (-23.0, -19.9, 52.1),
    "belly 5": (-30.7, -19.7, 44.4),
    "belly 6": (-14.8, -16.2, 40.8),
}
NONE, OURS = "lowrank-none", "lowrank"


def problems(options: argparse.Namespace) -> Iterator[tuple[str, Problem]]:
    """Punch the holes."""
    model = Model(options.models / "owl.obj", "real", options.held_out)
    vertices, faces = load_model(model)
    for name, point in (PLACES_HELD_OUT if options.held_out else PLACES).items():
        if options.only and name not in options.only:
            continue
        place = int(cKDTree(vertices).query(point)[1])
        problem = punched_at(Cell(model, Hole(RADIUS), 0), vertices, faces, place)
        if problem is not None:
            yield name, problem


def line(name: str, problem: Problem, options: argparse.Namespace) -> list[str]:
    """Fill a hole with all fillers, and draw ours if asked."""
    rows: dict[str, Result] = {}
    for filler in (*options.others, NONE, OURS):
        facts, mesh = run_filler(problem, filler, options.time_limit)
        rows[filler] = measure_run(problem, filler, facts, mesh)
        if mesh is not None and filler == NONE:
            smooth = surfaces(problem, mesh)[0]
            vertices, new = mesh[0].copy(), slice(len(problem.vertices), None)
            truth = problem.truth
            found = TriangleIndex(truth.vertices, truth.faces).closest(vertices[new])
            corners = truth.vertices[truth.faces[found.faces]]
            vertices[new] = np.einsum("pk,pkd->pd", found.barycentric, corners)
            rows["exact"] = measure_run(problem, "exact", facts, (vertices, mesh[1]))
        if mesh is not None and filler == OURS and options.pictures:
            options.pictures.mkdir(parents=True, exist_ok=True)
            fill, truth = surfaces(problem, mesh)
            beside(
                problem, [smooth, fill, truth], options.pictures / f"{name}.png".replace(" ", "")
            )
    others = {
        filler: rows[filler]["rms_in_edges"]
        for filler in options.others
        if rows[filler].get("rms_in_edges")
    }
    best = min(others, key=lambda filler: others[filler])
    ours, exact = rows[OURS], rows["exact"]
    return [
        name,
        f"{others[best]:.2f} ({best})",
        f"{rows[NONE]['rms_in_edges']:.2f}",
        f"{ours['rms_in_edges']:.2f}",
        f"{ours['rms_in_edges'] / others[best]:.2f}",
        f"{ours['roughness']:.2f}",
        f"{rows[NONE]['roughness']:.2f}",
        f"{exact['rms_in_edges'] / others[best]:.2f}",
        f"{exact['roughness']:.2f}",
        f"{ours['cpu_seconds']:.0f}",
    ]


HEADER = (
    "place",
    "best other RMS, h",
    "smooth, h",
    "ours, h",
    "over best other",
    "roughness",
    "of smooth",
    "exact positions, over best other",
    "their roughness",
    "CPU, s",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.feathers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("models", type=Path, help="folder with owl.obj")
    parser.add_argument("--held-out", action="store_true", help="what is kept back from tuning")
    parser.add_argument("--only", nargs="+", help="names of places")
    parser.add_argument("--others", nargs="+", default=[*MESHLAB, *PEERS], help="other fillers")
    parser.add_argument("--page", type=Path, help="also write the table here")
    parser.add_argument("--pictures", type=Path, help="folder for pictures beside the truth")
    parser.add_argument("--time-limit", type=float, default=900.0, help="seconds a run")
    options = parser.parse_args(arguments)
    lines = []
    for name, problem in problems(options):
        lines.append(line(name, problem, options))
        print(" | ".join(lines[-1]), flush=True)
    text = table(HEADER, lines)
    print(text)
    if options.page:
        options.page.write_text(f"{text}\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
