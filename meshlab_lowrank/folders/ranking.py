"""Which holes of a batch run deserve a look first."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from meshlab_lowrank.folders.file_run import FileRecord

SHARP = 60.0  # degrees between a fill and its surroundings, from which it is looked at
RULE = (
    "First those left open, then fills with crossings, folds or faces without area, then those "
    f"that meet their surroundings at more than {SHARP:.0f}°, then the larger and less trusted."
)


def worst_holes(records: Iterable[FileRecord]) -> list[tuple[FileRecord, dict[str, Any]]]:
    """List holes: those left open, then those with flawed fills, with sharp rims, then by doubt.

    Doubt is the part of the detail that is not expected to be right, times the edges around the
    hole: a triangle that closes three edges has next to none, however little it is trusted.

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
        key=lambda item: _rank(item[1]),
    )


def flaws(hole: dict[str, Any]) -> int:
    """Count what is wrong with the fill of a hole: crossings, folds and faces without area."""
    return int(hole["crossings"] + hole["folded_edges"] + hole["flat_faces"])


def _rank(hole: dict[str, Any]) -> tuple[float, ...]:
    angle = hole["rim_angle"] or 0.0
    sharp = angle > SHARP and hole["shape"] != "cut"  # which is met steeply, or it were no cut
    doubt = (1.0 - (hole["trust"] or 0.0)) * hole["boundary_edges"]
    return (hole["status"] != "failed", -flaws(hole), -angle * sharp, -doubt)
