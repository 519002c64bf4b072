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
from meshlab_lowrank.scratch import written_whole

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
    """A figure of a row: heading, value, digits after the point, whether less is better, unit."""

    heading: str
    value: Callable[[Row], float | None]
    digits: int = 2
    least_is_best: bool = False
    unit: str = ""

    def show(self, value: float | None) -> str:
        if value is None or not math.isfinite(value):
            return MISSING
        return f"{value:.{self.digits}f}"


def _shape(name: str) -> Callable[[Row], float | None]:
    return lambda row: getattr(row.shape, name) if row.shape else None


def _error(name: str, unit: Callable[[Row], float] = lambda _: 1.0) -> Callable[..., float | None]:
    return lambda row: getattr(row.error, name) / unit(row) if row.error else None


def _bars(name: str, unit: Callable[[Row], float] = lambda _: 1.0) -> Callable[..., float | None]:
    return lambda row: getattr(row.bars, name) / unit(row) if row.bars else None


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
    _Column("roughness to surroundings", _shape("roughness")),
)
_BARS = (
    _Column("median error bar, edges", _bars("median", _edge), 3),
    _Column("largest error bar, edges", _bars("largest", _edge), 3),
)
_WITHIN = _Column("within the bar", _bars("within"))
_RMS = _Column("RMS, edges", _error("rms", _edge), 3, True, "edges")
_NORMALS = _Column("normals °", _error("normal_error"), 1, True, "degrees")
_ROUGHNESS = _Column("roughness to truth", _error("roughness"))
_DIHEDRAL = _Column("dihedral to truth", _error("dihedral"))
_ERROR = (
    _RMS,
    _Column("max, edges", _error("maximum", _edge), 2, True),
    _NORMALS,
    _ROUGHNESS,
    _DIHEDRAL,
    _Column("RMS, % diagonal", _error("rms", _diagonal), 4, True),
    _Column("max, % diagonal", _error("maximum", _diagonal), 3, True),
    _WITHIN,
)
_HAUSDORFF = (
    _Column(
        "Hausdorff RMS, % diagonal",
        lambda row: row.hausdorff["rms"] / _diagonal(row) if row.hausdorff else None,
        4,
        True,
    ),
    _Column(
        "Hausdorff max, % diagonal",
        lambda row: row.hausdorff["max"] / _diagonal(row) if row.hausdorff else None,
        3,
        True,
    ),
)


def tables(comparison: Comparison) -> list[Table]:
    """Tabulate each real hole and the punched copies of each: errors, then shape and cost.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    list of Table
        A copied hole has medians and ranges in its cells.
    """
    found = []
    for hole in dict.fromkeys(case.hole for case in comparison.cases):
        own = [row for row in comparison.rows if row.hole == hole]
        real = [row for row in own if row.place == 0]
        copies = [row for row in own if row.place > 0]
        name = hole_name(hole)
        if any(row.error for row in real):
            against = f"{name}: errors against the truth"
            found.append(_table(against, (*_ERROR, *_HAUSDORFF), real))
        if real:
            found.append(
                _table(f"{name}: shape of the fill and cost", (*_SHAPE, *_BARS, *_COST), real)
            )
        if copies:
            number = len({row.place for row in copies})
            punched = f"{name}, {number} copies punched where the surface is known"
            spread = "median (range)" if number > 1 else "one value"
            found.append(_table(f"{punched}: errors, {spread}", _ERROR, copies))
            shape = f"{punched}: shape and cost, {spread}"
            found.append(_table(shape, (*_SHAPE, *_BARS, _COST[0]), copies))
    return found


def _table(caption: str, columns: Sequence[_Column], rows: Sequence[Row]) -> Table:
    """Tabulate fillers, those that filled nothing with their status alone."""
    cells, medians = [], []
    for filler in dict.fromkeys(row.filler for row in rows):
        own = [row for row in rows if row.filler == filler]
        filled = [row for row in own if row.status == "filled"]
        spreads = [_values(column, filled or own) for column in columns]
        shown = (_with_range(c, values) for c, values in zip(columns, spreads, strict=True))
        cells.append((filler, _statuses(own), *shown))
        usable = spreads if filled else [[] for _ in columns]
        medians.append([statistics.median(values) if values else None for values in usable])
    headings = ("filler", "status", *(column.heading for column in columns))
    return Table(rows[0].hole, caption, headings, tuple(cells), _best(columns, medians, 2))


def write_csv(comparison: Comparison, path: Path) -> None:
    """Write one line a case and filler, with the columns of `Row.as_dict`."""
    rows = [row.as_dict() for row in comparison.rows]
    with written_whole(path) as place, place.open("w", newline="", encoding="utf-8") as file:
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
    where = "Against the truth" if real else "Medians over the punched copies"
    found = []
    for column, words in ((_RMS, "smallest RMS error"), (_NORMALS, "smallest normal error")):
        medians = _medians(column, known)
        best = sorted(medians, key=medians.__getitem__)[:2]
        if best:
            shown = (f"{name} ({column.show(medians[name])} {column.unit})" for name in best)
            found.append(f"{words}: {', then '.join(shown)}")
    rms, roughness = _medians(_RMS, known), _medians(_ROUGHNESS, known)
    winner = min(rms, key=rms.__getitem__, default="")
    if winner in roughness:
        found.append(f"roughness of {winner}: {roughness[winner]:.2f}, where 1 is right")
    sentences = [f"{where}, {'; '.join(found)}."] if found else []
    for filler in comparison.fillers:
        own = [row for row in rows if row.filler == filler]
        bad = [row for row in own if row.status not in ("filled", "not installed")]
        if bad:
            reason = bad[0].reason.rstrip(".")
            sentences.append(f"{filler}: {len(bad)} of {len(own)} {bad[0].status} ({reason}).")
    return sentences


def not_installed(comparison: Comparison) -> list[str]:
    """Tell which fillers need packages that are not installed, in a sentence if there are any."""
    missing = dict.fromkeys(row.filler for row in comparison.rows if row.status == "not installed")
    if not missing:
        return []
    return [f"Not installed: {', '.join(missing)}; pip install 'meshlab-lowrank[peers]'."]


def _medians(column: _Column, rows: Sequence[Row]) -> dict[str, float]:
    """Give the median of a figure for each filler that has it."""
    fillers = dict.fromkeys(row.filler for row in rows)
    values = {
        name: _values(column, [row for row in rows if row.filler == name]) for name in fillers
    }
    return {name: statistics.median(own) for name, own in values.items() if own}


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
    return middle if low == high else f"{middle} ({low}-{high})"


def _best(
    columns: Sequence[_Column], values: Sequence[Sequence[float | None]], offset: int
) -> frozenset[tuple[int, int]]:
    """Cells whose shown value is the best of their column."""
    best = set()
    for j, column in enumerate(columns):
        shown = {i: value for i, line in enumerate(values) if (value := line[j]) is not None}
        if column.least_is_best and shown:
            winner = column.show(min(shown.values()))
            best |= {(i, j + offset) for i, value in shown.items() if column.show(value) == winner}
    return frozenset(best)
