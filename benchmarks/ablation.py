"""Switch the parts of preset auto back, one at a time, and write what each is worth.

    python -m benchmarks.ablation
    python -m benchmarks.ablation --models knurl --variants auto svt --page /dev/null

The models, holes and seeds are those of the catalogue, the runs those of benchmarks.run; results
that are in the output folder already are not repeated (--fresh starts anew). The page is
docs/ablation.md.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from statistics import median

from benchmarks.catalogue import HOLES, MODELS
from benchmarks.run import Results, matches, run_model
from benchmarks.runs import Result
from benchmarks.tables import table, text, values
from benchmarks.variants import FULL, VARIANTS

REFERENCES = {
    "lowrank-none": "auto without detail: the faired base",
    "paper": "preset paper",
    "close-refine": "MeshLab: close with refinement",
}
CHAIN = '''"""Preset auto, {title}."""

from benchmarks.variants import run_variant


def chain(ms):
    run_variant(ms, "{name}")
'''
TEXT = """# What each part of the auto preset is worth

Each row switches one part of `preset="auto"` back to the paper's, or off, and leaves the rest.
Made by

    {command}

RMS is the distance to what was cut out, in mean edge lengths (h), for each model; "over auto" the
geometric mean over the models of its ratio to the first row. Normal error in degrees, roughness
(detail energy over that of the truth, 1 is right) and CPU time are medians over the models. Holes
are those of the [benchmark](../benchmarks/README.md), seeds {seeds}. Detail is calibrated, as by
default: what fake holes don't confirm is scaled down, so that where the loss of a part ruins the
detail, the error is that of the smooth fill. The variants are values of one pipeline in
`benchmarks/variants.py`.
"""


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.ablation",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--models", nargs="+", default=["bumps", "scales", "weave", "knurl"])
    parser.add_argument("--holes", nargs="+", default=["8h-round"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--variants", nargs="+", metavar="PATTERN", default=["*"])
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/ablation"))
    parser.add_argument("--page", type=Path, default=Path("docs/ablation.md"))
    parser.add_argument("--jobs", type=int, default=1, help="models at a time; 1 for fair times")
    parser.add_argument("--time-limit", type=float, default=900.0, help="seconds a run")
    parser.add_argument("--fresh", action="store_true", help="forget earlier results")
    return parser.parse_args(arguments)


def chains(folder: Path, patterns: Sequence[str]) -> dict[str, str]:
    """Write a filler for each variant; give the title of each by its path."""
    folder.mkdir(parents=True, exist_ok=True)
    titles = {}
    for name, (title, _) in VARIANTS.items():
        if name == FULL or matches(name, patterns):
            path = folder / f"{name}.py"
            path.write_text(CHAIN.format(title=title, name=name), encoding="utf-8")
            titles[str(path)] = title
    return titles


def ablation_table(rows: Sequence[Result], titles: dict[str, str], models: Sequence[str]) -> str:
    """Give the table of one hole."""
    found = {name: [row for row in rows if row["filler"] == name] for name in titles}
    full = next(iter(found.values()))
    lines = []
    for name, title in titles.items():
        own = {model: [row for row in found[name] if row["model"] == model] for model in models}
        cells = [title, *(text(values(own[model], "rms_in_edges"), ".3f") for model in models)]
        ratios = []
        for model in models:
            here = values(own[model], "rms_in_edges")
            there = values((row for row in full if row["model"] == model), "rms_in_edges")
            if here and there:
                ratios.append(math.log(median(here) / median(there)))
        cells.append(f"{math.exp(sum(ratios) / len(ratios)):.2f}" if ratios else "-")
        cells.append(text(values(found[name], "normal_error_degrees"), ".1f"))
        cells.append(text(values(found[name], "roughness"), ".2f"))
        cells.append(text(values(found[name], "cpu_seconds"), ".1f"))
        lines.append(cells)
    header = ["", *models, "over auto", "normals, °", "roughness", "CPU, s"]
    return table(header, lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the variants and write the page."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = parse(given)
    models = [model for model in MODELS if model.name in options.models]
    holes = [hole for hole in HOLES if hole.name in options.holes]
    titles = {**chains(options.output / "variants", options.variants), **REFERENCES}
    results = Results(options.output, fresh=options.fresh, again=[])
    run = partial(
        run_model,
        holes=holes,
        seeds=options.seeds,
        fillers=list(titles),
        results=results,
        time_limit=options.time_limit,
    )
    with ThreadPoolExecutor(options.jobs) as pool:
        list(pool.map(run, models))
    names = [model.name for model in models]
    command = " ".join(["python -m benchmarks.ablation", *given])
    parts = [TEXT.format(command=command, seeds=", ".join(map(str, options.seeds)))]
    for hole in holes:
        rows = [
            row
            for row in results.rows.values()
            if row["hole"] == hole.name and row["seed"] in options.seeds
        ]
        parts.append(f"## Hole {hole.name}\n\n{ablation_table(rows, titles, names)}\n")
    options.page.write_text("\n".join(parts), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
