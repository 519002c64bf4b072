"""Panels with numbered outlines, set on one sheet."""

from __future__ import annotations

import importlib
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from meshlab_lowrank.report.label_places import place_labels

_FONT, _SMALL_FONT = 24, 18  # pixels
_MANY = 30  # numbers in a panel, from which they are small
_PAD = (7, 4)
_EDGE = 44  # pixels around the mesh in a panel, for numbers
_TEXT, _MARK, _LINE, _PAPER = "#111827", "#c2185b", "#374151", "#ffffff"
_COLUMNS = 3
_LETTER = 0.52  # width of one, in sizes of the font


@dataclass(frozen=True)
class Panel:
    """A picture of the mesh from one side.

    Attributes
    ----------
    image : (p, p, 3) uint8
    caption : str
    marks : dict of int to (x, y, radius)
        What is numbered, in pixels.
    box : (left, top, right, bottom)
        What the mesh takes of the picture, in pixels.
    """

    image: Any
    caption: str
    marks: dict[int, tuple[float, float, float]]
    box: tuple[float, ...]


def compose(panels: Sequence[Panel], told: str) -> Any:
    """Set panels beside and below one another, with a line below them.

    Parameters
    ----------
    panels : sequence of Panel
    told : str

    Returns
    -------
    PIL.Image.Image
    """
    drawing = _pillow("ImageDraw")
    images = [_numbered(panel) for panel in panels]
    rows = [images[i : i + _COLUMNS] for i in range(0, len(images), _COLUMNS)]
    width = max(sum(image.width for image in row) for row in rows)
    letters = max(20, int((width - 2 * _PAD[0]) / (_LETTER * _SMALL_FONT)))
    lines = textwrap.wrap(told, letters)
    heights = [max(image.height for image in row) for row in rows]
    height = sum(heights) + len(lines) * (_SMALL_FONT + 6) + (_PAD[1] if lines else 0)
    sheet = _pillow("Image").new("RGB", (width, height), _PAPER)
    top = 0
    for row, tall in zip(rows, heights, strict=True):
        left = 0
        for image in row:
            sheet.paste(image, (left, top + (tall - image.height) // 2))
            left += image.width
        top += tall
    pen = drawing.Draw(sheet)
    for i, line in enumerate(lines):
        place = (_PAD[0], top + i * (_SMALL_FONT + 6))
        pen.text(place, line, fill=_TEXT, font=_font(_SMALL_FONT))
    return sheet


def _numbered(panel: Panel) -> Any:
    """Draw the numbers of a panel and cut it down to the mesh."""
    left, top, right, bottom = panel.box
    least = len(panel.caption) * _LETTER * _SMALL_FONT + 2 * _PAD[0]
    spare = max(0.0, least - (right - left + 2 * _EDGE)) / 2.0
    cut = round(left - spare - _EDGE), round(top - _EDGE)
    size = round(right + spare + _EDGE) - cut[0], round(bottom + _EDGE + _SMALL_FONT) - cut[1]
    sheet = _pillow("Image").new("RGB", size, _PAPER)
    sheet.paste(_pillow("Image").fromarray(panel.image), (-cut[0], -cut[1]))
    pen = _pillow("ImageDraw").Draw(sheet)
    font = _font(_SMALL_FONT if len(panel.marks) > _MANY else _FONT)
    anchors = [(x - cut[0], y - cut[1]) for x, y, _ in panel.marks.values()]
    radii = [radius for _, _, radius in panel.marks.values()]
    texts = list(map(str, panel.marks))
    boxes = [pen.textbbox((0, 0), text, font=font) for text in texts]
    sizes = [(b[2] - b[0] + 2 * _PAD[0], font.size + 2 * _PAD[1]) for b in boxes]
    frame = (sheet.width, sheet.height - _SMALL_FONT - 2 * _PAD[1])
    places = place_labels(anchors, radii, sizes, frame)
    for anchor, place in zip(anchors, places, strict=True):
        if anchor != place:
            pen.line([anchor, place], fill=_LINE, width=2)
            dot = [anchor[0] - 3, anchor[1] - 3, anchor[0] + 3, anchor[1] + 3]
            pen.ellipse(dot, fill=_MARK)
    for text, (x, y), (wide, tall) in zip(texts, places, sizes, strict=True):
        box = [x - wide / 2, y - tall / 2, x + wide / 2, y + tall / 2]
        pen.rounded_rectangle(box, radius=6, fill=_PAPER, outline=_MARK, width=2)
        pen.text((x, y), text, fill=_TEXT, font=font, anchor="mm")
    caption = (sheet.width / 2, sheet.height - _SMALL_FONT / 2 - _PAD[1])
    pen.text(caption, panel.caption, fill=_LINE, font=_font(_SMALL_FONT), anchor="mm")
    return sheet


def _font(size: int) -> Any:
    return _pillow("ImageFont").load_default(size)


def _pillow(module: str) -> Any:
    return importlib.import_module(f"PIL.{module}")  # comes with the extra for pictures
