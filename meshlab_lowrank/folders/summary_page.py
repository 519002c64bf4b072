"""One HTML page on a batch run, the worst holes first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from meshlab_lowrank.folders.file_run import FileRecord
from meshlab_lowrank.folders.hole_pictures import Album, HolePictures
from meshlab_lowrank.report import page

PAGE_NAME = "summary.html"

_STATUS_ORDER = ("crashed", "timed out", "failed", "partly filled", "nothing to fill", "done")
_WORST_HOLES = 200
_LEGEND = (
    "Upper pictures: the hole. Lower pictures: its fill from the same camera in the same light, "
    "new faces orange."
)


def worst_holes(records: Iterable[FileRecord]) -> list[tuple[FileRecord, dict[str, Any]]]:
    """List holes: those left open, then by trust, then by edges, most first.

    Trust counts from the least; where it is not known it counts as none.

    Parameters
    ----------
    records : iterable of FileRecord

    Returns
    -------
    list of (FileRecord, dict)
        The file and the record of the hole; loops that were left open on purpose are no holes.
    """
    holes = ((record, hole) for record in records for hole in record.holes)
    return sorted(
        (item for item in holes if item[1]["status"] != "skipped"),
        key=lambda item: (
            item[1]["status"] != "failed",
            item[1]["trust"] or 0.0,
            -item[1]["boundary_edges"],
        ),
    )


def summary_page(records: Sequence[FileRecord], seconds: float, album: Album) -> str:
    """Write the page.

    Parameters
    ----------
    records : sequence of FileRecord
    seconds : float
        Wall time of the run.
    album : Album
        Pictures of the first of the `worst_holes`.

    Returns
    -------
    str
        HTML that needs nothing else.
    """
    statuses = [record.status for record in records]
    counts = {status: str(statuses.count(status)) for status in dict.fromkeys(statuses)}
    holes = worst_holes(records)
    return page.page(
        "Batch run",
        page.definitions({"files": len(records), **counts, "wall time": f"{seconds:.1f} s"}),
        page.heading("Holes, the worst first"),
        *(_pictures(holes, album) if holes else [page.paragraph("No hole was worked on.")]),
        *([_hole_table(holes)] if holes else []),
        page.heading("Files"),
        _file_table(records),
    )


def _pictures(holes: Sequence[tuple[FileRecord, dict[str, Any]]], album: Album) -> list[page.Html]:
    if album.missing:
        return [page.note(f"There are no pictures. {album.missing}")]
    figures = [
        _figure(record, hole, drawn)
        for (record, hole), drawn in zip(holes, album.holes, strict=False)
    ]
    return [page.paragraph(_LEGEND), page.picture_row(figures)]


def _figure(record: FileRecord, hole: dict[str, Any], drawn: HolePictures) -> page.Html:
    name = f"{record.file}, hole {hole['id']}"
    figures = f"{hole['boundary_edges']} edges, trust {_trust(hole)}"
    lines = [name, hole["status"], figures, hole["reason"], drawn.reason]
    lines = [line for line in dict.fromkeys(lines) if line]
    images = [(drawn.before, f"{name}, open"), (drawn.after, f"{name}, filled")]
    images = [image for image in images if image[0]]
    if images:
        return page.pictures(images, *lines)
    return page.missing_picture("no picture", *lines)


def _trust(hole: dict[str, Any]) -> str:
    return "unknown" if hole["trust"] is None else f"{hole['trust']:.2f}"


def _hole_table(holes: Sequence[tuple[FileRecord, dict[str, Any]]]) -> page.Html:
    columns = ("file", "hole", "status", "trust", "edges", "diameter", "new faces", "reason")
    rows = [
        (
            record.file,
            str(hole["id"]),
            hole["status"],
            _trust(hole),
            str(hole["boundary_edges"]),
            f"{hole['diameter']:.4g}",
            str(hole["new_faces"]),
            hole["reason"],
        )
        for record, hole in holes[:_WORST_HOLES]
    ]
    caption = f"{len(rows)} of {len(holes)} holes."
    return page.table(columns, rows, caption=caption, text_columns=(2, 7))


def _file_table(records: Sequence[FileRecord]) -> page.Html:
    order = {status: number for number, status in enumerate(_STATUS_ORDER)}
    ranked = sorted(records, key=lambda record: order.get(record.status, len(order)))
    columns = ("file", "status", "filled", "loops", "seconds", "peak MB", "reason")
    rows = [
        (
            record.file,
            record.status,
            str(sum(hole["status"] == "filled" for hole in record.holes)),
            str(len(record.holes)),
            f"{record.seconds:.1f}",
            f"{record.peak_memory / 1e6:.0f}",
            " ".join((record.reason, *record.notes)),
        )
        for record in ranked
    ]
    return page.table(columns, rows, text_columns=(1, 6))
