"""The page on error bars, and its plot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tables import table

Result = dict[str, Any]

HEADER = ["group", "holes", "within the bar", "within twice the bar", "mean bar / RMS error"]
INTRODUCTION = """# Error bars

Every new vertex carries `inpaint_error`, the distance to the true surface that is not to be
exceeded in 68 % of cases, and twice that in 95 %. Here holes of radius 8, 16 and 28 mean edge
lengths were punched where the surface is known, filled, and the distance of each new vertex to the
true surface compared with its bar. Bars were tuned on other models, and other places of the real
ones. Tables of these were looked at three times meanwhile, which showed where causes had to be
looked for; what was changed then was chosen on the others. Each hole counts alike, however many
vertices it has. Written by

    python -m benchmarks.calibration --held-out --models FOLDER --page docs/calibration.md

Aimed at were 0.60 to 0.78 within the bar, 0.90 to 0.99 within twice the bar, and mean bars of at
most 1.6 times the RMS of the errors that came. Figures outside of that are bold."""
FEW = """Errors go together within a hole, so groups of fewer than ten tell little. On smooth bodies
bars are too long: discs beside the hole are missed by more than the hole is."""
BELOW = """The part of the vertices whose error is at most so many times their bar, and what it
would be for errors of a normal distribution; the grey boxes are what was aimed at.
"""


def page(rows: Sequence[Result], factors: Sequence[float], *, plot_name: str) -> str:
    """Give the page."""
    known = [row for row in rows if row["known"]]
    lines = [[name, str(len(own)), *_figures(own, factors)] for name, own in _grouped(known) if own]
    unknown = len(rows) - len(known)
    alt = "Part of the vertices within so many bars, by how they were filled"
    return "\n\n".join(
        [
            INTRODUCTION,
            table(HEADER, lines),
            f"No bar was given on {unknown} of {len(rows)} fills.",
            FEW,
            f"![{alt}]({plot_name})",
            BELOW,
        ]
    )


def plot(rows: Sequence[Result], factors: Sequence[float], target: Path) -> None:
    """Draw the coverage over the length of bars."""
    from matplotlib import pyplot as plt  # noqa: PLC0415  of an extra

    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.6), sharey=True)
    normal = [math.erf(factor / math.sqrt(2.0)) for factor in factors]
    for ax, name, values in (
        (axes[0], "kind", ("repeated", "loose", "smooth", "real")),
        (axes[1], "way", ("smooth", "detail", "full")),
        (axes[2], "radius", (8.0, 16.0, 28.0)),
    ):
        for factor, low, high in ((1.0, 0.60, 0.78), (2.0, 0.90, 0.99)):
            ax.fill_between((0.93 * factor, 1.07 * factor), low, high, color="#cccccc", lw=0)
        ax.plot(factors, normal, "k:", label="normal")
        for value in values:
            own = [row for row in rows if row["known"] and row[name] == value]
            if own:
                mean = np.mean([row["coverage"] for row in own], axis=0)
                label = f"radius {value:g}" if name == "radius" else value
                ax.plot(factors, mean, label=f"{label} ({len(own)})")
        ax.set_xscale("log")
        ax.set_xlim(0.1, 10.0)
        ax.set_xticks([0.1, 0.3, 1.0, 2.0, 5.0], ["0.1", "0.3", "1", "2", "5"])
        ax.set_xlabel("error / bar")
        ax.legend(frameon=False, fontsize=8)
    axes[0].set_ylabel("part of the vertices")
    figure.tight_layout()
    figure.savefig(target, dpi=80)
    plt.close(figure)


def _grouped(rows: Sequence[Result]) -> Iterator[tuple[str, list[Result]]]:
    kinds, ways = ("repeated", "loose", "smooth", "real"), ("smooth", "detail", "full")
    radii = (8.0, 16.0, 28.0)
    yield "all", list(rows)
    for kind in kinds:
        yield f"{kind} surfaces", [row for row in rows if row["kind"] == kind]
    for way in ways:
        yield f"filled: {way}", [row for row in rows if row["way"] == way]
    for radius in radii:
        yield f"radius {radius:g}", [row for row in rows if row["radius"] == radius]
    for way in ways:
        for kind in kinds:
            for radius in radii:
                name = f"{way}, {kind}, radius {radius:g}"
                key = (way, kind, radius)
                yield name, [r for r in rows if (r["way"], r["kind"], r["radius"]) == key]


def _figures(rows: Sequence[Result], factors: Sequence[float]) -> list[str]:
    coverage = np.mean([row["coverage"] for row in rows], axis=0)
    at = [float(np.interp(math.log(each), np.log(factors), coverage)) for each in (1.0, 2.0)]
    bar = float(np.mean([row["bar"] for row in rows]))
    error = math.sqrt(float(np.mean([row["square"] for row in rows])))
    figures = (*at, bar / error)
    aims = ((0.60, 0.78), (0.90, 0.99), (0.0, 1.6))
    return [
        f"{figure:.2f}" if low <= round(figure, 2) <= high else f"**{figure:.2f}**"
        for figure, (low, high) in zip(figures, aims, strict=True)
    ]
