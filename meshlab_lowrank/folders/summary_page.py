"""One HTML page on a batch run, the worst holes first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from meshlab_lowrank.comparison import page
from meshlab_lowrank.folders.file_run import FileRecord

PAGE_NAME = "summary.html"

_STATUS_ORDER = ("crashed", "timed out", "failed", "partly filled", "nothing to fill", "done")
_WORST_HOLES = 200


def summary_page(records: Sequence[FileRecord], seconds: float) -> str:
    """Write the page.

    Parameters
    ----------
    records : sequence of FileRecord
    seconds : float
        Wall time of the run.

    Returns
    -------
    str
        HTML that needs nothing else.
    """
    statuses = [record.status for record in records]
    counts = {status: str(statuses.count(status)) for status in dict.fromkeys(statuses)}
    return page.page(
        "Batch run",
        page.definitions({"files": len(records), **counts, "wall time": f"{seconds:.1f} s"}),
        page.heading("Holes, the worst first"),
        _hole_table(records),
        page.heading("Files"),
        _file_table(records),
    )


def _hole_table(records: Sequence[FileRecord]) -> page.Html:
    """List holes: those left open, then by trust, least first, then by edges, most first."""
    holes = [(record.file, hole) for record in records for hole in record.holes]
    holes = [(file, hole) for file, hole in holes if hole["status"] != "skipped"]
    holes.sort(
        key=lambda item: (item[1]["status"] != "failed", item[1]["trust"], -item[1]["diameter"])
    )
    if not holes:
        return page.paragraph("No hole was worked on.")
    columns = ("file", "hole", "status", "trust", "edges", "diameter", "new faces", "reason")
    rows = [
        (
            file,
            str(hole["id"]),
            hole["status"],
            f"{hole['trust']:.2f}",
            str(hole["boundary_edges"]),
            f"{hole['diameter']:.4g}",
            str(hole["new_faces"]),
            hole["reason"],
        )
        for file, hole in holes[:_WORST_HOLES]
    ]
    caption = f"{len(rows)} of {len(holes)} holes."
    return page.table(columns, rows, caption=caption, text_columns=(2, 7))


def _badness(hole: dict[str, Any]) -> tuple[bool, float, int]:
    return hole["status"] != "failed", hole["trust"], -hole["boundary_edges"]


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
