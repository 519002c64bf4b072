"""Measure what the triangulation does to a fill: one hole in one surface, meshed in many ways.

    python -m benchmarks.levels
    python -m benchmarks.levels --edges 12.5 25 50 100 --page levels.md

Each surface is made anew with 12.5, 25, ... edges a repeat, and, at 12.5, decimated by curvature to
half its faces, and with a third of its faces split in four where a field of random waves is high.
RMS is in 0.00001 of the diagonal of the surface, so that it does not change with the edges; means
are geometric.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pymeshlab
from scipy.spatial import cKDTree

from benchmarks.cases import Cell, Problem, load_model, punched_at
from benchmarks.catalogue import Hole, Model, Shape
from benchmarks.runs import measure_run, run_filler
from benchmarks.tables import table
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, edge_lengths
from sample_meshes.triangles import mean_edge

COARSE = 12.5
COUNT = 14_000
AMPLITUDE = 0.7
RADIUS = 8.0
TUNED = [("torus", "dimples"), ("torus", "scales")]
HELD_OUT = [("ring", "stars"), ("torus", "studs")]
_WAVES = 12


@dataclass(frozen=True)
class Meshing:
    """One way in which a surface is meshed; lengths are in edges of the coarse, even one."""

    name: str
    vertices: FloatArray
    faces: IntArray


def shape(body: str, detail: str, edges: float) -> tuple[FloatArray, IntArray]:
    """Make a surface with so many edges a repeat, in the units of that with `COARSE`."""
    ratio = edges / COARSE
    source = Shape(
        body, detail, round(COUNT * ratio**2), edges, "regular", amplitude=AMPLITUDE * ratio
    )
    vertices, faces = load_model(Model(source, "repeated"))
    return vertices / ratio, faces


def meshings(body: str, detail: str, edges: Sequence[float]) -> Iterator[Meshing]:
    """Give one surface in all its triangulations."""
    for each in edges:
        yield Meshing(f"{each:g} edges", *shape(body, detail, each))
    vertices, faces = shape(body, detail, COARSE)
    yield Meshing("decimated", *_decimated(vertices, faces))
    yield Meshing("uneven", *_uneven(vertices, faces))


def _decimated(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=len(faces) // 2, qualitythr=0.3, preservetopology=True
    )
    meshes.current_mesh().compact()
    return _arrays(meshes)


def _uneven(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    chance = np.random.default_rng(0)
    waves = chance.normal(size=(3, _WAVES)) * 2.0 * np.pi / 20.0
    middle = vertices[faces].mean(axis=1)
    field = np.cos(middle @ waves + chance.uniform(0.0, 2.0 * np.pi, _WAVES)).sum(axis=1)
    meshes = pymeshlab.MeshSet(verbose=False)
    chosen = (field > np.quantile(field, 2.0 / 3.0)).astype(np.float64)
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces, f_scalar_array=chosen))
    for _ in range(2):
        meshes.compute_selection_by_condition_per_face(condselect="fq > 0.5")
        meshes.meshing_surface_subdivision_midpoint(
            iterations=1, threshold=pymeshlab.PureValue(0.0), selected=True
        )
    return _arrays(meshes)


def _arrays(meshes: pymeshlab.MeshSet) -> tuple[FloatArray, IntArray]:
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def measured(
    body: str, detail: str, options: argparse.Namespace
) -> Iterator[tuple[str, list[list[float]]]]:
    """Give the figures of each meshing of a surface: missing, RMS of ours and smooth, CPU."""
    coarse, _ = shape(body, detail, COARSE)
    order = np.random.default_rng(options.seed).permutation(len(coarse))
    meshes = list(meshings(body, detail, options.edges))
    model = Model(Shape(body, detail, COUNT, COARSE, "regular"), "repeated")
    found: list[list[list[float]]] = [[] for _ in meshes]
    for place in coarse[order]:
        problems = [_problem(model, mesh, place) for mesh in meshes]
        whole = [problem for problem in problems if problem is not None]
        if len(whole) < len(meshes):
            continue
        for figures, problem in zip(found, whole, strict=True):
            ours, smooth = (
                measure_run(problem, filler, *run_filler(problem, filler, options.time_limit))
                for filler in ("lowrank", "lowrank-none")
            )
            names = ("missing_vertices", "rms_over_diagonal", "cpu_seconds")
            missing, error, cpu = (float(ours[name]) for name in names)
            figures.append([missing, error, float(smooth["rms_over_diagonal"]), cpu])
        if len(found[0]) == options.places:
            break
    for mesh, figures in zip(meshes, found, strict=True):
        lengths = edge_lengths(mesh.vertices, mesh.faces)
        yield f"{mesh.name} (variation {lengths.std() / lengths.mean():.2f})", figures


def _problem(model: Model, mesh: Meshing, place: FloatArray) -> Problem | None:
    """Punch the hole that has its centre nearest to a place."""
    centre = int(cKDTree(mesh.vertices).query(place)[1])
    hole = Hole(RADIUS / mean_edge(mesh.vertices, mesh.faces))
    return punched_at(Cell(model, hole, 0), mesh.vertices, mesh.faces, centre)


def page(options: argparse.Namespace) -> str:
    """Measure everything and give the table."""
    lines = []
    for body, detail in HELD_OUT if options.held_out else TUNED:
        reference: list[float] = []
        for name, figures in measured(body, detail, options):
            missing, ours, smooth, cpu = (_mean(column) for column in zip(*figures, strict=True))
            reference = reference or [missing, ours, cpu]
            lines.append(
                [
                    f"{body}, {detail}",
                    name,
                    f"{missing:.0f}",
                    ", ".join(f"{1e5 * place[1]:.0f}" for place in figures),
                    f"{1e5 * ours:.0f}",
                    f"{1e5 * smooth:.0f}",
                    f"{ours / reference[1]:.2f}",
                    f"{missing / reference[0]:.1f}",
                    f"{cpu / reference[2]:.1f}",
                ]
            )
            print(" | ".join(lines[-1]), flush=True)
    header = ["surface", "meshing", "missing", "RMS at each place", "mean", "smooth"]
    return table([*header, "RMS over that at 12.5", "missing over that", "CPU over that"], lines)


def _mean(numbers: Sequence[float]) -> float:
    return math.exp(sum(map(math.log, numbers)) / len(numbers))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.levels",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--edges", type=float, nargs="+", default=[12.5, 25.0, 50.0])
    parser.add_argument("--places", type=int, default=3, help="holes in each surface")
    parser.add_argument("--seed", type=int, default=0, help="of the places")
    parser.add_argument("--held-out", action="store_true", help="what is kept back from tuning")
    parser.add_argument("--time-limit", type=float, default=900.0, help="seconds a run")
    parser.add_argument("--page", type=Path, help="also write the table here")
    options = parser.parse_args(arguments)
    text = page(options)
    if options.page:
        options.page.write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
