"""Tables in Markdown from the results of the benchmark."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import median
from typing import Any

Result = dict[str, Any]

COLUMNS: list[tuple[str, str, str]] = [
    ("RMS, h", "rms_in_edges", ".3f"),
    ("max, h", "max_in_edges", ".2f"),
    ("RMS, % diagonal", "rms_over_diagonal", ".4%"),
    ("max, % diagonal", "max_over_diagonal", ".3%"),
    ("normals, °", "normal_error_degrees", ".1f"),
    ("roughness", "roughness", ".2f"),
    ("dihedral", "dihedral", ".2f"),
    ("looks right", "looks_right", ".0%"),
    ("CPU, s", "cpu_seconds", ".2f"),
    ("memory, MB", "memory_bytes", ".0f"),
]
LEGEND = (
    "Lengths are in mean edge lengths (h) at the hole or in per cent of the bounding-box diagonal; "
    "figures are medians over places and models, counts are sums. Roughness: detail energy of the "
    "fill over that of the truth, 1 is right. Dihedral: mean angle between neighbouring faces over "
    "the truth's, 1 is right, crumpled fills are higher. Looks right: part of the fills with "
    "roughness 0.7 to 1.25 and dihedral 0.75 to 1.2. CPU time and peak memory are of the filler "
    "alone."
)
REFINED = "close-refine"  # what CPU times are compared with; plain closing makes next to nothing
COUNTS = ("flipped", "degenerate", "self_crossing")


def report(rows: Sequence[Result], ours: Sequence[str], meshlab: Sequence[str]) -> str:
    """Give all tables: ours against the best of the others, by filler, by model."""
    measured = [row for row in rows if row["status"] != "not installed"]
    fillers = list(dict.fromkeys(row["filler"] for row in measured))
    own = [name for name in fillers if name in ours]
    parts = [
        "# Benchmark",
        LEGEND,
        "## Ours over the best of the others",
        ratio_table(measured, own, ours, meshlab),
        "## By filler",
        *filler_tables(measured, fillers),
        "## RMS in h by model",
        model_table(measured, fillers),
    ]
    return "\n\n".join(parts) + "\n"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Give a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def values(rows: Iterable[Result], field: str) -> list[float]:
    """Give the known values of a field."""
    return [row[field] for row in rows if row.get(field) is not None]


def text(numbers: Sequence[float], form: str, scale: float = 1.0) -> str:
    """Give the median of numbers as text."""
    return format(median(numbers) * scale, form) if numbers else "-"


def groups(rows: Iterable[Result], *fields: str) -> dict[tuple[Any, ...], list[Result]]:
    """Group rows by some of their fields, in order of first appearance."""
    found: dict[tuple[Any, ...], list[Result]] = {}
    for row in rows:
        found.setdefault(tuple(row[field] for field in fields), []).append(row)
    return found


def filler_tables(rows: Sequence[Result], fillers: Sequence[str]) -> list[str]:
    """One table for each kind of model and radius."""
    parts = []
    for (kind, radius), members in sorted(groups(rows, "kind", "radius").items()):
        parts.append(f"### {kind}, radius {radius:g} h")
        lines = []
        for name in fillers:
            own = [row for row in members if row["filler"] == name]
            if not own:
                continue
            filled = sum(row["status"] == "filled" for row in own)
            cells = [name, f"{filled} of {len(own)}"]
            for _, field, form in COLUMNS:
                known = values(own, field)
                if field in ("roughness", "looks_right") and kind == "smooth":
                    known = []  # a ratio to next to nothing
                cells.append(_cell(known, field, form))
            cells += [str(int(sum(values(own, field)))) for field in COUNTS]
            lines.append(cells)
        header = [
            "filler",
            "filled",
            *(column[0] for column in COLUMNS),
            "flipped",
            "degenerate",
            "crossing",
        ]
        parts.append(table(header, lines))
    return parts


def _cell(known: Sequence[float], field: str, form: str) -> str:
    """Give the median of a column, or how often it holds."""
    if field == "looks_right":
        return format(sum(known) / len(known), form) if known else "-"
    return text(known, form, 1e-6 if "memory" in field else 1.0)


def model_table(rows: Sequence[Result], fillers: Sequence[str]) -> str:
    """RMS of every filler on every model and hole."""
    lines = []
    for (model, hole), members in groups(rows, "model", "hole").items():
        cells = [
            text(values((row for row in members if row["filler"] == name), "rms_in_edges"), ".3f")
            for name in fillers
        ]
        lines.append([model, hole, *cells])
    return table(["model", "hole", *fillers], lines)


def ratio_table(
    rows: Sequence[Result], own: Sequence[str], ours: Sequence[str], meshlab: Sequence[str]
) -> str:
    """For each kind and radius: our figure over the least of the others', median and worst.

    The least is taken for each model and hole, from each filler's median over the seeds.
    """
    lines = []
    for (kind, radius), members in sorted(groups(rows, "kind", "radius").items()):
        cases = list(groups(members, "model", "hole").values())
        for name in own:
            own_rows = [row for row in members if row["filler"] == name]
            if not own_rows:
                continue
            others = [row["filler"] for row in members if row["filler"] not in ours]
            apart = [other for other in others if other not in meshlab]
            cells = [kind, f"{radius:g}", name, str(len(groups(own_rows, "model", "hole")))]
            for field in ("rms_in_edges", "normal_error_degrees"):
                cells.append(_ratios(cases, name, meshlab, field))
                cells.append(_ratios(cases, name, apart, field))
            cells.append(_ratios(cases, name, [REFINED], "cpu_seconds"))
            cells.append(text(values(own_rows, "roughness"), ".2f"))
            lines.append(cells)
    header = ["kind", "radius", "filler", "cases"]
    for what in ("RMS", "normals"):
        header += [f"{what} / best MeshLab (worst)", f"{what} / best other (worst)"]
    return table([*header, f"CPU / {REFINED} (worst)", "roughness"], lines)


def _ratios(
    cases: Sequence[Sequence[Result]],
    name: str,
    others: Sequence[str],
    field: str,
) -> str:
    ratios = []
    for rows in cases:
        by_filler = groups(rows, "filler")
        figures = {key[0]: values(members, field) for key, members in by_filler.items()}
        against = [median(figures[other]) for other in set(others) if figures.get(other)]
        if against and figures.get(name):
            ratios.append(median(figures[name]) / min(against))
    return f"{median(ratios):.2f} ({max(ratios):.2f})" if ratios else "-"
