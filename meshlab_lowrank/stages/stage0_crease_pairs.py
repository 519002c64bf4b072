"""Stage 0: which creases belong together across a hole, and in which corners they meet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.stages.stage0_crease_curves import (
    MOST_TURN,
    Curve,
    curve_through,
    straightness,
)
from meshlab_lowrank.stages.stage0_creases import CreaseEnd

_ALIKE = np.radians(25.0)  # angles of the two ends of a crease, and normals beside them
_TOWARDS = np.cos(np.radians(80.0))  # between a crease and the way to the other
_OWN_MISS, _SPARE_MISS = 1.5, 0.05  # of a curve, over that of a parabola through one end alone
_STRAIGHT, _SPARE_STRAIGHT = 1.4, 0.02  # miss of a line, over that of a parabola
_CORNER_MISS, _CORNER_DRIFT = 0.25, 0.02  # edge lengths, and parts of the way to the corner
_LEAST_AHEAD = 0.5  # edge lengths from the rim to the corner
CORNER_REACH = 0.9  # diameters of the rim from its middle
_LEAST_SPREAD = np.radians(25.0)  # between two of the creases that meet in a corner
_LEAST_TURN = np.radians(5.0)  # of the one from the other's continuation
_MOST_ENDS = 12
_MOST_IN_CORNER = 5


@dataclass(frozen=True)
class Junction:
    """Creases that are joined across a hole: two by a curve, or more that meet in a corner.

    Attributes
    ----------
    ends : tuple of int
        Numbers of the creases, ascending.
    curves : tuple of (p, 3) float64
        For two: one, from the first to the second. For more: from each to the corner.
    miss : float
        How badly they fit, the limit being 1.
    """

    ends: tuple[int, ...]
    curves: tuple[Curve, ...]
    miss: float


def junctions_of(
    ends: Sequence[CreaseEnd],
    rim: FloatArray,
    planes: Sequence[FloatArray | None],
    *,
    reach: float = CORNER_REACH,
    only_corners: bool = False,
) -> list[Junction]:
    """Join creases so that as many as can be have a partner and none crosses another.

    Parameters
    ----------
    ends : sequence of CreaseEnd
        In the order of the loop.
    rim : (k, 3) float64
    planes : sequence of (4,) float64 or None
        Normal and offset of the surface between each crease and the next, None if it isn't flat.
    reach : float
        Farthest distance of a corner from the middle of the rim, in diameters of that.
    only_corners : bool
        Join no two by a curve.

    Returns
    -------
    list of Junction
    """
    count = len(ends)
    if count < 2 or count > _MOST_ENDS:
        return []
    found = [
        junction
        for i, j in combinations(range(0 if only_corners else count), 2)
        if (junction := _pair(ends, i, j)) is not None
    ]
    for group in _groups(ends):
        corner = _corner(ends, group, planes)
        if corner is not None and _is_within(corner.curves[0][-1], rim, reach):
            found.append(corner)
    return _best(found)


def _groups(ends: Sequence[CreaseEnd]) -> Iterator[tuple[int, ...]]:
    """Give the sets of creases that may meet in a corner: straight, and each two come near."""
    straight = []
    for number, end in enumerate(ends):
        line, parabola = straightness(end.points)
        if line <= _STRAIGHT * parabola + _SPARE_STRAIGHT:
            straight.append(number)
    near = {pair for pair in combinations(straight, 2) if _come_near(*(ends[i] for i in pair))}
    for size in range(3, min(len(straight), _MOST_IN_CORNER) + 1):
        for group in combinations(straight, size):
            if all(pair in near for pair in combinations(group, 2)):
                yield group


def _come_near(one: CreaseEnd, two: CreaseEnd) -> bool:
    """Whether the lines on which two creases go on pass one another closely, within the hole."""
    cosine = float(one.direction @ two.direction)
    if cosine > np.cos(_LEAST_SPREAD) or cosine < -np.cos(_LEAST_TURN):
        return False
    gap = two.points[0] - one.points[0]
    along = np.array([[1.0, -cosine], [-cosine, 1.0]])
    ahead = np.linalg.solve(along, [gap @ one.direction, -(gap @ two.direction)])
    apart = one.points[0] + ahead[0] * one.direction - two.points[0] - ahead[1] * two.direction
    limit = 2.0 * (_CORNER_MISS + _CORNER_DRIFT * float(ahead.max()))
    return bool(ahead.min() > 0.0 and np.linalg.norm(apart) < limit)


def _pair(ends: Sequence[CreaseEnd], i: int, j: int) -> Junction | None:
    one, two = ends[i], ends[j]
    if one.angle * two.angle <= 0.0 or abs(one.angle - two.angle) > _ALIKE:
        return None
    way = two.points[0] - one.points[0]
    length = np.linalg.norm(way)
    if min(one.direction @ way, -(two.direction @ way)) <= _TOWARDS * length:
        return None
    cosine = np.sum(one.side_normals * two.side_normals[::-1], axis=1).min()
    between = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    if between > _ALIKE + MOST_TURN:
        return None
    fitted = curve_through(one.points, two.points)
    if fitted is None:
        return None
    own = np.array([straightness(end.points)[1] for end in (one, two)])
    miss = float((fitted.misses / (_OWN_MISS * own + _SPARE_MISS)).max())
    if miss > 1.0 or between > _ALIKE + fitted.turn:
        return None
    return Junction((i, j), (fitted.curve,), miss)


def _corner(
    ends: Sequence[CreaseEnd],
    group: tuple[int, ...],
    planes: Sequence[FloatArray | None],
) -> Junction | None:
    """Let straight creases meet where they and the flat surfaces between them come together."""
    rows: list[FloatArray] = []
    values: list[FloatArray] = []
    for number in group:
        end = ends[number]
        across = np.eye(3) - np.outer(end.direction, end.direction)
        rows.append(across)
        values.append(across @ end.points.mean(axis=0))
    between = len(ends) == len(group)
    for plane in planes if between else ():
        if plane is not None:
            rows.append(plane[None, :3])
            values.append(plane[3:])
    corner = np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
    directions = np.stack([ends[number].direction for number in group])
    starts = np.stack([ends[number].points[0] for number in group])
    middles = np.stack([ends[number].points.mean(axis=0) for number in group])
    ahead = np.sum((corner - starts) * directions, axis=1)
    if (ahead < _LEAST_AHEAD).any():
        return None
    ways = corner - middles
    off = np.linalg.norm(ways - np.sum(ways * directions, axis=1)[:, None] * directions, axis=1)
    miss = float((off / (_CORNER_MISS + _CORNER_DRIFT * ahead)).max())
    if miss > 1.0:
        return None
    curves = tuple(np.stack([start, corner]) for start in starts)
    return Junction(group, curves, miss)


def _is_within(corner: FloatArray, rim: FloatArray, reach: float) -> bool:
    """Whether a corner lies no farther from the middle of the rim than so many diameters of it."""
    centre = rim.mean(axis=0)
    diameter = 2.0 * np.linalg.norm(rim - centre, axis=1).max()
    return bool(np.linalg.norm(corner - centre) <= reach * diameter)


def _best(found: Sequence[Junction]) -> list[Junction]:
    """Choose junctions that don't cross: most ends first, then the least miss."""
    order = sorted(found, key=lambda each: (each.ends[0], each.ends))
    best: tuple[int, float, list[Junction]] = (0, 0.0, [])
    for chosen in _sets(order, []):
        joined = sum(len(each.ends) for each in chosen)
        miss = sum(each.miss for each in chosen)
        if (joined, -miss) > (best[0], -best[1]):
            best = (joined, miss, chosen)
    return best[2]


def _sets(order: Sequence[Junction], chosen: list[Junction]) -> Iterator[list[Junction]]:
    """Give all sets of junctions of which no two share an end or cross."""
    yield chosen
    for number, each in enumerate(order):
        if all(not _clash(each, other) for other in chosen):
            yield from _sets(order[number + 1 :], [*chosen, each])


def _clash(one: Junction, two: Junction) -> bool:
    """Whether two junctions share an end, or the ends of one lie on several sides of the other."""
    if set(one.ends) & set(two.ends):
        return True
    gaps = {int(np.searchsorted(two.ends, end)) % len(two.ends) for end in one.ends}
    return len(gaps) > 1


def arcs_between(junctions: Sequence[Junction]) -> list[list[tuple[int, int]]]:
    """Walk around the pieces into which junctions part a hole.

    Parameters
    ----------
    junctions : sequence of Junction

    Returns
    -------
    list of list of (int, int)
        For each piece, in the order in which one comes past them: from which crease to which it
        runs along the rim. From the second one on it goes along a junction to the next first.
    """
    joined = sorted(end for each in junctions for end in each.ends)
    place: IntArray = np.array(joined, dtype=np.int64)
    back = {
        end: each.ends[number - 1] for each in junctions for number, end in enumerate(each.ends)
    }
    left, pieces = set(joined), []
    while left:
        start = min(left)
        piece, here = [], start
        while here in left:
            left.remove(here)
            onward = int(place[(np.searchsorted(place, here) + 1) % len(place)])
            piece.append((here, onward))
            here = back[onward]
        pieces.append(piece)
    return pieces
