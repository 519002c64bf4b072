"""Places for labels beside what they name, none over another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np

Point: TypeAlias = tuple[float, float]
Box: TypeAlias = tuple[float, float, float, float]  # left, top, right, bottom

_ROOM = 1.5  # of a hole against its label, for the label to stand in it
_DIRECTIONS = 16
_STEPS = 12


def place_labels(
    anchors: Sequence[Point],
    radii: Sequence[float],
    sizes: Sequence[Point],
    frame: Point,
    gap: float = 3.0,
) -> list[Point]:
    """Find the centres of labels.

    Parameters
    ----------
    anchors : sequence of (x, y)
        What they name.
    radii : sequence of float
        How far that reaches.
    sizes : sequence of (width, height)
        Of the labels.
    frame : (width, height)
        Of the picture, in which they stay.
    gap : float
        Between labels.

    Returns
    -------
    list of (x, y)
        In the middle of what is large enough, beside the others.
    """
    placed: list[Box] = []
    places: list[Point] = []
    marks = [(x - r, y - r, x + r, y + r) for (x, y), r in zip(anchors, radii, strict=True)]
    for i, (anchor, radius, size) in enumerate(zip(anchors, radii, sizes, strict=True)):
        others = [*marks[:i], *marks[i + 1 :]]
        tries = list(_tries(anchor, radius, size, frame))
        free = [p for p in tries if not _hits(p, size, placed, gap)]
        clear = (p for p in free if not _hits(p, size, _small(others, size), 0.0))
        chosen = next(clear, (free or tries)[0])
        placed.append(_box(chosen, size, 0.0))
        places.append(chosen)
    return places


def _tries(anchor: Point, radius: float, size: Point, frame: Point) -> Iterator[Point]:
    """Give places for a label, the best first; all lie in the frame."""
    x, y = anchor
    width, height = size
    if 2.0 * radius > _ROOM * max(size):
        yield _inside(anchor, size, frame)
    outwards = np.arctan2(y - frame[1] / 2.0, x - frame[0] / 2.0)
    turns = sorted(2.0 * np.pi * k / _DIRECTIONS for k in range(_DIRECTIONS))
    turns.sort(key=lambda turn: min(turn, 2.0 * np.pi - turn))
    for step in range(_STEPS):
        for turn in turns:
            way = float(np.cos(outwards + turn)), float(np.sin(outwards + turn))
            reach = radius + (0.6 + step) * height
            place = x + way[0] * (reach + width / 2.0), y + way[1] * (reach + height / 2.0)
            if _inside(place, size, frame) == place:
                yield place
    yield _inside(anchor, size, frame)


def _inside(place: Point, size: Point, frame: Point) -> Point:
    x, y = (
        min(max(at, length / 2.0), whole - length / 2.0)
        for at, length, whole in zip(place, size, frame, strict=True)
    )
    return x, y


def _small(marks: Sequence[Box], size: Point) -> list[Box]:
    """Give the marks that a label would hide."""
    return [box for box in marks if box[2] - box[0] < 4.0 * size[0]]


def _box(place: Point, size: Point, gap: float) -> Box:
    (x, y), (width, height) = place, size
    return x - width / 2 - gap, y - height / 2 - gap, x + width / 2 + gap, y + height / 2 + gap


def _hits(place: Point, size: Point, boxes: Sequence[Box], gap: float) -> bool:
    left, top, right, bottom = _box(place, size, gap)
    return any(left < r and right > x and top < b and bottom > y for x, y, r, b in boxes)
