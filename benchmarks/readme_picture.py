"""Draw fills of one hole side by side: before, each filler, truth.

    python -m benchmarks.readme_picture
    python -m benchmarks.readme_picture --model torus-rope-9h-30ki --hole 16h-round --output x.png

Without options it makes docs/readme_picture.png. Needs matplotlib.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.cases import Cell, Problem, load_model, punched
from benchmarks.catalogue import HOLES, MODELS
from benchmarks.runs import run_filler
from meshlab_lowrank.mesh.geometry import FloatArray, face_normals, normalized, vertex_normals
from meshlab_lowrank.mesh.surface_part import SurfacePart

SURFACE = np.array([0.80, 0.79, 0.76])
FILL = np.array([0.92, 0.78, 0.58])
INSIDE = np.array([0.33, 0.34, 0.38])
LIGHT = normalized(np.array([-0.5, 0.6, 0.8]))
SKY = normalized(np.array([0.8, 0.1, 0.6]))
CAPTIONS = {
    "close-refine": "MeshLab: close holes, refined",
    "lowrank": "meshlab-lowrank",
    "lowrank-full": "meshlab-lowrank, full detail",
}
PANEL = 3.0  # inches
COLOURS = 192  # of the palette, which keeps the file small


def draw(axes: Axes, surface: SurfacePart, problem: Problem, margin: float) -> None:
    """Draw the surroundings of a hole, seen along its normal, the fill in its own colour.

    Parameters
    ----------
    axes : matplotlib Axes
    surface : SurfacePart
    problem : Problem
        Where to look.
    margin : float
        Width shown beyond the rim, in radii of the hole.
    """
    reach = (1.0 + margin) * problem.radius
    frame = frame_of(problem.normal)
    seen = (surface.vertices - problem.centre) @ frame.T
    in_view = (np.abs(seen[:, :2]) < 1.1 * reach).all(axis=1) & (seen[:, 2] > -1.5 * reach)
    kept = np.flatnonzero(in_view[surface.faces].any(axis=1))
    corners = seen[surface.faces[kept]]
    flat = face_normals(surface.vertices, surface.faces)[kept]
    smooth = vertex_normals(surface.vertices, surface.faces)[surface.faces[kept]].mean(axis=1)
    normals = normalized(flat + smooth) @ frame.T
    shade = 0.15 + 0.8 * np.maximum(normals @ LIGHT, 0.0) + 0.2 * np.maximum(normals @ SKY, 0.0)
    colours = np.where(surface.part[kept, None], FILL, SURFACE) * shade[:, None]
    away = (flat @ frame[2]) < 0
    colours[away] = INSIDE * (0.5 + 0.5 * np.abs(normals[away] @ LIGHT))[:, None]
    order = np.argsort(corners[:, :, 2].mean(axis=1), kind="stable")
    colours = colours.clip(0.0, 1.0)[order]
    axes.add_collection(
        PolyCollection(
            list(corners[order][:, :, :2]), facecolors=colours, edgecolors=colours, linewidths=0.3
        )
    )
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_aspect("equal")
    axes.set_axis_off()


def frame_of(normal: FloatArray) -> FloatArray:
    """Give the rows right, up and towards the viewer of a look along a normal."""
    upright = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = normalized(np.cross(upright, normal))
    return np.stack([right, np.cross(normal, right), normal])


def panels(problem: Problem, fillers: Sequence[str], time_limit: float) -> dict[str, SurfacePart]:
    """Give what to draw by caption: before, each fill that worked, truth."""
    nothing = np.zeros(len(problem.faces), dtype=np.bool_)
    shown = {"with a hole": SurfacePart(problem.vertices, problem.faces, nothing)}
    for filler in fillers:
        facts, mesh = run_filler(problem, filler, time_limit)
        if mesh is None:
            print(f"{filler}: {facts['status']}, {facts['reason']}", file=sys.stderr)
            continue
        filled = problem.known.locate(*mesh)
        shown[CAPTIONS.get(filler, filler)] = filled.surface(problem.loop.id)
    shown["truth"] = problem.truth
    return shown


def save(figure: Figure, path: Path) -> None:
    """Save as PNG with a palette."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120)
    path.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(buffer) as picture:
        picture.convert("RGB").quantize(COLOURS).save(path, optimize=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw what the command line asks for."""
    models = {model.name: model for model in MODELS}
    holes = {hole.name: hole for hole in HOLES}
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.readme_picture",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--model", choices=models, default="torus-scales-12h-50ki", metavar="NAME")
    parser.add_argument("--hole", choices=holes, default="16h-irregular", metavar="NAME")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fillers", nargs="+", default=["close-refine", "lowrank"])
    parser.add_argument("--margin", type=float, default=0.9, help="surroundings shown, in radii")
    parser.add_argument("--time-limit", type=float, default=900.0)
    parser.add_argument("--output", type=Path, default=Path("docs/readme_picture.png"))
    options = parser.parse_args(arguments)
    model = models[options.model]
    problem = punched(Cell(model, holes[options.hole], options.seed), *load_model(model))
    if problem is None:
        print("The model has no place for the hole.", file=sys.stderr)
        return 1
    shown = panels(problem, options.fillers, options.time_limit)
    mpl.use("agg")
    figure = Figure(figsize=(PANEL * len(shown), PANEL + 0.3), facecolor="white")
    for number, (caption, surface) in enumerate(shown.items()):
        height = PANEL / (PANEL + 0.3)
        axes = figure.add_axes((number / len(shown), 0, 0.985 / len(shown), height))
        draw(axes, surface, problem, options.margin)
        axes.set_title(caption, fontsize=11)
    save(figure, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
