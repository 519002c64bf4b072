"""One HTML page on a folder: what failed first, then the holes, the worst first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from meshlab_lowrank.folders.file_run import FileRecord
from meshlab_lowrank.folders.hole_pictures import Album, HolePictures
from meshlab_lowrank.folders.ranking import RULE, flaws, worst_holes
from meshlab_lowrank.report import page

PAGE_NAME = "summary.html"

_STATUS_ORDER = ("crashed", "timed out", "failed", "partly filled", "nothing to fill", "done")
_WORST_HOLES = 200
_LEGEND = (
    "Upper pictures: the hole. Lower pictures: its fill from the same camera in the same light, "
    "new faces orange. Below that how far it may be from the true surface, from dark (not at all) "
    "to bright (the largest error bar of the hole), where that is known."
)
_UNKNOWN = "-"


@dataclass(frozen=True, kw_only=True)
class RunFacts:
    """What the page says of the run that wrote it.

    Attributes
    ----------
    source, target : str
        Folders of the inputs and the outputs.
    finished : str
        Date and time.
    seconds : float
        Wall time.
    version : str
        Of this package.
    parameters : dict of str to str
        Of the filter; those that are not given have their defaults.
    command : str
        The command line that does the same.
    worked_on : int
        Files of this run; those that were done before are not among them.
    """

    source: str
    target: str
    finished: str
    seconds: float
    version: str
    parameters: dict[str, str]
    command: str
    worked_on: int


def summary_page(records: Sequence[FileRecord], facts: RunFacts, album: Album) -> str:
    """Write the page.

    Parameters
    ----------
    records : sequence of FileRecord
        The last one of each file, over all runs.
    facts : RunFacts
    album : Album
        Pictures of the first of the `worst_holes`.

    Returns
    -------
    str
        HTML that needs nothing else.
    """
    holes = worst_holes(records)
    ranked = _ranked(records)
    undone = [record for record in ranked if not record.complete]
    return page.page(
        "Batch run",
        _facts(ranked, facts),
        *([page.heading("What failed or stayed open"), _undone_table(undone)] if undone else []),
        page.heading("Holes, the worst first"),
        *(_pictures(holes, album) if holes else [page.paragraph("No hole was worked on.")]),
        *([_hole_table(holes)] if holes else []),
        page.heading("Files"),
        _file_table(ranked),
    )


def _facts(ranked: Sequence[FileRecord], facts: RunFacts) -> page.Html:
    statuses = [record.status for record in ranked]
    counts = (f"{statuses.count(status)} {status}" for status in dict.fromkeys(statuses))
    settings = (f"{name} {value}" for name, value in facts.parameters.items())
    return page.definitions(
        {
            "files": f"{len(ranked)} over all runs: {', '.join(counts)}",
            "this run": f"{facts.worked_on} worked on in {facts.seconds:.1f} s",
            "date": facts.finished,
            "from": facts.source,
            "to": facts.target,
            "version": facts.version,
            "parameters": ", ".join(settings) or "those that hold by default",
            "command": facts.command,
        }
    )


def _ranked(records: Sequence[FileRecord]) -> list[FileRecord]:
    """Sort records, the worst first."""
    order = {status: number for number, status in enumerate(_STATUS_ORDER)}
    return sorted(records, key=lambda record: order.get(record.status, len(order)))


def _pictures(holes: Sequence[tuple[FileRecord, dict[str, Any]]], album: Album) -> list[page.Html]:
    if album.missing:
        return [page.paragraph(RULE), page.note(f"There are no pictures. {album.missing}")]
    figures = [
        _figure(record, hole, drawn)
        for (record, hole), drawn in zip(holes, album.holes, strict=False)
    ]
    return [page.paragraph(f"{RULE} {_LEGEND}"), page.picture_row(figures)]


def _figure(record: FileRecord, hole: dict[str, Any], drawn: HolePictures) -> page.Html:
    name = _name(record, hole)
    figures = f"{hole['boundary_edges']} edges, trust {_trust(hole)}"
    quality = _quality(hole)
    lines = [name, hole["status"], figures, _bars(hole), quality, hole["reason"], drawn.reason]
    lines = [line for line in dict.fromkeys(lines) if line]
    images = [
        (drawn.before, f"{name}, open"),
        (drawn.after, f"{name}, filled"),
        (drawn.bars, f"{name}, error bars"),
    ]
    images = [image for image in images if image[0]]
    if images:
        return page.pictures(images, *lines)
    return page.missing_picture("no picture", *lines)


def _name(record: FileRecord, hole: dict[str, Any]) -> str:
    return f"{record.file}, hole {hole['id']}"


def _trust(hole: dict[str, Any]) -> str:
    return "unknown" if hole["trust"] is None else f"{hole['trust']:.2f}"


def _bars(hole: dict[str, Any]) -> str:
    if hole["median_error"] is None:
        return ""
    return f"error bars {hole['median_error']:.3g} (median), {hole['largest_error']:.3g} (largest)"


def _quality(hole: dict[str, Any]) -> str:
    """Tell in a few words how good a fill is; nothing of a hole that was left open."""
    if hole["rim_angle"] is None:
        return ""
    counts = (("crossings", "crossing"), ("folded_edges", "fold"), ("flat_faces", "flat face"))
    bad = [
        f"{number} {word}{'s' * (number > 1)}" for name, word in counts if (number := hole[name])
    ]
    return ", ".join([*bad, f"rim {hole['rim_angle']:.0f}°"])


def _known(value: float | None, digits: int) -> str:
    return _UNKNOWN if value is None else f"{value:.{digits}f}"


def _significant(value: float | None) -> str:
    return _UNKNOWN if value is None else f"{value:.3g}"


def _hole_table(holes: Sequence[tuple[FileRecord, dict[str, Any]]]) -> page.Html:
    quality = ("crossings", "folds", "flat faces", "rim angle °", "edge ratio", "trust")
    bars = ("median error", "largest error")
    columns = ("hole", "status", *quality, *bars, "edges", "diameter", "new faces", "reason")
    rows = [
        (
            _name(record, hole),
            hole["status"],
            str(hole["crossings"]),
            str(hole["folded_edges"]),
            str(hole["flat_faces"]),
            _known(hole["rim_angle"], 0),
            _known(hole["edge_ratio"], 2),
            _trust(hole),
            *(_significant(hole[name]) for name in ("median_error", "largest_error")),
            str(hole["boundary_edges"]),
            f"{hole['diameter']:.4g}",
            str(hole["new_faces"]),
            hole["reason"],
        )
        for record, hole in holes[:_WORST_HOLES]
    ]
    flawed = sum(flaws(hole) > 0 for _, hole in holes)
    caption = f"{len(rows)} of {len(holes)} holes; {flawed} have crossings, folds or flat faces."
    return page.table(columns, rows, caption=caption, text_columns=(1, 13), cards=True)


def _undone_table(records: Sequence[FileRecord]) -> page.Html:
    rows = [(record.file, record.status, _reasons(record)) for record in records]
    columns = ("file", "status", "reason")
    return page.table(columns, rows, text_columns=(1, 2), cards=True)


def _file_table(records: Sequence[FileRecord]) -> page.Html:
    columns = ("file", "status", "filled", "loops", "seconds", "peak MB", "reason")
    rows = [
        (
            record.file,
            record.status,
            str(sum(hole["status"] == "filled" for hole in record.holes)),
            str(len(record.holes)),
            f"{record.seconds:.1f}",
            f"{record.peak_memory / 1e6:.0f}",
            _reasons(record),
        )
        for record in records
    ]
    return page.table(columns, rows, text_columns=(1, 6), cards=True)


def _reasons(record: FileRecord) -> str:
    return " ".join(filter(None, (record.reason, *record.notes)))
