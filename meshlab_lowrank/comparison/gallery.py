"""All pictures of a comparison, and strips of them side by side."""

from __future__ import annotations

import importlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from meshlab_lowrank.comparison.cases import Case
from meshlab_lowrank.comparison.comparing import Comparison
from meshlab_lowrank.report.pictures import Picture, draw, error_map
from meshlab_lowrank.scratch import written_whole

PictureKey: TypeAlias = tuple[str, str, str]  # name of the case, filler, "surface" or "errors"

_PANEL, _GAP, _LABEL = 260, 6, 40  # pixels
_INK = "#1b1f24"


@dataclass(frozen=True)
class Gallery:
    """Pictures as files.

    Attributes
    ----------
    files : dict of (name of case, filler, kind) to bytes
        JPEG files. The filler "" is the hole, "truth" the true surface; the kind is "surface" or
        "errors".
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


def write_strip(comparison: Comparison, gallery: Gallery, path: Path) -> None:
    """Write one picture with the hole, the truth and the fills of each case side by side.

    Under each fill of a known truth stands its error map.

    Parameters
    ----------
    comparison : Comparison
    gallery : Gallery
        With pictures.
    path : Path
        A .png or .jpg file.
    """
    image: Any = importlib.import_module("PIL.Image")
    font = importlib.import_module("PIL.ImageFont").load_default(14)
    rows = []
    for case in shown_cases(comparison):
        for kind in ("surface", "errors"):
            row = [
                (label, gallery.files.get((case.name, filler, kind)))
                for filler, label in _labels(comparison, case).items()
            ]
            if any(data for _, data in row):
                rows.append(row if kind == "surface" else [("", data) for _, data in row])
    width = max(len(row) for row in rows) * (_PANEL + _GAP) - _GAP
    tops = np.cumsum([0] + [_PANEL + _GAP + _LABEL * bool(row[0][0]) for row in rows])
    strip = image.new("RGB", (width, int(tops[-1]) - _GAP), "white")
    pen = importlib.import_module("PIL.ImageDraw").Draw(strip)
    for top, row in zip(tops, rows, strict=False):
        for column, (label, data) in enumerate(row):
            left = column * (_PANEL + _GAP)
            pen.text((left + 2, top + 3), label, fill=_INK, font=font)
            if data:
                panel = image.open(io.BytesIO(data)).resize((_PANEL, _PANEL))
                strip.paste(panel, (left, int(top) + _LABEL * bool(label)))
    with written_whole(path) as place:
        strip.save(place, quality=80)  # of a JPEG


def _labels(comparison: Comparison, case: Case) -> dict[str, str]:
    """Give each picture of a row its label."""
    labels = {"": "hole"} | ({"truth": "truth"} if case.truth is not None else {})
    for filler in comparison.fillers:
        row = comparison.select(case, filler)
        if row.status == "not installed":
            continue
        error = row.error
        figure = f"\nRMS {error.rms / case.edge_length:.2f} edges" if error else ""
        labels[filler] = filler + figure
    return labels


def shown_cases(comparison: Comparison) -> list[Case]:
    """Real holes, and the first copy of each."""
    return [case for case in comparison.cases if case.place <= 1]


def colour_limit(comparison: Comparison, case: Case) -> float:
    """Distance at the end of the colour scale: the median of the fillers' maxima."""
    rows = (comparison.select(case, filler) for filler in comparison.fillers)
    maxima = [row.error.maximum for row in rows if row.error and np.isfinite(row.error.maximum)]
    return float(np.median(maxima)) if maxima else case.edge_length


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
    return found
