"""Stage 0: curves that carry creases across a hole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray, normalized

_DENSE = 200  # points of a curve
_SIMPLER = 1.25  # how much worse a simpler curve may fit to be taken, ...
_ROUNDING = 0.01  # ... and by how many edge lengths
MOST_TURN = np.radians(160.0)
_STEPS = 5  # of Gauss and Newton, from the circle of least algebraic distance
_HOPELESS = 2.0  # edge lengths off a circle
_FARTHEST_CUBIC = 2.0  # lengths of what is known of both creases
_BLEND = 2.0  # edge lengths over which a curve gives way to the vertex at the rim

Curve: TypeAlias = FloatArray
"""Points (p, 3) from one end to the other."""


@dataclass(frozen=True)
class Fitted:
    """A curve through two creases, and how far their vertices are from it.

    Attributes
    ----------
    curve : (p, 3) float64
        From the first vertex of the one to the first of the other.
    misses : (2,) float64
        Root mean square for each crease.
    turn : float
        By how much it turns across the hole, in radians.
    """

    curve: Curve
    misses: FloatArray
    turn: float


def curve_through(first: FloatArray, second: FloatArray) -> Fitted | None:
    """Lay a curve through two creases: a line, an arc or a cubic, the simplest that fits.

    Parameters
    ----------
    first, second : (p, 3) float64
        Their vertices, from the rim outwards.

    Returns
    -------
    Fitted or None
        None where they enter the hole in such directions that none leads to the other.
    """
    if np.linalg.norm(second[0] - first[0]) == 0.0:
        return None
    best: Fitted | None = None
    for fit in (_line, _arc, _cubic):
        if best is not None and _miss(best) <= _ROUNDING:
            break
        found = fit(first, second)
        if found is None:
            continue
        if best is None or _miss(best) > _SIMPLER * _miss(found) + _ROUNDING:
            best = found
    return best


def straightness(points: FloatArray) -> tuple[float, float]:
    """Root mean square distances of the vertices of a crease from a line and from a parabola."""
    centred = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(centred)
    along, aside = centred @ axes[0], centred @ axes[1:].T
    degrees = (1, 2) if len(points) > 4 else (1, 1)
    line, parabola = (_rms(aside - _polynomial(along, aside, degree)) for degree in degrees)
    return line, parabola


def _miss(fitted: Fitted) -> float:
    return float(np.sqrt(np.mean(fitted.misses**2)))


def _rms(offsets: FloatArray) -> float:
    """Root mean square length of vectors (p, d)."""
    return float(np.sqrt(np.mean((offsets**2).sum(axis=1))))


def _polynomial(t: FloatArray, values: FloatArray, degree: int) -> FloatArray:
    powers = np.vander(t, degree + 1)
    return np.asarray(powers @ np.linalg.lstsq(powers, values, rcond=None)[0])


def _line(first: FloatArray, second: FloatArray) -> Fitted | None:
    return _graph(first, second, 1)


def _cubic(first: FloatArray, second: FloatArray) -> Fitted | None:
    known = sum(float(np.linalg.norm(each[-1] - each[0])) for each in (first, second))
    gap = float(np.linalg.norm(second[0] - first[0]))
    return _graph(first, second, 3) if gap < _FARTHEST_CUBIC * known else None


def _graph(first: FloatArray, second: FloatArray, degree: int) -> Fitted | None:
    """Polynomial over the chord between the two ends."""
    chord = second[0] - first[0]
    length = float(np.linalg.norm(chord))
    frame = np.linalg.svd(chord[None])[2]
    frame[0] = chord / length
    points = np.concatenate([first, second])
    t, aside = (points - first[0]) @ frame[0] / length, (points - first[0]) @ frame[1:].T
    known = np.split(t, [len(first)])
    if (known[0][1:] > 0.0).any() or (known[1][1:] < 1.0).any():
        return None
    powers = np.vander(t, degree + 1)
    factors = np.linalg.lstsq(powers, aside, rcond=None)[0]
    offsets = aside - powers @ factors
    steps = np.linspace(0.0, 1.0, _DENSE)
    over = np.vander(steps, degree + 1) @ factors
    curve = first[0] + length * steps[:, None] * frame[0] + over @ frame[1:]
    ends = normalized(np.stack([curve[1] - curve[0], curve[-1] - curve[-2]]))
    turn = float(np.arccos(np.clip(ends[0] @ ends[1], -1.0, 1.0)))
    misses = np.array([_rms(each) for each in np.split(offsets, [len(first)])])
    return Fitted(_meeting(curve, first[0], second[0]), misses, turn)


def _arc(first: FloatArray, second: FloatArray) -> Fitted | None:
    """Arc of the circle that lies nearest to all vertices."""
    points = np.concatenate([first, second])
    middle = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - middle, full_matrices=False)
    if sizes[1] < 1e-9 * sizes[0]:
        return None
    flat = (points - middle) @ axes[:2].T
    design = np.column_stack([2.0 * flat, np.ones(len(flat))])
    x, y, rest = np.linalg.lstsq(design, (flat**2).sum(axis=1), rcond=None)[0]
    radius = np.sqrt(max(rest + x * x + y * y, 0.0))
    if radius == 0.0 or radius > 1e4:
        return None

    for _ in range(_STEPS):
        spokes = flat - [x, y]
        reach = np.linalg.norm(spokes, axis=1)
        if np.abs(reach - radius).max() > _HOPELESS or reach.min() == 0.0:
            return None
        slopes = np.column_stack([spokes / reach[:, None], np.ones(len(reach))])
        x, y, radius = [x, y, radius] + np.linalg.lstsq(slopes, reach - radius, rcond=None)[0]
    height = (points - middle) @ axes[2]
    offsets = np.stack([np.linalg.norm(flat - [x, y], axis=1) - radius, height], axis=1)
    angle = np.arctan2(flat[:, 1] - y, flat[:, 0] - x)
    own, other = (np.unwrap(each) for each in np.split(angle, [len(first)]))
    sense = np.sign(own[0] - own[-1])  # from outside to the rim
    turn = float((sense * (other[0] - own[0])) % (2.0 * np.pi))
    if turn > MOST_TURN or sense * (other[-1] - other[0]) <= 0.0:
        return None
    angles = own[0] + sense * np.linspace(0.0, turn, _DENSE)
    circle = np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1)
    curve = middle + circle @ axes[:2]
    misses = np.array([_rms(each) for each in np.split(offsets, [len(first)])])
    return Fitted(_meeting(curve, first[0], second[0]), misses, turn)


def _meeting(curve: Curve, start: FloatArray, end: FloatArray) -> Curve:
    """Let a curve begin and end at two vertices, which lie near its ends."""
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(curve, axis=0), axis=1).cumsum()])
    blend = min(_BLEND, 0.5 * along[-1])
    near = np.clip(1.0 - along / blend, 0.0, 1.0)[:, None] * (start - curve[0])
    far = np.clip(1.0 - (along[-1] - along) / blend, 0.0, 1.0)[:, None] * (end - curve[-1])
    return np.asarray(curve + near + far)
