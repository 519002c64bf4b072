"""Run the benchmark.

    python -m benchmarks.run --models 'torus-*' --holes '16h-*' --seeds 0 1
    python -m benchmarks.run --help

Every run of a filler is a process of its own. Each result is appended to results.jsonl in the
output folder as it comes, one JSON object a line; runs that are there already are not repeated
(--fresh starts anew, --again NAME repeats a filler). results.md has the tables. Models are kept
in benchmarks/.cache, or in the folder that MESHLAB_LOWRANK_BENCHMARK_CACHE names.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path

from benchmarks.cases import Cell, fits, load_model, punched
from benchmarks.catalogue import (
    HELD_OUT_SEEDS,
    HOLES,
    KINDS,
    MESHLAB,
    MODELS,
    OURS,
    PEERS,
    SEEDS,
    Hole,
    Model,
)
from benchmarks.runs import Result, measure_run, run_filler
from benchmarks.tables import report
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray

REPEATED = {"not installed", "failed"}
MESH_SUFFIXES = {".ply", ".obj", ".off", ".stl"}


class Results:
    """The results of a folder: what is known already, and a file that grows."""

    def __init__(self, folder: Path, *, fresh: bool, again: Sequence[str]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._file = folder / "results.jsonl"
        self._table = folder / "results.md"
        self._lock = threading.Lock()
        self.rows: dict[tuple[str, str, int, str], Result] = {}
        if self._file.exists() and not fresh:
            for line in self._file.read_text(encoding="utf-8").splitlines():
                row = json.loads(line)
                if row["status"] not in REPEATED and not matches(row["filler"], again):
                    self.rows[self.key(row)] = row
        self._file.write_text("".join(map(_line, self.rows.values())), encoding="utf-8")

    @staticmethod
    def key(row: Result) -> tuple[str, str, int, str]:
        """What a run is known by."""
        return row["model"], row["hole"], row["seed"], row["filler"]

    def add(self, row: Result) -> None:
        """Append a result; safe from several threads."""
        with self._lock:
            self.rows[self.key(row)] = row
            with self._file.open("a", encoding="utf-8") as stream:
                stream.write(_line(row))

    def write_tables(self) -> str:
        """Write the tables of all results."""
        tables = report(list(self.rows.values()), OURS, MESHLAB)
        self._table.write_text(tables, encoding="utf-8")
        return tables


def _line(row: Result) -> str:
    return json.dumps(row) + "\n"


def matches(name: str, patterns: Sequence[str]) -> bool:
    """Tell whether a name fits one of some shell patterns."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def run_model(
    model: Model,
    holes: Sequence[Hole],
    seeds: Sequence[int],
    fillers: Sequence[str],
    *,
    results: Results,
    time_limit: float,
) -> None:
    """Run all fillers on all holes of a model."""
    wanted = product([model.name], [hole.name for hole in holes], seeds, fillers)
    if all(key in results.rows for key in wanted):
        return
    vertices, faces = load_model(model)
    for hole in holes:
        for seed in seeds:
            cell = Cell(model, hole, seed)
            missing = [
                name for name in fillers if (model.name, hole.name, seed, name) not in results.rows
            ]
            if not missing or not fits(cell, vertices):
                continue
            run_cell(cell, vertices, faces, missing, results=results, time_limit=time_limit)


def run_cell(
    cell: Cell,
    vertices: FloatArray,
    faces: IntArray,
    fillers: Sequence[str],
    *,
    results: Results,
    time_limit: float,
) -> None:
    """Punch one hole and run fillers on it."""
    name = f"{cell.model.name} {cell.hole.name} seed {cell.seed}"
    problem = punched(cell, vertices, faces)
    if problem is None:
        print(f"{name}: no place for the hole", flush=True)
        return
    for filler in fillers:
        facts, mesh = run_filler(problem, filler, time_limit)
        row = measure_run(problem, filler, facts, mesh)
        results.add(row)
        rms = row.get("rms_in_edges")
        shown = "" if rms is None else f", RMS {rms:.3f} h, CPU {row['cpu_seconds']:.1f} s"
        print(f"{name}, {filler}: {row['status']}{shown} {row['reason']}", flush=True)


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.run",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--models", nargs="+", metavar="PATTERN", default=["*"], help="names of models"
    )
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument(
        "--holes", nargs="+", metavar="PATTERN", default=["*"], help="names of holes, as 16h-round"
    )
    parser.add_argument("--fillers", nargs="+", default=[*MESHLAB, *PEERS, *OURS])
    parser.add_argument("--seeds", nargs="+", type=int, help="places (and irregular outlines)")
    parser.add_argument(
        "--held-out",
        action="store_true",
        help="the models and seeds that are kept back from tuning, instead of the others",
    )
    parser.add_argument("--folder", type=Path, help="mesh files to add as models of kind real")
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results"))
    parser.add_argument("--page", type=Path, help="also write the tables here, with the command")
    parser.add_argument("--jobs", type=int, default=1, help="models at a time; 1 for fair times")
    parser.add_argument("--time-limit", type=float, default=900.0, help="seconds a run")
    parser.add_argument("--fresh", action="store_true", help="forget earlier results")
    parser.add_argument(
        "--again", nargs="+", default=[], metavar="PATTERN", help="fillers to repeat"
    )
    parser.add_argument("--list", action="store_true", help="list models and holes, run nothing")
    return parser.parse_args(arguments)


def chosen_models(options: argparse.Namespace) -> list[Model]:
    """Models that the command line asks for."""
    models = list(MODELS)
    if options.folder is not None:
        files = sorted(options.folder.iterdir())
        models += [Model(file, "real") for file in files if file.suffix.lower() in MESH_SUFFIXES]
    return [
        model
        for model in models
        if matches(model.name, options.models)
        and model.kind in options.kinds
        and (model.held_out == options.held_out or (options.folder and model.kind == "real"))
        and (not isinstance(model.source, Path) or model.source.exists())
    ]


def command(options: argparse.Namespace, holes: Sequence[Hole], seeds: Sequence[int]) -> str:
    """Give the command line that makes the results of some options."""
    parts = ["python -m benchmarks.run", *(["--held-out"] if options.held_out else [])]
    if options.folder:
        parts.append("--folder FOLDER")
    names = " ".join(hole.name for hole in holes)
    return " ".join([*parts, f"--holes {names} --seeds {' '.join(map(str, seeds))}"])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for."""
    options = parse(arguments)
    models = chosen_models(options)
    holes = [hole for hole in HOLES if matches(hole.name, options.holes)]
    seeds = options.seeds or (HELD_OUT_SEEDS if options.held_out else SEEDS)
    if not models or not holes:
        print("No model or no hole has such a name; see --list.", file=sys.stderr)
        return 2
    if options.list:
        print("\n".join(f"{model.kind:9} {model.name}" for model in models))
        print("\n".join(f"hole      {hole.name}" for hole in holes))
        return 0
    results = Results(options.output, fresh=options.fresh, again=options.again)
    with ThreadPoolExecutor(options.jobs) as pool:
        futures = [
            pool.submit(
                run_model,
                model,
                holes,
                seeds,
                options.fillers,
                results=results,
                time_limit=options.time_limit,
            )
            for model in models
        ]
        for future in futures:
            future.result()
            tables = results.write_tables()
    if options.page:
        made = f"Made by\n\n    {command(options, holes, seeds)}\n"
        options.page.write_text(f"{tables}\n{made}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
