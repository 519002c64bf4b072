"""Measure whether the error bars of fills hold: docs/calibration.md and its plot.

    python -m benchmarks.calibration --models FOLDER
    python -m benchmarks.calibration --held-out --models FOLDER --page docs/calibration.md

Holes of radius 8, 16 and 28 are punched into surfaces of many kinds and filled smoothly, with
calibrated and with full detail; at each new vertex the distance to the true surface is compared
with its bar. Results that are in the output folder already are not repeated (--fresh starts anew).
FOLDER has igea.ply and armadillo.obj, which are held out, and owl.obj, which is not.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import meshlab_lowrank
from benchmarks.calibration_page import page, plot
from benchmarks.cases import Cell, Problem, fits, load_model, punched
from benchmarks.catalogue import BUNDLED, MODELS, Hole, Model
from benchmarks.trust import CASES, HELD_OUT
from meshlab_lowrank.mesh.distance import TriangleIndex

RADII = (8.0, 16.0, 28.0)
MARGIN = 30.0  # edge lengths of the true surface around a hole that errors are measured to
FACTORS = np.round(np.geomspace(0.1, 10.0, 41), 4)  # of bars, for which the coverage is kept
LARGE = {  # models of the catalogue that are large enough for all radii, by how they begin
    False: ("torus-scales-", "capsule-bricks", "torus-scales_varied", "torus-bumps_jittered"),
    True: ("torus-rings", "capsule-eggbox", "torus-wrinkles", "ring-pebbles"),
}
FILES = {False: ("owl.obj",), True: ("igea.ply", "armadillo.obj")}
FIRST_SEED = {False: 0, True: 500}  # places from 500 on were used for nothing else


@dataclass(frozen=True)
class Group:
    """Holes in one model: the radii, how many places, and the radii with detail at the first."""

    model: Model
    radii: tuple[float, ...]
    places: int
    with_detail: tuple[float, ...]


def groups(held_out: bool, models: Path | None) -> Iterator[Group]:
    """Give all holes that are filled."""
    files = [models / name for name in FILES[held_out]] if models else []
    for path in (BUNDLED / "bunny.obj", *files):
        yield Group(Model(path, "real", held_out), RADII, 5, RADII[:2])
    large = [m for m in MODELS if m.held_out == held_out and m.name.startswith(LARGE[held_out])]
    for number, model in enumerate(large):
        yield Group(model, RADII, 3, (RADII[1 + number % 2],))  # detail takes minutes
    kinds = {"strict": "repeated", "jittered": "loose", "stochastic": "loose", "smooth": "smooth"}
    for case in HELD_OUT if held_out else CASES:
        if case.kind in kinds:
            kind: Any = kinds[case.kind]
            detailed = RADII[:1] if case.kind in ("strict", "jittered") else ()
            yield Group(Model(case.model.source, kind, held_out), RADII[:1], 2, detailed)


def measure(problem: Problem, detail: Any) -> dict[str, Any] | None:
    """Fill a hole, and compare its bars with its errors, in mean edge lengths."""
    result = meshlab_lowrank.inpaint(
        problem.vertices, problem.faces, detail=detail, selected_faces=problem.selected
    )
    record = next(hole for hole in result.holes if hole.id == problem.loop.id)
    new = result.new_vertices
    if record.status != "filled" or not new.any():
        return None
    reach = problem.radius + MARGIN * problem.edge_length
    truth = problem.truth.cut_out(problem.centre, reach)
    errors = TriangleIndex(truth.vertices, truth.faces).closest(result.vertices[new]).distances
    bars = result.error[new]
    return {
        "way": "full" if detail == "full" else "detail" if record.trust > 0.0 else "smooth",
        "trust": record.trust,
        "known": bool(np.isfinite(bars).all()),
        "bar": float(bars.mean() / problem.edge_length),
        "square": float((errors**2).mean() / problem.edge_length**2),
        "coverage": [float((errors <= each * bars).mean()) for each in FACTORS.tolist()],
    }


def run(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Fill what is not filled yet; give the results that the command line asks for."""
    options.output.mkdir(parents=True, exist_ok=True)
    file = options.output / "results.jsonl"
    if options.fresh:
        file.unlink(missing_ok=True)
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    done = {row["key"]: row for row in map(json.loads, lines)}
    wanted = []
    for group in groups(options.held_out, options.models):
        loaded = None
        for place in range(group.places):
            for radius in (each for each in group.radii if each in options.radii):
                cell = Cell(group.model, Hole(radius), FIRST_SEED[options.held_out] + place)
                name = f"{group.model.name} {cell.hole.name} {cell.seed}"
                tried = place == 0 and radius in group.with_detail
                details = options.details if tried else options.details[:1]
                keys = {f"{name} {detail}": detail for detail in details}
                wanted += list(keys)
                missing = {key: detail for key, detail in keys.items() if key not in done}
                if not missing:
                    continue
                loaded = loaded or load_model(group.model)
                problem = punched(cell, *loaded) if fits(cell, loaded[0]) else None
                for key, detail in missing.items():
                    found = measure(problem, detail) if problem else None
                    row = {"key": key, "kind": group.model.kind, "radius": radius}
                    done[key] = {**row, **(found or {"way": ""})}
                    print(key, {k: v for k, v in done[key].items() if k != "coverage"}, flush=True)
                    with file.open("a", encoding="utf-8") as stream:
                        stream.write(json.dumps(done[key]) + "\n")
    return [done[key] for key in wanted if done[key]["way"]]


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.calibration",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--held-out", action="store_true", help="what is kept back from tuning")
    parser.add_argument("--models", type=Path, help="folder of real models")
    parser.add_argument("--details", nargs="+", default=["none", "calibrated", "full"])
    parser.add_argument("--radii", nargs="+", type=float, default=RADII)
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/calibration"))
    parser.add_argument("--page", type=Path, help="also write the page here, and the plot beside")
    parser.add_argument("--fresh", action="store_true", help="forget earlier results")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for."""
    options = parse(arguments)
    rows = run(options)
    text = page(rows, FACTORS.tolist(), plot_name="calibration.png")
    print(text)
    if options.page:
        options.page.write_text(text, encoding="utf-8")
        plot(rows, FACTORS.tolist(), options.page.with_name("calibration.png"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
