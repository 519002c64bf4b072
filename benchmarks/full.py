"""Does detail="full" look right, on relief that doesn't repeat?

    python -m benchmarks.full --models FOLDER
    python -m benchmarks.full --models FOLDER --held-out --page full.md --pictures FOLDER

FOLDER has the real models; surfaces with jittered and with random relief are made here. Holes are
punched at places that a seed chooses, and filled with detail="none" and detail="full". A fill looks
right where roughness is 0.7 to 1.25 and the mean dihedral angle 0.75 to 1.2 times the truth's, also
at the rim and inside by themselves, without folds, crossings and spikes. Results that are in the
output folder already are not repeated (--fresh starts anew).
"""

from __future__ import annotations

import argparse
import io
import itertools
import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import meshlab_lowrank
from benchmarks import reliefs as _reliefs  # noqa: F401  (adds them to the details)
from benchmarks.cases import Cell, Problem, load_model, punched
from benchmarks.catalogue import Hole, Model, Shape
from benchmarks.full_figures import Looks, looks, surfaces
from benchmarks.tables import table
from benchmarks.variants import FULL, VARIANTS
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.parameters import Detail
from meshlab_lowrank.report.pictures import Picture, draw
from meshlab_lowrank.report.view import View
from sample_meshes.bodies import HEXAGON

FILES = ("armadillo.obj", "igea.ply", "owl.obj", "pizza.obj")
FILES_HELD_OUT = ("bumpy-cube.obj", "koala.obj")
SHAPES = [
    Shape("blob", "rock", 20_000),
    Shape("sphere", "plaster", 20_000, amplitude=0.25),
    Shape("torus", "bumps_jittered", 20_000),
]
SHAPES_HELD_OUT = [
    Shape("blob", "stone", 20_000),
    Shape("ellipsoid", "pebbles", 20_000, 9.0, seed=5),
    Shape("torus", "wrinkles", 20_000, 9.0),
]
REPEATED = [
    Shape("torus", "scales", 20_000, 12.0),
    Shape("ring", "woven", 20_000),
    Shape("blob", "dimples", 20_000, 9.0),
]
RADII = (8.0, 16.0, 28.0)
SEEDS, SEEDS_HELD_OUT = (0, 1), (100, 101)
LARGEST_SHARE = 0.15  # of the surface that a hole may take
WORST = 1.15  # RMS over the smooth fill's


def models(options: argparse.Namespace) -> Iterator[Model]:
    """Give the models that the command line asks for."""
    held_out = options.held_out
    if options.models and not options.repeated:
        for name in FILES_HELD_OUT if held_out else FILES:
            if (options.models / name).exists():
                yield Model(options.models / name, "real", held_out)
    shapes = SHAPES_HELD_OUT if held_out else SHAPES
    for shape in REPEATED if options.repeated else shapes:
        yield Model(shape, "repeated" if options.repeated else "loose", held_out)


def filled(
    problem: Problem, detail: Detail, variant: str = FULL
) -> tuple[tuple[FloatArray, IntArray], str, float]:
    """Fill the hole of a problem; also why it is smooth, and the seconds it took."""
    started = time.process_time()
    result = meshlab_lowrank.inpaint(
        problem.vertices,
        problem.faces,
        holes=[problem.loop.id],
        closerim=True,
        detail=detail,
        pipeline=VARIANTS[variant][1],
    )
    seconds = time.process_time() - started
    return (result.vertices, result.faces), result.holes[problem.loop.id].reason, seconds


def measured(cell: Cell, problem: Problem, options: argparse.Namespace) -> dict[str, Any]:
    """Fill, measure, and draw if asked."""
    smooth_mesh, truth = surfaces(problem, filled(problem, "none")[0])
    mesh, reason, seconds = filled(problem, options.detail, options.variant)
    fill, _ = surfaces(problem, mesh)
    smooth, full = looks(problem, smooth_mesh, truth), looks(problem, fill, truth)
    if options.pictures:
        name = f"{cell.model.name}-{cell.hole.radius:g}h-{cell.seed}.png"
        options.pictures.mkdir(parents=True, exist_ok=True)
        beside(problem, [smooth_mesh, fill, truth], options.pictures / name)
    return {
        "model": cell.model.name,
        "radius": cell.hole.radius,
        "seed": cell.seed,
        "smooth": asdict(smooth),
        "full": asdict(full),
        "reason": reason,
        "seconds": seconds,
    }


def beside(problem: Problem, parts: Sequence[SurfacePart], file: Path) -> None:
    """Draw surfaces beside one another, as they are and with the part marked."""
    from PIL import Image  # noqa: PLC0415  only here

    view = View.of_loop(problem.vertices, problem.faces, problem.loop.vertices)
    pictures = {
        (row, column): Picture(view, part, marked=row == 1)
        for column, part in enumerate(parts)
        for row in range(2)
    }
    drawn, reason = draw(pictures)
    if reason:
        print(reason, file=sys.stderr)
        return
    images = {key: Image.open(io.BytesIO(data)) for key, data in drawn.items()}
    side = next(iter(images.values())).width
    sheet = Image.new("RGB", (len(parts) * side, 2 * side))
    for (row, column), image in images.items():
        sheet.paste(image, (column * side, row * side))
    sheet.save(file)


def lines(rows: Sequence[dict[str, Any]]) -> list[list[str]]:
    """Give the lines of the table."""
    found = []
    for row in rows:
        smooth, full = Looks(**row["smooth"]), Looks(**row["full"])
        within = full.rms <= WORST * smooth.rms
        found.append(
            [
                row["model"],
                f"{row['radius']:g} h",
                str(row["seed"]),
                f"{smooth.rms:.2f}",
                f"{full.rms / smooth.rms:.2f}",
                f"{smooth.roughness:.2f}",
                f"{full.roughness:.2f}",
                f"{full.dihedral_inside:.2f}",
                f"{full.dihedral_at_rim:.2f}",
                f"{full.folds}, {full.crossings}, {full.spikes}",
                "both"
                if full.right and within
                else "looks"
                if full.right
                else "RMS"
                if within
                else "-",
            ]
        )
    return found


HEADER = (
    "model",
    "radius",
    "seed",
    "smooth RMS, h",
    "RMS over smooth",
    "roughness, smooth",
    "roughness",
    "dihedral inside",
    "dihedral at rim",
    "folds, crossings, spikes",
    "right",
)


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """Give the table of radii: how many look right, and the mean of the RMS over smooth."""
    found = []
    for radius in sorted({row["radius"] for row in rows}):
        own = [row for row in rows if row["radius"] == radius]
        full = [Looks(**row["full"]) for row in own]
        ratios = [each.rms / row["smooth"]["rms"] for each, row in zip(full, own, strict=True)]
        smooth = [Looks(**row["smooth"]).right for row in own]
        right = [each.right for each in full]
        within = [ratio <= WORST for ratio in ratios]
        found.append(
            [
                f"{radius:g} h",
                str(len(own)),
                str(sum(smooth)),
                str(sum(right)),
                str(sum(within)),
                str(sum(a and b for a, b in zip(right, within, strict=True))),
                f"{math.exp(np.log(ratios).mean()):.2f}",
                str(sum(each.flaws > 0 for each in full)),
                f"{np.mean([row['seconds'] for row in own]):.0f}",
            ]
        )
    header = ["radius", "holes", "smooth looks right", "looks right", f"RMS within {WORST}"]
    return table([*header, "both", "RMS over smooth", "with flaws", "CPU, s"], found)


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.full",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--models", type=Path, help="folder of real models")
    parser.add_argument("--only", nargs="+", help="names of models")
    parser.add_argument("--radii", type=float, nargs="+", default=list(RADII))
    parser.add_argument("--seeds", type=int, nargs="+", help="of the places")
    parser.add_argument("--detail", default="full", choices=["full", "calibrated"])
    parser.add_argument("--variant", default=FULL, choices=VARIANTS, help="see benchmarks.variants")
    parser.add_argument("--held-out", action="store_true", help="what is kept back from tuning")
    parser.add_argument("--repeated", action="store_true", help="strictly repeated detail instead")
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/full"))
    parser.add_argument("--page", type=Path, help="also write the tables here")
    parser.add_argument("--pictures", type=Path, help="folder for pictures beside the truth")
    parser.add_argument("--fresh", action="store_true", help="forget earlier results")
    return parser.parse_args(arguments)


def rows_of(options: argparse.Namespace, results: Results) -> Iterator[dict[str, Any]]:
    """Measure what is not known yet, and give everything that the command line asks for."""
    seeds = options.seeds or (SEEDS_HELD_OUT if options.held_out else SEEDS)
    for model in models(options):
        if options.only and model.name not in options.only:
            continue
        vertices, faces = load_model(model)
        radii = [
            radius
            for radius in options.radii
            if np.pi * radius**2 < LARGEST_SHARE * HEXAGON * len(vertices)
        ]
        for radius, seed in itertools.product(radii, seeds):
            cell = Cell(model, Hole(radius), seed)
            row = results.rows.get((model.name, radius, seed))
            if row is None:
                problem = punched(cell, vertices, faces)
                if problem is None:
                    continue
                row = measured(cell, problem, options)
                results.add(row)
            yield row


class Results:
    """The results of a folder: what is known already, and a file that grows."""

    def __init__(self, file: Path, *, fresh: bool) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        self._file = file
        self.rows: dict[tuple[str, float, int], dict[str, Any]] = {}
        if fresh or not file.exists():
            file.write_text("", encoding="utf-8")
        for line in file.read_text(encoding="utf-8").splitlines():
            self._keep(json.loads(line))

    def add(self, row: dict[str, Any]) -> None:
        """Append a result."""
        self._keep(row)
        with self._file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(row) + "\n")

    def _keep(self, row: dict[str, Any]) -> None:
        self.rows[row["model"], row["radius"], row["seed"]] = row


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for."""
    options = parse(arguments)
    file = options.output / f"{options.detail}-{options.variant}.jsonl"
    results = Results(file, fresh=options.fresh)
    rows = []
    for row in rows_of(options, results):
        rows.append(row)
        print(" | ".join([*lines([row])[0], f"{row['seconds']:.0f} s"]), flush=True)
    text = f"{summary(rows)}\n\n{table(HEADER, lines(rows))}\n"
    print(text)
    if options.page:
        options.page.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
