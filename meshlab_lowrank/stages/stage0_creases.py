"""Stage 0: sharp edges of the known surface that end at a hole."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, normalized
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage0_sharp_edges import Evidence, SharpEdges

_QUARTERS = 0.75
_LONGEST = 14  # edges of a crease that are looked at
_STRAIGHT = np.cos(np.radians(50.0))  # from one edge of a crease to the next
_EVEN = 0.5  # of the median angle, that nine tenths of its edges have
_SMOOTH_BESIDE = 0.4  # of the median angle, that three quarters of the edges beside it keep below
_BESIDE = 3  # edges beside which the normals of the surface count
_DIRECTION = 5  # edges that tell in which direction a crease enters
_ON_LINE, _AHEAD = 0.2, 0.3  # of a rim that runs along the crease: off it, and on, in edges


@dataclass(frozen=True)
class CreaseEnd:
    """A sharp edge of the known surface that ends at the rim.

    Attributes
    ----------
    place : int
        In the loop of the region.
    points : (p, 3) float64
        From the rim outwards.
    angle : float
        Between the normals on either side, in radians; negative where the surface is hollow.
    side_normals : (2, 3) float64
        Of the surface to the left and to the right of it, for one who looks into the hole.
    borrowed : tuple of int
        Places of the edges of the loop along it, whose faces lie on one side only.
    """

    place: int
    points: FloatArray
    angle: float
    side_normals: FloatArray
    borrowed: tuple[int, ...]

    @cached_property
    def direction(self) -> FloatArray:
        """Unit vector (3,) into the hole."""
        near = self.points[: _DIRECTION + 1]
        axis = np.linalg.svd(near - near.mean(axis=0))[2][0]
        return np.asarray(axis * np.sign(axis @ (near[0] - near[-1])))


def crease_ends(region: Region, edges: SharpEdges, evidence: Evidence) -> list[CreaseEnd]:
    """Find the sharp edges of the known surface that end at the rim.

    A crease is a line of sharp edges that begins at a vertex of the rim and goes on without a
    kink; its angle is even, its sign always the same, and the surface beside it is smooth by
    comparison. Where two of them begin at one vertex, neither is taken.

    Parameters
    ----------
    region : Region
        Open, without islands.
    edges : SharpEdges
        Of its faces.
    evidence : Evidence

    Returns
    -------
    list of CreaseEnd
        In the order of the loop.
    """
    place = np.full(len(region.vertices), -1)
    place[region.loop] = np.arange(len(region.loop))
    found: dict[int, list[CreaseEnd]] = {}
    for start in region.loop.tolist():
        for first in edges.sharp_at.get(start, ()):
            line = _traced(region, edges, place, start, first)
            if len(line.rows) >= evidence.edges and place[line.chain[-1]] < 0:
                end = _end(region, edges, line, int(place[start]), evidence)
                if end is not None and abs(end.angle) > evidence.angle:
                    found.setdefault(start, []).append(end)
    single = [_along_rim(region, ends[0]) for ends in found.values() if len(ends) == 1]
    ordered = sorted(single, key=lambda end: end.place)
    places = [end.place for end in ordered]
    return [end for end in ordered if places.count(end.place) == 1]


@dataclass(frozen=True)
class _Line:
    """Sharp edges one after the other, and the vertices between them."""

    chain: list[int]
    rows: list[int]


def _traced(region: Region, edges: SharpEdges, place: IntArray, start: int, first: int) -> _Line:
    """Follow sharp edges from a vertex of the rim."""
    vertices = region.vertices
    chain, rows = [start], [first]
    while True:
        here = int(edges.ends[rows[-1]].sum()) - chain[-1]
        forward = normalized(vertices[here] - vertices[chain[-1]])
        chain.append(here)
        if place[here] >= 0 or len(rows) == _LONGEST:
            return _Line(chain, rows)
        best, straightest = -1, _STRAIGHT
        for number in edges.sharp_at[here]:
            there = int(edges.ends[number].sum()) - here
            cosine = float(forward @ normalized(vertices[there] - vertices[here]))
            if there not in chain and cosine > straightest:
                best, straightest = number, cosine
        if best < 0:
            return _Line(chain, rows)
        rows.append(best)


def _end(
    region: Region, edges: SharpEdges, line: _Line, place: int, evidence: Evidence
) -> CreaseEnd | None:
    """Judge a line of sharp edges; None if it is no crease."""
    chain, rows = line.chain, line.rows
    angles = edges.angle[rows]
    median = float(np.median(angles))
    if np.quantile(angles, 0.1) < _EVEN * median:
        return None
    points = region.vertices[chain]
    sides = edges.normals[
        [
            _sides(region.faces, edges.beside[number], back, here)
            for number, back, here in zip(rows, chain[1:], chain[:-1], strict=True)
        ]
    ]  # (rows, 2, 3)
    turns = np.cross(sides[:, 0], sides[:, 1])
    signs = np.sign(np.sum(turns * (points[:-1] - points[1:]), axis=1))
    if abs(np.sum(signs)) < 0.8 * len(signs):
        return None
    if not evidence.exact:
        touched = np.zeros(len(region.vertices), dtype=np.bool_)
        touched[chain[1:]] = True
        near = touched[edges.ends[:, 0]] | touched[edges.ends[:, 1]]
        near[rows] = False
        if np.quantile(edges.angle[near], _QUARTERS) > _SMOOTH_BESIDE * median:
            return None
    return CreaseEnd(
        place=place,
        points=points,
        angle=median * float(np.sign(np.sum(signs))),
        side_normals=normalized(np.mean(sides[:_BESIDE], axis=0)),
        borrowed=(),
    )


def _sides(faces: IntArray, beside: IntArray, tail: int, head: int) -> tuple[int, int]:
    """Give the faces to the left and to the right of an edge."""
    first, second = beside.tolist()
    corners = faces[first].tolist()
    left = corners[(corners.index(tail) + 1) % 3] == head
    return (first, second) if left else (second, first)


def _along_rim(region: Region, end: CreaseEnd) -> CreaseEnd:
    """Move the end of a crease on, as far as the rim runs along it."""
    count = len(region.loop)
    for step in (1, -1):
        place, points, borrowed = end.place, end.points, list(end.borrowed)
        while len(borrowed) < count // 4:
            onward = region.vertices[region.loop[(place + step) % count]]
            grown = np.concatenate([onward[None], points])
            direction, reach = end.direction, onward - end.points[0]
            last = (onward - points[0]) @ direction
            if last < _AHEAD or np.linalg.norm(reach - (reach @ direction) * direction) > _ON_LINE:
                break
            borrowed.append(place if step == 1 else (place - 1) % count)
            place, points = (place + step) % count, grown
        if len(borrowed) > len(end.borrowed):
            return CreaseEnd(place, points, end.angle, end.side_normals, tuple(borrowed))
    return end
