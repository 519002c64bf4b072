"""All pictures of a comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from meshlab_lowrank.comparison.cases import Case
from meshlab_lowrank.comparison.comparing import Comparison
from meshlab_lowrank.comparison.measuring import Row
from meshlab_lowrank.report.pictures import Picture, draw, error_map

PictureKey: TypeAlias = tuple[str, str, str]  # name of the case, filler, kind

COLOURS = ("#00224e", "#35456c", "#666970", "#948e77", "#c8b866", "#fee838")  # cividis


@dataclass(frozen=True)
class Gallery:
    """Pictures as files.

    Attributes
    ----------
    files : dict of (name of case, filler, kind) to bytes
        JPEG files. The filler "" is the hole, "truth" the true surface; the kind is "surface",
        "errors" or "bars", the error bars.
    missing : str
        Why there are none, and what to do; empty if there are.
    """

    files: dict[PictureKey, bytes]
    missing: str


def draw_gallery(comparison: Comparison) -> Gallery:
    """Draw the real holes, the first copy of each, and what each filler made of them.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    Gallery
    """
    return Gallery(*draw(_pictures(comparison)))


def shown_cases(comparison: Comparison) -> list[Case]:
    """Real holes, and the first copy of each."""
    return [case for case in comparison.cases if case.place <= 1]


def colour_limit(comparison: Comparison, case: Case) -> float:
    """Distance at the end of the colour scale: the median of the fillers' maxima.

    Without truth it is the largest error bar.
    """
    maxima = [
        row.error.maximum
        for row in _rows(comparison, case)
        if row.error and np.isfinite(row.error.maximum)
    ]
    if maxima:
        return float(np.median(maxima))
    largest = [row.bars.largest for row in _rows(comparison, case) if row.bars]
    return max(largest, default=case.edge_length)


def _rows(comparison: Comparison, case: Case) -> list[Row]:
    return [comparison.select(case, filler) for filler in comparison.fillers]


def _pictures(comparison: Comparison) -> dict[PictureKey, Picture]:
    found: dict[PictureKey, Picture] = {}
    for case in shown_cases(comparison):
        damaged = comparison.scenes[case.name, ""]
        found[case.name, "", "surface"] = Picture(case, damaged)
        if case.truth is not None:
            truth = case.scene(case.truth)
            found[case.name, "truth", "surface"] = Picture(case, truth)
        limit = colour_limit(comparison, case)
        for filler in comparison.fillers:
            fill = comparison.scenes.get((case.name, filler))
            if fill is None:
                continue
            found[case.name, filler, "surface"] = Picture(case, fill)
            if case.truth is not None and fill.has_area:
                errors = error_map(fill, case.truth, case.edge_length)
                found[case.name, filler, "errors"] = Picture(case, fill, errors, limit)
            if (case.name, filler) in comparison.bars:
                bars = comparison.bars[case.name, filler]
                found[case.name, filler, "bars"] = Picture(case, fill, bars, limit)
    return found
