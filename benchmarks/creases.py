"""Fill holes across the sharp edges of generated parts, and write how well these are joined.

    python -m benchmarks.creases
    python -m benchmarks.creases --radii 8 --noise 0 --pictures crease_pictures

The parts are those of `sample_meshes/parts.py`, the fillers those of the registry in
`meshlab_lowrank/comparison/fillers.py`. The page is docs/creases.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import geometric_mean

import numpy as np

from benchmarks.cases import Cell, Problem
from benchmarks.catalogue import Hole, Model
from benchmarks.part_figures import PartFigures, part_figures
from benchmarks.part_pictures import draw_parts
from benchmarks.runs import run_filler
from benchmarks.tables import table
from meshlab_lowrank import inpaint
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.parameters import Continuity
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from sample_meshes.holes import remove_faces
from sample_meshes.parts import PARTS, Part

OTHERS = ("close", "close-refine", "close-remesh-smooth", "cgal", "meshfix")
TEXT = """# Holes across sharp edges

Parts whose creases cross a hole, generated, so that what was cut out is known. Made by

    {command}

The radius of the hole and all figures but angles are in mean edge lengths (h): the same part meshed
coarsely is a small hole, meshed finely a large one. Noise is Gaussian, in h, on all vertices;
fills are compared with the part without it. Under the names of fillers stands the RMS of the
two-sided distance to what was cut out. "smooth" is this package with `continuity="smooth"`, as if
there were no creases; "over others" our RMS over that of the best of the fillers right of it. The
angle is how far the median angle between the normals along the joined crease is from the true one,
the place how far the crease is off at most.
"""

Filled = tuple[FloatArray, IntArray]


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--parts", nargs="*", choices=sorted(PARTS), default=list(PARTS))
    add("--radii", nargs="*", type=float, default=[4.0, 14.0, 28.0])
    add("--noise", nargs="*", type=float, default=[0.0, 0.02])
    add("--fillers", nargs="*", default=list(OTHERS))
    add("--time-limit", type=float, default=120.0, help="seconds for each filler")
    add("--page", type=Path, default=Path("docs/creases.md"))
    add("--pictures", type=Path, help="folder for a picture of each part beside the truth")
    return parser.parse_args(arguments)


def problem_of(part: Part, radius: float, noise: float) -> Problem:
    """Cut the hole into a part with noise."""
    noisy = part.noisy(noise)
    cut = remove_faces(noisy, part.faces, part.removed)
    loops = boundary_loops(cut.vertices, cut.faces)
    reach = [np.linalg.norm(cut.vertices[loop.vertices], axis=1).max() for loop in loops]
    cell = Cell(Model(Path(part.name), "smooth"), Hole(radius), 0)
    truth = SurfacePart(part.vertices, part.faces, part.removed)
    loop = loops[int(np.argmin(reach))]
    return Problem(cell, cut.vertices, cut.faces, loops, loop, truth)


def ours(problem: Problem, continuity: Continuity) -> tuple[Filled, int]:
    """Fill the hole by this package; give the number of joined creases too."""
    number = problem.loop.id
    result = inpaint(
        problem.vertices,
        problem.faces,
        holes=[number],
        closerim=True,
        continuity=continuity,
        detail="none",
    )
    return (result.vertices, result.faces), result.holes[number].creases


def row_of(
    name: str, part: Part, radius: float, noise: float, arguments: argparse.Namespace
) -> tuple[list[str], PartFigures, list[float]]:
    """Run all fillers on one hole; give the row of the table, our figures and others' RMS."""
    problem = problem_of(part, radius, noise)
    filled, creases = ours(problem, "auto")
    mine = part_figures(part, problem, filled)
    smooth = part_figures(part, problem, ours(problem, "smooth")[0])
    others = []
    for filler in arguments.fillers:
        _, mesh = run_filler(problem, filler, arguments.time_limit)
        others.append(np.nan if mesh is None else part_figures(part, problem, mesh).rms)
    if arguments.pictures:
        file = f"{name.replace(' ', '_')}_{radius:g}_{noise:g}.png".replace(",", "")
        draw_parts(arguments.pictures / file, part, problem, filled)
    best = float(np.nanmin(others)) if np.isfinite(others).any() else np.nan
    cells = [name, f"{radius:g}", f"{noise:g}", str(creases), f"{mine.rms:.3f}"]
    cells += [f"{mine.rms / best:.2f}", f"{mine.angle:.1f}", f"{mine.place:.2f}"]
    cells += [f"{smooth.rms:.3f}", *(f"{rms:.3f}" for rms in others)]
    return cells, mine, others


def main(arguments: Sequence[str] | None = None) -> None:
    """Run everything and write the page."""
    parsed = parse(arguments)
    if parsed.pictures:
        parsed.pictures.mkdir(parents=True, exist_ok=True)
    rows, ratios = [], []
    for name in parsed.parts:
        for radius in parsed.radii:
            part = PARTS[name](radius)
            for noise in parsed.noise:
                cells, mine, others = row_of(name, part, radius, noise, parsed)
                rows.append(cells)
                ratios.append(max(mine.rms, 1e-4) / float(np.nanmin(others)))
                sys.stderr.write(" | ".join(cells) + "\n")
    header = ["part", "radius", "noise", "joined", "ours", "over others", "angle, °", "place"]
    radii, noise = (" ".join(f"{x:g}" for x in given) for given in (parsed.radii, parsed.noise))
    command = f"python -m benchmarks.creases --radii {radii} --noise {noise}"
    summary = (
        f"Over others: {geometric_mean(ratios):.3f} (geometric mean), at most {max(ratios):.2f}."
    )
    text = TEXT.format(command=command)
    body = table([*header, "smooth", *parsed.fillers], rows)
    parsed.page.write_text(f"{text}\n{body}\n\n{summary}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
