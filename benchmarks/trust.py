"""Measure how well calibrated detail chooses between the smooth fill and the full detail.

    python -m benchmarks.trust
    python -m benchmarks.trust --held-out --models FOLDER --page trust.md

Small surfaces of many kinds, a few holes in each. A fill is right where its RMS is at most 1.15
times that of the better of detail="none" and detail="full"; on smooth surfaces, tubes and busts
there must be no detail at all. Weak and stochastic relief is compared with CGAL too. Results that
are in the output folder already are not repeated (--fresh starts anew). FOLDER has owl.obj,
igea.ply, koala.obj, armadillo.obj, bumpy-cube.obj and pizza.obj, remeshed evenly here.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pymeshlab

from benchmarks import reliefs as _reliefs  # noqa: F401  (adds them to the details)
from benchmarks.cases import Cell, load_model
from benchmarks.catalogue import BUNDLED, Hole, Model, Shape
from benchmarks.run import Results, run_cell
from benchmarks.runs import Result
from benchmarks.tables import table
from sample_meshes.bodies import BODIES, HEXAGON, torus

NONE, FULL, OURS, PEER = "lowrank-none", "lowrank-full", "lowrank", "cgal"
RIGHT = 1.15
PLAIN = ("smooth", "tube", "bust")  # without detail that repeats
BODIES["tube"] = lambda count, spacing: torus(count, spacing, ratio=6.0)


@dataclass(frozen=True)
class Case:
    """A surface of some kind, with the radii of its holes."""

    kind: str
    model: Model
    radii: tuple[float, ...] = (8.0,)
    places: int = 1


def _shape(
    kind: str,
    body: str,
    detail: str,
    thousands: int,
    wavelength: float = 10.0,
    *radii: float,
    amplitude: float = 0.55,
    seed: int = 0,
    places: int = 1,
) -> Case:
    source = Shape(body, detail, 1000 * thousands, wavelength, amplitude=amplitude, seed=seed)
    return Case(kind, Model(source, "loose"), radii or (8.0,), places)


CASES = [
    _shape("strict", "torus", "bumps", 15, 10, 8, 12),
    _shape("strict", "capsule", "scales", 12, 10, 8, 14),
    _shape("strict", "sphere", "honeycomb", 15, 12, 8, 16),
    _shape("strict", "ring", "woven", 15),
    _shape("strict", "blob", "dimples", 15, 9, 8, 14),
    _shape("strict", "torus", "grooves", 12, 8),
    _shape("strict", "torus", "knurl", 15, 9, 10),
    _shape("strict", "capsule", "bricks", 15),
    _shape("jittered", "torus", "bumps_jittered", 15, 10, 8, 12),
    _shape("jittered", "capsule", "scales_varied", 15, 11, 8, 14),
    _shape("jittered", "blob", "pebbles", 15, 10, places=2),
    _shape("jittered", "capsule", "scales_stretched", 15, 10, 8, 14),
    _shape("stochastic", "blob", "rock", 12, 10, 8, 12, places=2),
    _shape("stochastic", "ellipsoid", "clay", 12, 10, 8, 12, places=2),
    _shape("stochastic", "sphere", "plaster", 12, 10, 8, 12, amplitude=0.25, places=2),
    _shape("two kinds", "capsule", "bumps_beside_clay", 15, places=3),
    _shape("two kinds", "torus", "honeycomb_beside_rock", 15, 11, places=3),
    _shape("two kinds", "capsule", "scales_beside_smooth", 15, places=2),
    _shape("two kinds", "torus", "woven_beside_grooves", 15, places=2),
    _shape("smooth", "blob", "smooth", 12, 10, 8, 14),
    _shape("tube", "tube", "smooth", 12, places=2),
    Case("bust", Model(BUNDLED / "bunny.obj", "real"), places=3),
]
HELD_OUT = [
    _shape("strict", "torus", "rings", 15, 12),
    _shape("strict", "ring", "stars", 15, 12),
    _shape("strict", "capsule", "eggbox", 15, 11, 8, 14),
    _shape("strict", "sphere", "plates", 15, 9, 8, 14),
    _shape("strict", "ring", "braid", 15, 9),
    _shape("strict", "torus", "studs", 15, 9, 10),
    _shape("jittered", "torus", "wrinkles", 15, 9, places=2),
    _shape("jittered", "ellipsoid", "pebbles", 15, 9, 8, 12, seed=5),
    _shape("jittered", "blob", "bumps_jittered", 15, 8, 8, 12, seed=5),
    _shape("stochastic", "blob", "stone", 12, 10, 8, 12, places=2),
    _shape("stochastic", "ellipsoid", "terrain", 12, 10, 8, 14, places=2),
    _shape("stochastic", "sphere", "rock", 12, 10, 8, 14, amplitude=1.0, places=2),
    _shape("two kinds", "torus", "plates_beside_scales", 15, places=2),
    _shape("two kinds", "capsule", "studs_beside_clay", 15, 9, places=2),
    _shape("two kinds", "torus", "bricks_beside_plaster", 15, places=2),
    _shape("smooth", "ellipsoid", "smooth", 12),
    _shape("smooth", "ring", "smooth", 12),
    _shape("tube", "capsule", "smooth", 12),
]
FILES = {  # name: kind, vertices after remeshing, held out
    "owl.obj": ("real", 22_000, False),
    "igea.ply": ("real", 20_000, False),
    "koala.obj": ("bust", 20_000, True),
    "armadillo.obj": ("real", 25_000, True),
    "bumpy-cube.obj": ("real", 20_000, True),
    "pizza.obj": ("real", 25_000, True),
}


def remeshed(source: Path, count: int, folder: Path) -> Path:
    """Remesh a file evenly to about a number of vertices, and keep that."""
    target = folder / f"{source.stem}-even-{count // 1000}k.ply"
    if not target.exists():
        folder.mkdir(parents=True, exist_ok=True)
        meshes = pymeshlab.MeshSet(verbose=False)
        meshes.load_new_mesh(str(source))
        meshes.meshing_remove_duplicate_vertices()
        meshes.meshing_remove_unreferenced_vertices()
        area = meshes.get_geometric_measures()["surface_area"]
        length = pymeshlab.PureValue(math.sqrt(area / count / HEXAGON))
        meshes.meshing_isotropic_explicit_remeshing(
            iterations=10, targetlen=length, checksurfdist=False
        )
        meshes.save_current_mesh(str(target))
    return target


def cases(options: argparse.Namespace) -> Iterator[Case]:
    """Give the cases that the command line asks for."""
    yield from HELD_OUT if options.held_out else CASES
    for name, (kind, count, held_out) in FILES.items():
        file = options.models / name if options.models else None
        if file is not None and file.exists() and held_out == options.held_out:
            source = remeshed(file, count, options.output / "models")
            yield Case(kind, Model(source, "real"), places=3)


def trust_table(rows: dict[str, list[Result]]) -> str:
    """Give the table of all kinds; rows are the results of each."""
    lines = []
    for kind, own in rows.items():
        holes: dict[tuple[str, str, int], dict[str, Result]] = {}
        for row in own:
            holes.setdefault(Results.key(row)[:3], {})[row["filler"]] = row
        found = [hole for hole in holes.values() if {NONE, FULL, OURS} <= hole.keys()]
        errors = [
            {name: row["rms_in_edges"] for name, row in hole.items() if row.get("rms_in_edges")}
            for hole in found
        ]
        sizes: list[dict[str, float]] = [
            each for each in errors if {NONE, FULL, OURS} <= each.keys()
        ]
        if not sizes:
            continue
        better = [each[OURS] / min(each[NONE], each[FULL]) for each in sizes]
        detailed = sum(each[OURS] != each[NONE] for each in sizes)
        smooth = [each[OURS] / each[NONE] for each in sizes]
        peer = [each[OURS] / each[PEER] for each in sizes if PEER in each]
        lines.append(
            [
                kind,
                str(len(sizes)),
                "-" if kind in PLAIN else f"{sum(each <= RIGHT for each in better)}",
                "-" if kind in PLAIN else f"{max(better):.2f}",
                str(detailed),
                f"{_mean(smooth):.2f}",
                f"{_mean(peer):.2f}, {max(peer):.2f}" if peer else "-",
                f"{_mean([hole[OURS]['cpu_seconds'] for hole in found]):.1f}",
            ]
        )
    header = ["kind", "holes", f"within {RIGHT} of the better", "worst", "got detail"]
    return table([*header, "over smooth", "over CGAL, worst", "CPU, s"], lines)


def _mean(numbers: Sequence[float]) -> float:
    return math.exp(sum(map(math.log, numbers)) / len(numbers))


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.trust",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--held-out", action="store_true", help="what is kept back from tuning")
    parser.add_argument("--kinds", nargs="+", help="only these")
    parser.add_argument("--models", type=Path, help="folder of real models")
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/trust"))
    parser.add_argument("--page", type=Path, help="also write the table here")
    parser.add_argument("--time-limit", type=float, default=900.0, help="seconds a run")
    parser.add_argument("--fresh", action="store_true", help="forget earlier results")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for."""
    options = parse(arguments)
    results = Results(options.output, fresh=options.fresh, again=[])
    rows: dict[str, list[Result]] = {}
    for case in cases(options):
        if options.kinds and case.kind not in options.kinds:
            continue
        fillers = [NONE, FULL, OURS, *([PEER] if case.kind == "stochastic" else [])]
        vertices, faces = load_model(case.model)
        for radius in case.radii:
            for place in range(case.places):
                cell = Cell(case.model, Hole(radius), 100 * options.held_out + place)
                name, hole = case.model.name, cell.hole.name
                keys = [(name, hole, cell.seed, filler) for filler in fillers]
                missing = [key[3] for key in keys if key not in results.rows]
                if missing:
                    run_cell(
                        cell,
                        vertices,
                        faces,
                        missing,
                        results=results,
                        time_limit=options.time_limit,
                    )
                rows.setdefault(case.kind, []).extend(
                    results.rows[key] for key in keys if key in results.rows
                )
    page = trust_table(rows)
    print(page)
    if options.page:
        options.page.write_text(page + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
