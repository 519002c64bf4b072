"""The pictures of a comparison side by side in one image."""

from __future__ import annotations

import importlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshlab_lowrank.comparison.cases import Case
from meshlab_lowrank.comparison.comparing import Comparison
from meshlab_lowrank.comparison.gallery import COLOURS, Gallery, colour_limit, shown_cases
from meshlab_lowrank.comparison.tables import case_name
from meshlab_lowrank.scratch import written_whole

_PANEL, _GAP, _MARGIN = 260, 8, 20  # pixels
_TITLE, _LABEL = 30, 40  # heights of the line above a case and of the words above a picture
_BAR = 200, 14
_BETWEEN = 24  # cases
_INK, _FAINT, _LINE = "#1b1f24", "#6b7178", "#c8ccd2"


def write_strip(comparison: Comparison, gallery: Gallery, path: Path) -> None:
    """Write one picture with the hole, the truth and the fills of each case side by side.

    Above each case stands its number, and where the truth is known the colour scale of the error
    maps, which stand below the fills.

    Parameters
    ----------
    comparison : Comparison
    gallery : Gallery
        With pictures.
    path : Path
        A .png or .jpg file.
    """
    bands = [_Band.of(comparison, case, gallery) for case in shown_cases(comparison)]
    most = max(len(band.panels) for band in bands)
    size = (
        2 * _MARGIN + most * (_PANEL + _GAP) - _GAP,
        2 * _MARGIN + sum(band.height for band in bands) + _BETWEEN * (len(bands) - 1),
    )
    strip: Any = importlib.import_module("PIL.Image").new("RGB", size, "white")
    top = _MARGIN
    for band in bands:
        _draw(strip, band, top)
        top += band.height + _BETWEEN
    with written_whole(path) as place:
        strip.save(place, quality=85)  # of a JPEG


@dataclass(frozen=True)
class _Panel:
    """What one filler made: its words, and pictures that may be missing."""

    label: str
    surface: bytes
    errors: bytes


@dataclass(frozen=True)
class _Band:
    """All of one case; the scale is empty without a truth."""

    title: str
    scale: str
    panels: list[_Panel]

    @classmethod
    def of(cls, comparison: Comparison, case: Case, gallery: Gallery) -> _Band:
        """Collect the pictures of a case."""
        panels = [
            _Panel(
                label,
                gallery.files.get((case.name, filler, "surface"), b""),
                gallery.files.get((case.name, filler, "errors"), b""),
            )
            for filler, label in _labels(comparison, case).items()
        ]
        limit = colour_limit(comparison, case) / case.edge_length
        scale = f"{limit:.2g} edges and more" if any(panel.errors for panel in panels) else ""
        return cls(case_name(case.hole, case.place), scale, panels)

    @property
    def height(self) -> int:
        """In pixels."""
        return _TITLE + _LABEL + _PANEL + (_PANEL + _GAP if self.scale else 0)


def _labels(comparison: Comparison, case: Case) -> dict[str, str]:
    """Give each picture of a row its label."""
    labels = {"": "the hole"} | ({"truth": "the truth"} if case.truth is not None else {})
    for filler in comparison.fillers:
        row = comparison.select(case, filler)
        if row.status == "not installed":
            continue
        error = row.error
        figure = f"RMS {error.rms / case.edge_length:.2f} edges" if error else ""
        labels[filler] = f"{filler}\n{figure if row.status == 'filled' else row.status}"
    return labels


def _draw(strip: Any, band: _Band, top: int) -> None:
    image = importlib.import_module("PIL.Image")
    fonts = importlib.import_module("PIL.ImageFont")
    pen = importlib.import_module("PIL.ImageDraw").Draw(strip)
    small, large = fonts.load_default(14), fonts.load_default(19)
    pen.text((_MARGIN, top), band.title, fill=_INK, font=large)
    if band.scale:
        _draw_scale(pen, band, top, small, _MARGIN + int(pen.textlength(band.title, large)) + 40)
    for column, panel in enumerate(band.panels):
        left = _MARGIN + column * (_PANEL + _GAP)
        above = top + _TITLE + _LABEL
        pen.text((left, top + _TITLE), panel.label, fill=_INK, font=small)
        for data, place in ((panel.surface, above), (panel.errors, above + _PANEL + _GAP)):
            if data:
                drawn = image.open(io.BytesIO(data)).resize((_PANEL, _PANEL), image.LANCZOS)
                strip.paste(drawn, (left, place))
                pen.rectangle(_frame(left, place), outline=_LINE)
        if not panel.surface:
            pen.rectangle(_frame(left, above), outline=_LINE)
            pen.text((left + 12, above + 12), "no picture", fill=_FAINT, font=small)


def _frame(left: int, top: int) -> tuple[int, int, int, int]:
    return left, top, left + _PANEL - 1, top + _PANEL - 1


def _draw_scale(pen: Any, band: _Band, top: int, font: Any, left: int) -> None:
    """Draw the bar of colours with what its ends stand for."""
    words = "distance to the truth: 0"
    pen.text((left, top + 3), words, fill=_INK, font=font)
    width, height = _BAR
    start, middle = left + int(pen.textlength(words, font)) + 8, top + 5
    for x in range(width):
        pen.line(
            (start + x, middle, start + x, middle + height), fill=_colour(x / (width - 1)), width=1
        )
    pen.rectangle((start - 1, middle - 1, start + width, middle + height + 1), outline=_FAINT)
    pen.text((start + width + 8, top + 3), band.scale, fill=_INK, font=font)


def _colour(share: float) -> tuple[int, ...]:
    """Mix the colour at a place from 0 to 1 of the scale."""
    place = share * (len(COLOURS) - 1)
    first = min(int(place), len(COLOURS) - 2)
    low, high = (bytes.fromhex(COLOURS[i][1:]) for i in (first, first + 1))
    return tuple(round(a + (b - a) * (place - first)) for a, b in zip(low, high, strict=True))
