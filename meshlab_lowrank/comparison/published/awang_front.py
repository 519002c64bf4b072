"""A front of edges that advances from a polygon's outline inwards."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.polygons import triangulated

ONE_TRIANGLE = np.radians(75.0)  # angles of the front up to which it gets so many
TWO_TRIANGLES = np.radians(135.0)
_NEAR = 0.6  # of a new point to the front, in edge lengths, below which they are in conflict
_REACH = 1.6  # within which the two are joined
_FAR = 1e9


@dataclass(frozen=True)
class Advance:
    """One step of a front.

    Attributes
    ----------
    angle : float
        Inner angle of the front at the vertex, in radians.
    triangles, points : int
        How many were made there.
    layer : int
        Of the points; those of the outline are of layer 0.
    """

    angle: float
    triangles: int
    points: int
    layer: int


@dataclass
class Front:
    """Triangulation of a polygon by fronts that advance from its outline inwards.

    Where the front is nearest to closing, at its smallest angle, it gets one triangle, two with a
    new point on the bisector, or three with two new points on the lines that part the angle in
    three. New points are as far away as edges of the outline are long. A conflict is a new point
    that lies near another part of the front, or an edge that crosses it: the front is then joined
    to its nearest vertex that can be seen, and parted in two. Where that isn't possible either, the
    next angle has its turn; where none is left, the rest is triangulated without new points.

    Attributes
    ----------
    points : list of (2,) float64
    triangles : list of (int, int, int)
    layers : list of int
    lengths : list of float
        Of the edges at each point, as carried in from the outline.
    steps : list of Advance
    """

    points: list[FloatArray]
    lengths: list[float]
    triangles: list[tuple[int, int, int]] = field(default_factory=list)
    layers: list[int] = field(default_factory=list)
    steps: list[Advance] = field(default_factory=list)


def advanced(outline: FloatArray) -> Front:
    """Triangulate a polygon by advancing fronts; see `Front`.

    Parameters
    ----------
    outline : (k, 2) float64
        Counter-clockwise; no two sides cross.

    Raises
    ------
    StageError
        If what the fronts leave can't be triangulated.
    """
    sides = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
    lengths = 0.5 * (sides + np.roll(sides, 1))
    front = Front(list(outline), lengths.tolist(), layers=[0] * len(outline))
    waiting = [list(range(len(outline)))]
    while waiting:
        ring = waiting.pop()
        if len(ring) == 3:
            front.triangles.append((ring[0], ring[1], ring[2]))
            continue
        waiting += _advance(front, ring)
    return front


def _advance(front: Front, ring: list[int]) -> list[list[int]]:
    """Take one step of a ring; give the rings that it leaves."""
    corners = np.array([front.points[i] for i in ring])
    angles = inner_angles(corners)
    for place in np.argsort(angles, kind="stable").tolist():
        left = _step(front, ring, corners, place, float(angles[place]))
        if left is not None:
            return left
    found = triangulated(corners, [np.arange(len(ring))], _FAR)
    if found is None:
        msg = f"The front can't be closed: {len(ring)} of its vertices are left."
        raise StageError(msg)
    front.triangles += [(ring[a], ring[b], ring[c]) for a, b, c in found[1].tolist()]
    return []


def inner_angles(corners: FloatArray) -> FloatArray:
    """Angles (k,) between 0 and 2 pi inside a counter-clockwise polygon (k, 2)."""
    onward = np.roll(corners, -1, axis=0) - corners
    back = np.roll(corners, 1, axis=0) - corners
    angle = np.arctan2(back[:, 1], back[:, 0]) - np.arctan2(onward[:, 1], onward[:, 0])
    return np.asarray(np.mod(angle, 2.0 * np.pi))


def _step(
    front: Front, ring: list[int], corners: FloatArray, place: int, angle: float
) -> list[list[int]] | None:
    """Advance at one vertex; None where that isn't possible."""
    k = len(ring)
    before, after = (place - 1) % k, (place + 1) % k
    rest = [ring[(after + i) % k] for i in range(k - 1)]  # from the next round to the last
    if angle <= ONE_TRIANGLE:
        if _covers(corners, [before, place, after]) or not _clear(corners, before, after):
            return None
        front.triangles.append((ring[before], ring[place], ring[after]))
        front.steps.append(Advance(angle, 1, 0, front.layers[ring[place]]))
        return [rest]
    count = 1 if angle <= TWO_TRIANGLES else 2
    length = float(np.mean([front.lengths[ring[i]] for i in (before, place, after)]))
    new = _new_points(corners, place, angle, count, length)
    if _conflict(corners, place, new, _NEAR * length):
        return _joined(front, ring, corners, place, _REACH * length)
    layer = 1 + min(front.layers[ring[i]] for i in (before, place, after))
    first = len(front.points)
    ids = list(range(first, first + count))
    front.points += list(new)
    front.layers += [layer] * count
    front.lengths += [length] * count
    fan = [ring[after], *ids, ring[before]]
    front.triangles += [(ring[place], a, b) for a, b in pairwise(fan)]
    front.steps.append(Advance(angle, count + 1, count, layer))
    return [[*rest, *ids[::-1]]]


def _new_points(
    corners: FloatArray, place: int, angle: float, count: int, length: float
) -> FloatArray:
    """Points (count, 2) that part an angle of the front evenly."""
    onward = corners[(place + 1) % len(corners)] - corners[place]
    turn = np.arctan2(onward[1], onward[0]) + angle * np.arange(1, count + 1) / (count + 1)
    return np.asarray(corners[place] + length * np.stack([np.cos(turn), np.sin(turn)], axis=1))


def _conflict(corners: FloatArray, place: int, new: FloatArray, near: float) -> bool:
    """Whether new points lie near parts of the front that they don't join, or edges cross it."""
    k = len(corners)
    before, after = (place - 1) % k, (place + 1) % k
    following = np.roll(corners, -1, axis=0)
    apart = np.ones(k, dtype=np.bool_)
    apart[[before, place]] = False  # the two sides at the vertex
    for point in new:
        if _distances(point, corners[apart], following[apart]).min() < near:
            return True
    if not (_inside(corners, after, new[0]) and _inside(corners, before, new[-1])):
        return True
    chain = np.concatenate([corners[[after]], new, corners[[before]]])
    ends = [*pairwise(chain), *((corners[place], point) for point in new)]
    return any(_crosses(a, b, corners, following).any() for a, b in ends)


def _joined(
    front: Front, ring: list[int], corners: FloatArray, place: int, reach: float
) -> list[list[int]] | None:
    """Part a ring by an edge from one vertex to its nearest that can be seen; None without one."""
    k = len(ring)
    distance = np.linalg.norm(corners - corners[place], axis=1)
    distance[[place - 1, place, (place + 1) % k]] = np.inf
    for other in np.argsort(distance, kind="stable").tolist():
        if distance[other] > reach:
            return None
        seen = _inside(corners, place, corners[other]) and _inside(corners, other, corners[place])
        if seen and _clear(corners, place, other):
            low, high = sorted((place, other))
            front.steps.append(
                Advance(float(inner_angles(corners)[place]), 0, 0, front.layers[ring[place]])
            )
            return [ring[low : high + 1], ring[high:] + ring[: low + 1]]
    return None


def _inside(corners: FloatArray, place: int, point: FloatArray) -> bool:
    """Whether the line from a corner to a point begins inside the polygon."""
    onward = corners[(place + 1) % len(corners)] - corners[place]
    back, ahead = corners[place - 1] - corners[place], point - corners[place]
    first = np.arctan2(onward[1], onward[0])
    turn, angle = (np.mod(np.arctan2(v[1], v[0]) - first, 2.0 * np.pi) for v in (ahead, back))
    return bool(0.0 < turn < angle)


def _covers(corners: FloatArray, triangle: list[int]) -> bool:
    """Whether a triangle of corners has another one in it."""
    a, b, c = corners[triangle]
    inside = (_turn(a, b, corners) >= 0.0) & (_turn(b, c, corners) >= 0.0)
    inside &= _turn(c, a, corners) >= 0.0
    inside[triangle] = False
    return bool(inside.any())


def _clear(corners: FloatArray, one: int, other: int) -> bool:
    """Whether no side of a polygon crosses or touches the line between two of its corners."""
    following = np.roll(corners, -1, axis=0)
    k = len(corners)
    free = np.ones(k, dtype=np.bool_)
    free[[one, one - 1, other, other - 1]] = False
    a, b = corners[one], corners[other]
    touched = _crosses(a, b, corners, following) & free
    return not bool(touched.any())


def _crosses(a: FloatArray, b: FloatArray, start: FloatArray, end: FloatArray) -> IntArray:
    """Whether a line crosses or touches sides (k, 2) from start to end, ends shared apart."""
    side = _turn(a, b, start) * _turn(a, b, end)
    other = _turn(start, end, a) * _turn(start, end, b)
    shared = ((start == a) | (end == a)).all(axis=1) | ((start == b) | (end == b)).all(axis=1)
    return np.asarray((side <= 0.0) & (other <= 0.0) & ~shared)


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    u, w = b - a, c - a
    return np.asarray(u[..., 0] * w[..., 1] - u[..., 1] * w[..., 0])


def _distances(point: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distances (k,) of a point from line segments."""
    side = end - start
    square = np.maximum((side**2).sum(axis=1), np.finfo(np.float64).tiny)
    along = np.clip(((point - start) * side).sum(axis=1) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(point - start - along[:, None] * side, axis=1))
