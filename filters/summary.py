"""The dictionary that the filters give back."""

from __future__ import annotations

from typing import Any

from meshlab_lowrank.result import InpaintResult


def summary(result: InpaintResult, *, new_faces: int, new_vertices: int) -> dict[str, Any]:
    """Count what a run did.

    Returns
    -------
    dict
        "closed_holes", "skipped_holes", "failed_holes", "new_faces", "new_vertices": numbers;
        "holes": a dictionary for each `HoleRecord`; "notes": see `InpaintResult`.
    """
    statuses = [hole.status for hole in result.holes]
    return {
        "closed_holes": statuses.count("filled"),
        "skipped_holes": statuses.count("skipped"),
        "failed_holes": statuses.count("failed"),
        "new_faces": new_faces,
        "new_vertices": new_vertices,
        "holes": [hole.as_dict() for hole in result.holes],
        "notes": list(result.notes),
    }
