"""Tables of a comparison, for the terminal and for the report alike."""

from __future__ import annotations

import csv
import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from meshlab_lowrank.comparison.cases import ROUND
from meshlab_lowrank.comparison.comparing import Comparison
from meshlab_lowrank.comparison.measuring import Row

MISSING = "-"


@dataclass(frozen=True)
class Table:
    """Cells ready to be shown.

    Attributes
    ----------
    hole : int
        As in `Case`.
    caption : str
    columns : tuple of str
    rows : tuple of tuples of str
    best : frozenset of (row, column)
        The cells with the best value of their column.
    text_columns : tuple of int
        Columns that hold words.
    """

    hole: int
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    best: frozenset[tuple[int, int]]
    text_columns: tuple[int, ...] = (1,)


@dataclass(frozen=True)
class _Column:
    """A figure of a row: heading, value, digits after the point, how far from ideal, unit."""

    heading: str
    value: Callable[[Row], float | None]
    digits: int = 2
    badness: Callable[[float], float] | None = None
    unit: str = ""

    def show(self, value: float | None) -> str:
        if value is None or not math.isfinite(value):
            return MISSING
        return f"{value:.{self.digits}f}"


def _distance_from_one(value: float) -> float:
    return abs(math.log(value)) if value > 0 else math.inf


def _shape(name: str) -> Callable[[Row], float | None]:
    return lambda row: getattr(row.shape, name) if row.shape else None


def _error(name: str, unit: Callable[[Row], float] = lambda _: 1.0) -> Callable[..., float | None]:
    return lambda row: getattr(row.error, name) / unit(row) if row.error else None


def _edge(row: Row) -> float:
    return row.edge_length


def _diagonal(row: Row) -> float:
    return row.diagonal / 100.0


_COST = (
    _Column("seconds", lambda row: row.seconds),
    _Column("CPU s", lambda row: row.cpu_seconds),
    _Column("MB", lambda row: row.memory / 1e6 if row.memory else None, 0),
)
_SHAPE = (
    _Column("new faces", _shape("faces"), 0),
    _Column("crossing", _shape("self_crossing"), 0),
    _Column("flipped", _shape("flipped"), 0),
    _Column("degenerate", _shape("degenerate"), 0),
    _Column("rim angle °", _shape("rim_angle"), 0),
    _Column("roughness to surroundings", _shape("roughness"), 2, _distance_from_one),
)
_ERROR = (
    _Column("RMS, edges", _error("rms", _edge), 3, float, "edges"),
    _Column("max, edges", _error("maximum", _edge), 2, float),
    _Column("RMS, % diagonal", _error("rms", _diagonal), 4, float),
    _Column("max, % diagonal", _error("maximum", _diagonal), 3, float),
    _Column("normals °", _error("normal_error"), 1, float, "degrees"),
    _Column("roughness to truth", _error("roughness"), 2, _distance_from_one),
)
_HAUSDORFF = (
    _Column(
        "Hausdorff RMS, % diagonal",
        lambda row: row.hausdorff["rms"] / _diagonal(row) if row.hausdorff else None,
        4,
        float,
    ),
    _Column(
        "Hausdorff max, % diagonal",
        lambda row: row.hausdorff["max"] / _diagonal(row) if row.hausdorff else None,
        3,
        float,
    ),
)


def tables(comparison: Comparison) -> list[Table]:
    """Give one table for each real hole, and one for the punched copies of each.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    list of Table
    """
    holes = list(dict.fromkeys(case.hole for case in comparison.cases))
    found = []
    for hole in holes:
        real = [row for row in comparison.rows if row.hole == hole and row.place == 0]
        punched = [row for row in comparison.rows if row.hole == hole and row.place > 0]
        if real:
            found.append(hole_table(real))
        if punched:
            found.append(spread_table(punched, list(comparison.fillers)))
    return found


def hole_table(rows: Sequence[Row]) -> Table:
    """Tabulate all fillers on one hole."""
    hole = rows[0].hole
    known = any(row.error for row in rows)
    columns = (*_ERROR, *_HAUSDORFF, *_SHAPE, *_COST) if known else (*_SHAPE, *_COST)
    values = [[column.value(row) for column in columns] for row in rows]
    cells = tuple(
        (row.filler, row.status, *(c.show(v) for c, v in zip(columns, line, strict=True)))
        for row, line in zip(rows, values, strict=True)
    )
    usable = [
        [v if row.status == "filled" else None for v in line]
        for row, line in zip(rows, values, strict=True)
    ]
    headings = ("filler", "status", *(column.heading for column in columns))
    against = "measured against the truth" if known else "the truth is not known"
    caption = f"{hole_name(hole)}: {against}"
    return Table(hole, caption, headings, cells, _best(columns, usable, 2))


def spread_table(rows: Sequence[Row], fillers: Sequence[str]) -> Table:
    """Tabulate all fillers on the punched copies of one hole: median and, if several, range."""
    columns = (*_ERROR, *_SHAPE[1:5], _COST[0])
    cells, medians = [], []
    for filler in fillers:
        own = [row for row in rows if row.filler == filler]
        filled = [row for row in own if row.status == "filled"]
        line, middle = [filler, _statuses(own)], []
        for column in columns:
            values = _values(column, filled)
            middle.append(statistics.median(values) if values else None)
            line.append(_with_range(column, values))
        cells.append(tuple(line))
        medians.append(middle)
    copies = len({row.place for row in rows})
    hole = rows[0].hole
    caption = (
        f"{hole_name(hole)}, {copies} copies punched where the surface is known: median (range)"
    )
    headings = ("filler", "status", *(column.heading for column in columns))
    return Table(hole, caption, headings, tuple(cells), _best(columns, medians, 2))


def write_csv(comparison: Comparison, path: Path) -> None:
    """Write one line a case and filler, with the columns of `Row.as_dict`."""
    rows = [row.as_dict() for row in comparison.rows]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def hole_name(hole: int) -> str:
    """Give the name of a hole as a heading."""
    return "Round hole" if hole == ROUND else f"Hole {hole}"


def case_name(hole: int, place: int) -> str:
    """Give the name of a case as a heading."""
    return hole_name(hole) if place == 0 else f"{hole_name(hole)}, copy {place}"


def verdicts(comparison: Comparison, hole: int) -> list[str]:
    """Tell in sentences which filler did best on a hole, and which did not do it.

    Parameters
    ----------
    comparison : Comparison
    hole : int

    Returns
    -------
    list of str
        Measured against the truth where it is known, else on the punched copies.
    """
    rows = [row for row in comparison.rows if row.hole == hole]
    known = [row for row in rows if row.error and row.status == "filled"]
    real = [row for row in known if row.place == 0]
    known = real or known
    sentences = []
    for column, words in ((_ERROR[0], "smallest RMS error"), (_ERROR[4], "smallest normal error")):
        ranked = _ranked(column, known)
        if len(ranked) > 1:
            first, second = ranked[:2]
            sentences.append(f"The {words} has {first}, the next {second}.")
    ranked = _ranked(_ERROR[5], known)
    if ranked:
        sentences.append(f"Closest to the true roughness (1) comes {ranked[0]}.")
    where = "against the truth" if real else "medians over the punched copies"
    if sentences:
        sentences[0] = f"{where.capitalize()}: " + sentences[0][0].lower() + sentences[0][1:]
    missing = [row.filler for row in rows if row.status not in ("filled", "not installed")]
    if missing:
        sentences.append(f"Not closed everywhere by: {', '.join(dict.fromkeys(missing))}.")
    return [" ".join(sentences)] if sentences else []


def _ranked(column: _Column, rows: Sequence[Row]) -> list[str]:
    """Name fillers with their medians, the best first."""
    medians = {}
    for filler in dict.fromkeys(row.filler for row in rows):
        values = _values(column, [row for row in rows if row.filler == filler])
        if values and column.badness:
            medians[filler] = statistics.median(values)
    order = sorted(medians, key=lambda name: (column.badness or float)(medians[name]))
    return [
        f"{name} ({column.show(medians[name])} {column.unit})".replace(" )", ")") for name in order
    ]


def _values(column: _Column, rows: Iterable[Row]) -> list[float]:
    values = (column.value(row) for row in rows)
    return [value for value in values if value is not None and math.isfinite(value)]


def _statuses(rows: Iterable[Row]) -> str:
    counts: dict[str, int] = {}
    for row in rows:
        counts[row.status] = counts.get(row.status, 0) + 1
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{number} {status}" for status, number in counts.items())


def _with_range(column: _Column, values: Sequence[float]) -> str:
    if not values:
        return MISSING
    middle = column.show(statistics.median(values))
    low, high = column.show(min(values)), column.show(max(values))
    return middle if low == high else f"{middle} ({low} to {high})"


def _best(
    columns: Sequence[_Column], values: Sequence[Sequence[float | None]], offset: int
) -> frozenset[tuple[int, int]]:
    """Cells whose shown value is the best of their column."""
    best = set()
    for j, column in enumerate(columns):
        if column.badness is None:
            continue
        scores = {
            i: column.badness(value)
            for i, line in enumerate(values)
            if (value := line[j]) is not None and math.isfinite(value)
        }
        if not scores:
            continue
        winner = column.show(values[min(scores, key=lambda i: scores[i])][j])
        best |= {(i, j + offset) for i in scores if column.show(values[i][j]) == winner}
    return frozenset(best)
