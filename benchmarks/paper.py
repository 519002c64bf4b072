"""Do the experiments of the paper again, and put the results into a page.

    python -m benchmarks.paper table1 --output docs --models FOLDER
    python -m benchmarks.paper all --output docs --models FOLDER

Each experiment writes its tables between its marks in paper.md of the output folder, and its
pictures beside it. Without ``--models``, a folder with ``armadillo.obj``, the rows of its legs are
left out. Experiments that are asked for together share their fills.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from benchmarks.cases import Problem
from benchmarks.paper_cases import PaperCase, Setting, chain_of, paper_cases
from benchmarks.paper_oracles import Stages, stage_figures
from benchmarks.paper_pictures import draw_normals, draw_strip
from benchmarks.runs import Mesh, Result, measure_run, run_filler
from benchmarks.tables import table
from meshlab_lowrank.comparison.measuring import hausdorff_figures
from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray, vertex_normals
from meshlab_lowrank.mesh.surface_part import SurfacePart

COMPARED = {
    "brunton": "Brunton [8]",
    "pernot": "Pernot [32]",
    "meshfix": "Attene [2]",
    "zou": "Zou [45]",
    "awang": "Awang [4]",
}
SMOOTH = {"base": "smooth fill", "bspline": "B-spline"}
AUTO = {"lowrank": "auto"}
TIME_LIMIT = 900.0
MARGIN = 0.7
PATCH_SIZES, RINGS, PASSES = (20, 50, 100, 200), (2, 4, 6, 8), (1, 3, 7)


@dataclass
class Desk:
    """Where experiments find their cases and leave their results.

    Attributes
    ----------
    cases : dict of str to PaperCase
    output : Path
    fillers : Path
        A folder for fillers that are written on the way.
    """

    cases: dict[str, PaperCase]
    output: Path
    fillers: Path
    _problems: dict[str, Problem] = field(default_factory=dict)
    _fills: dict[tuple[str, str | Setting], tuple[Result, Mesh | None]] = field(
        default_factory=dict
    )

    def problem(self, name: str) -> Problem:
        """Give the punched hole of a case."""
        if name not in self._problems:
            self._problems[name] = self.cases[name].problem()
        return self._problems[name]

    def fill(self, name: str, filler: str | Setting) -> tuple[Result, Mesh | None]:
        """Run a filler of the registry or a setting of preset paper, once; give its figures."""
        if (name, filler) not in self._fills:
            self._fills[name, filler] = self._run(name, filler)
        return self._fills[name, filler]

    def _run(self, name: str, filler: str | Setting) -> tuple[Result, Mesh | None]:
        problem = self.problem(name)
        spec = filler if isinstance(filler, str) else chain_of(filler, self.fillers)
        facts, mesh = run_filler(problem, spec, TIME_LIMIT)
        row = measure_run(problem, str(filler), facts, mesh)
        if mesh is not None:
            row |= hausdorff_figures(mesh, (problem.truth.vertices, problem.truth.faces))
        print(f"{name}, {filler}: {row['status']} {row['reason']}", flush=True)
        return row, mesh

    def surface(self, name: str, filler: str | Setting) -> tuple[Result, SurfacePart | None]:
        """Run a filler; give its figures and the filled surface."""
        row, mesh = self.fill(name, filler)
        problem = self.problem(name)
        if mesh is None:
            return row, None
        return row, problem.known.locate(*mesh).surface(problem.loop.id)

    def put(self, name: str, text: str) -> None:
        """Put text between the marks of an experiment in the page."""
        page = self.output / "paper.md"
        before, begin, rest = page.read_text(encoding="utf-8").partition(f"<!-- {name} -->\n")
        _, end, after = rest.partition(f"<!-- end of {name} -->\n")
        if not begin or not end:
            msg = f"{page} has no marks for {name}."
            raise SystemExit(msg)
        page.write_text(f"{before}{begin}\n{text}\n\n{end}{after}", encoding="utf-8")


def table1(desk: Desk) -> None:
    """Tabulate Hausdorff distances as Table 1 does: models as rows, methods as columns."""
    means, peaks, edges = [], [], []
    for name, case in desk.cases.items():
        ways: dict[str, str | Setting] = {each: each for each in (*COMPARED, *SMOOTH)}
        for base in ("meshlab", "bspline"):
            for refined in (False, True):
                setting = Setting(refined=refined, base=base, iterations=case.iterations)
                ways[f"{base}, {refined}"] = setting
        ways |= {each: each for each in AUTO}
        problem = desk.problem(name)
        diagonal = float(np.linalg.norm(np.ptp(problem.truth.vertices, axis=0)))
        rows = [desk.fill(name, way)[0] for way in ways.values()]
        start = [case.title, str(len(problem.truth.vertices))]
        means.append([*start, *_least([_over(row.get("mean"), diagonal) for row in rows], ".2e")])
        peaks.append([*start, *_least([_over(row.get("max"), diagonal) for row in rows], ".2e")])
        edges.append([*start, *_least([row.get("rms_in_edges") for row in rows], ".3f")])
    ours = ["paper without", "paper with", "on B-spline without", "on B-spline with"]
    header = ["model", "vertices", *COMPARED.values(), *SMOOTH.values(), *ours, *AUTO.values()]
    text = [
        f"{caption}\n\n{table(header, lines)}"
        for caption, lines in (
            ("Mean distance over the diagonal of the bounding box:", means),
            ("Largest distance over the diagonal:", peaks),
            ("Root mean square distance of the fill alone, in mean edge lengths:", edges),
        )
    ]
    desk.put("table1", "\n\n".join(text))


def _over(value: float | None, unit: float) -> float | None:
    return None if value is None else value / unit


def _least(values: Sequence[float | None], kind: str) -> list[str]:
    """Write values, the least with a star, what is missing as a dash."""
    least = min((value for value in values if value is not None), default=None)
    return [
        "-" if value is None else format(value, kind) + ("*" if value == least else "")
        for value in values
    ]


def fig10(desk: Desk) -> None:
    """Draw the fill before, after completion and after refinement."""
    rows = []
    ways: dict[str, str | Setting] = {
        "missing: smooth fill": "base",
        "without refinement": Setting(refined=False),
        "with refinement": Setting(),
    }
    for name in ("bumps", "scale"):
        problem = desk.problem(name)
        shown = {"truth": problem.truth, "with the hole": _open(problem)}
        figures = []
        for title, way in ways.items():
            row, surface = desk.surface(name, way)
            figures.append(f"{row.get('normal_error_degrees', float('nan')):.1f}")
            if surface is not None:
                shown[title] = surface
        rows.append([desk.cases[name].title, *figures])
        draw_strip(desk.output / f"paper_fig10_{name}.jpg", problem, shown, 5, MARGIN)
    desk.put("fig10", table(["normal error of the fill, degrees", *ways], rows))


def fig11(desk: Desk) -> None:
    """Draw normal maps: truth, missing, completed, refined."""
    rows = []
    for name in ("bumps", "scale"):
        problem = desk.problem(name)
        stages = Stages(problem, Setting())
        completed, refined = stages.completed(), stages.refined()
        truth = problem.truth
        shown = {
            "truth": (truth.vertices, truth.faces, vertex_normals(truth.vertices, truth.faces)),
            "missing": _normal_map(stages, stages.smooth),
            "completed": _normal_map(stages, completed),
            "refined": _normal_map(stages, refined),
        }
        draw_normals(desk.output / f"paper_fig11_{name}.jpg", problem, shown, MARGIN)
        angles = [stages.angle(hole) for hole in (stages.smooth, completed, refined)]
        rows.append([desk.cases[name].title, *(f"{angle:.1f}" for angle in angles)])
    header = ["normals against the truth, degrees", "smooth fill", "completed", "refined"]
    desk.put("fig11", table(header, rows))


def _normal_map(stages: Stages, hole: Hole) -> tuple[FloatArray, np.ndarray, FloatArray]:
    return stages.region.to_global(hole.positions), hole.faces, hole.normals


def _open(problem: Problem) -> SurfacePart:
    return SurfacePart(
        problem.vertices, problem.faces, np.zeros(len(problem.faces), dtype=np.bool_)
    )


def side_by_side(figure: str, names: Sequence[str]) -> Callable[[Desk], None]:
    """Give the experiment that draws fills of all methods side by side."""

    def draw_fills(desk: Desk) -> None:
        rows = []
        ours = {"base": "smooth fill", "": "preset paper", "lowrank": "preset auto"}
        ways = {**COMPARED, **ours}
        for name in (each for each in names if each in desk.cases):
            problem = desk.problem(name)
            shown = {"truth": problem.truth, "with the hole": _open(problem)}
            setting = Setting(iterations=desk.cases[name].iterations)
            cells = []
            for way, title in ways.items():
                row, surface = desk.surface(name, way or setting)
                cells.append(_least([row.get("roughness")], ".2f")[0].rstrip("*"))
                if surface is not None:
                    shown[title] = surface
            rows.append([desk.cases[name].title, *cells])
            draw_strip(desk.output / f"paper_{figure}_{name}.jpg", problem, shown, 5, MARGIN)
        header = ["detail energy over the truth's", *ways.values()]
        desk.put(figure, table(header, rows))

    return draw_fills


def fig16(desk: Desk) -> None:
    """Draw and tabulate fills for several sp and r."""
    name = "bumps"
    problem = desk.problem(name)
    smooth = desk.fill(name, "base")[0]["rms_in_edges"]
    shown: dict[str, SurfacePart] = {}
    lines = []
    settings = {f"sp {sp}, r 6": Setting(patchsize=sp, ringnumber=6) for sp in PATCH_SIZES}
    settings |= {f"r {r}, sp 100": Setting(ringnumber=r) for r in RINGS}
    for title, setting in settings.items():
        row, surface = desk.surface(name, setting)
        lines.append([title, *_ratios(row, smooth)])
        if surface is not None:
            shown[title] = surface
    draw_strip(desk.output / "paper_fig16.jpg", problem, shown, 4, 0.5)
    desk.put("fig16", table(["", "RMS over smooth", "normals, degrees", "roughness"], lines))


def siter(desk: Desk) -> None:
    """Tabulate fills of large holes for several S_iter."""
    lines = []
    for name in (each for each in ("leg-big", "big") if each in desk.cases):
        smooth = desk.fill(name, "base")[0]["rms_in_edges"]
        for passes in PASSES:
            row, _ = desk.fill(name, Setting(iterations=passes))
            lines.append([desk.cases[name].title, str(passes), *_ratios(row, smooth)])
    header = ["model", "S_iter", "RMS over smooth", "normals, degrees", "roughness"]
    desk.put("siter", table(header, lines))


def _ratios(row: Result, smooth: float) -> list[str]:
    if row.get("rms_in_edges") is None:
        return ["-", "-", "-"]
    ratio = row["rms_in_edges"] / smooth
    return [f"{ratio:.2f}", f"{row['normal_error_degrees']:.1f}", f"{row['roughness']:.2f}"]


def causes(desk: Desk) -> None:
    """Tabulate what stages make of the normals, and what true ones would make of the fill."""
    lines: list[list[str]] = []
    header: list[str] = []
    for name, case in desk.cases.items():
        figures = stage_figures(desk.problem(name), replace(Setting(), iterations=1))
        header = ["model", *figures]
        lines.append([case.title, *(f"{value:.2f}" for value in figures.values())])
    desk.put("causes", table(header, lines))


EXPERIMENTS: dict[str, Callable[[Desk], None]] = {
    "table1": table1,
    "fig10": fig10,
    "fig11": fig11,
    "fig12": side_by_side("fig12", ["leg"]),
    "fig13": side_by_side("fig13", ["hair"]),
    "fig14": side_by_side("fig14", ["scale"]),
    "fig15": side_by_side("fig15", ["leg-big", "big"]),
    "fig16": fig16,
    "siter": siter,
    "causes": causes,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.paper",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("experiment", nargs="+", choices=[*EXPERIMENTS, "all"])
    parser.add_argument("--output", type=Path, default=Path("docs"), help="folder of paper.md")
    parser.add_argument("--models", type=Path, help="folder with armadillo.obj")
    options = parser.parse_args(arguments)
    chosen = list(EXPERIMENTS) if "all" in options.experiment else options.experiment
    with tempfile.TemporaryDirectory(prefix="meshlab-lowrank-paper-") as folder:
        desk = Desk(paper_cases(options.models), options.output, Path(folder))
        for name in chosen:
            EXPERIMENTS[name](desk)
    return 0


if __name__ == "__main__":
    sys.exit(main())
