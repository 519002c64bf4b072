"""Stage 1, closing: a hole across creases gets triangles whose edges lie along the creases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, normalized
from meshlab_lowrank.mesh.polygons import triangulated
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.stages.stage0_batch import with_fill
from meshlab_lowrank.stages.stage0_crease_curves import Curve
from meshlab_lowrank.stages.stage0_crease_pairs import Junction, arcs_between
from meshlab_lowrank.stages.stage0_crease_sides import SideShape, shape_of
from meshlab_lowrank.stages.stage0_creases import CreaseEnd
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1a_close_rim import without_double_edges

_BOW = 0.04  # edge lengths
_NOT_SIMPLE = "Seen along its normal, the surface beside its creases is no simple polygon."


@dataclass(frozen=True)
class Side:
    """What one side of joined creases gets.

    Attributes
    ----------
    known : (f,) int64
        Rows of the known faces that it continues.
    new : (g,) int64
        Rows of its new faces.
    shape : SideShape
    """

    known: IntArray
    new: IntArray
    shape: SideShape


@dataclass(frozen=True)
class CreasedFill:
    """A region that was closed along creases.

    Attributes
    ----------
    region : Region
        Closed; new vertices inside the sides lie on their shapes.
    sides : tuple of Side
    """

    region: Region
    sides: tuple[Side, ...]


def close_along_creases(
    region: Region,
    ends: Sequence[CreaseEnd],
    junctions: Sequence[Junction],
    arc_faces: Sequence[IntArray],
    length: float,
) -> CreasedFill:
    """Lay the joined creases across a hole, and triangulate what is between them.

    Parameters
    ----------
    region : Region
        Open.
    ends : sequence of CreaseEnd
    junctions : sequence of Junction
    arc_faces : sequence of (f,) int64
        See `faces_of_arcs`.
    length : float
        Of new edges, in local units.

    Returns
    -------
    CreasedFill

    Raises
    ------
    StageError
        If a side can't be triangulated.
    """
    n, m = len(region.vertices), len(region.faces)
    chains, vertices = _chains(region, ends, junctions, length)
    creases = np.concatenate(
        [np.stack([chain[:-1], chain[1:]], axis=1) for _, _, chain in chains]
        + [_borrowed(region, ends[end]) for each in junctions for end in each.ends]
    )
    way = {(a, b): chain for a, b, chain in chains}
    way.update({(b, a): chain[::-1] for a, b, chain in chains})
    count = len(region.loop)
    grown, faces, sides = [vertices], [], []
    total, filled = n + len(vertices), m
    for piece in arcs_between(junctions):
        outline: list[int] = []
        along: list[int] = []
        spans: list[tuple[int, int]] = []
        for number, (start, end) in enumerate(piece):
            first, last = ends[start].place, ends[end].place
            steps = (last - first) % count or count
            outline += region.loop[(first + np.arange(steps)) % count].tolist()
            onward = piece[(number + 1) % len(piece)][0]
            chain = _way(way, end, onward, junctions)
            spans.append((len(outline), len(outline) + len(chain) - 1))
            outline += chain[:-1].tolist()
            along += chain[1:-1].tolist()
        known = np.unique(np.concatenate([arc_faces[i] for i in _between(piece, len(ends))]))
        positions = np.concatenate([region.vertices, vertices])
        shape = shape_of(region, known, positions[along])
        corners = shape.local(positions[outline])
        bent = _bent_inwards(corners[:, :2], spans, length)
        found = triangulated(bent, [np.arange(len(outline))], length)
        if found is None or _turned(corners):
            raise StageError(_NOT_SIMPLE)
        points, triangles = found
        k = len(outline)
        grown.append(shape.lifted(points[k:], shape.height(points[k:])))
        numbers = np.concatenate([outline, total + np.arange(len(points) - k)])
        faces.append(numbers[triangles])
        sides.append(Side(known, filled + np.arange(len(triangles)), shape))
        total, filled = total + len(points) - k, filled + len(triangles)
    region = replace(region, creases=creases)
    return _without_double_edges(region, np.concatenate(grown), faces, sides)


def _chains(
    region: Region, ends: Sequence[CreaseEnd], junctions: Sequence[Junction], length: float
) -> tuple[list[tuple[int, int, IntArray]], FloatArray]:
    """Give each curve its vertices: from which crease to which it leads, -1 - j for corner j."""
    chains: list[tuple[int, int, IntArray]] = []
    vertices: list[FloatArray] = []
    total = len(region.vertices)
    for number, junction in enumerate(junctions):
        corner = -1
        if len(junction.curves) > 1:
            corner = total
            vertices.append(junction.curves[0][-1:])
            total += 1
        for end, curve in zip(junction.ends, junction.curves, strict=False):
            inner = _spaced(curve, length)
            other = junction.ends[1] if corner < 0 else -1 - number
            last = int(region.loop[ends[other].place]) if corner < 0 else corner
            first = int(region.loop[ends[end].place])
            chain = np.array([first, *range(total, total + len(inner)), last], dtype=np.int64)
            chains.append((end, other, chain))
            vertices.append(inner)
            total += len(inner)
    return chains, np.concatenate(vertices)


def _borrowed(region: Region, end: CreaseEnd) -> IntArray:
    """Edges (b, 2) of the rim that lie on a crease."""
    places = np.array(end.borrowed, dtype=np.int64)
    return np.stack([region.loop[places], np.roll(region.loop, -1)[places]], axis=1)


def _spaced(curve: Curve, length: float) -> FloatArray:
    """Give points inside a curve, about a length apart."""
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(curve, axis=0), axis=1).cumsum()])
    steps = max(int(np.rint(along[-1] / length)), 1)
    wanted = along[-1] * np.arange(1, steps) / steps
    return np.stack([np.interp(wanted, along, axis) for axis in curve.T], axis=1)


def _way(
    way: dict[tuple[int, int], IntArray], start: int, end: int, junctions: Sequence[Junction]
) -> IntArray:
    """Give the vertices from one crease to the next that it is joined with."""
    if (start, end) in way:
        return way[start, end]
    number = next(i for i, each in enumerate(junctions) if start in each.ends)
    return np.concatenate([way[start, -1 - number], way[-1 - number, end][1:]])


def _between(piece: Sequence[tuple[int, int]], count: int) -> list[int]:
    """Parts of the rim that a piece has: those of creases that are not joined are one with it."""
    parts = []
    for start, end in piece:
        steps = (end - start) % count or count
        parts += [(start + step) % count for step in range(steps)]
    return parts


def _bent_inwards(
    corners: FloatArray, spans: Sequence[tuple[int, int]], length: float
) -> FloatArray:
    """Bend the straight sides of an outline a little, as points on a line upset triangulations."""
    bent = corners.copy()
    for first, last in spans:
        rows = np.arange(first, last + 1) % len(corners)
        part = np.linspace(0.0, 1.0, len(rows))[:, None]
        x, y = normalized(corners[rows[-1]] - corners[rows[0]])
        bent[rows] += _BOW * length * part * (1.0 - part) * np.array([-y, x])
    return bent


def _turned(corners: FloatArray) -> bool:
    """Whether an outline runs clockwise."""
    x, y = corners[:, 0], corners[:, 1]
    return bool(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) <= 0.0)


def _without_double_edges(
    region: Region, vertices: FloatArray, faces: Sequence[IntArray], sides: Sequence[Side]
) -> CreasedFill:
    """Append the new vertices and faces; edges that the mesh has already are split."""
    n, m = len(region.vertices), len(region.faces)
    at_rim = np.zeros(n, dtype=np.bool_)
    at_rim[region.loop] = True
    beside = region.faces[faces_at(at_rim, region.faces)]
    positions = np.concatenate([region.vertices, vertices])
    ends, _ = without_double_edges(len(positions), beside, np.concatenate(faces))
    if len(ends) == 0:
        return CreasedFill(with_fill(region, vertices, np.concatenate(faces)), tuple(sides))
    filled, kept = [], []
    count, first = len(positions), m
    middles = []
    for own, side in zip(faces, sides, strict=True):
        doubled, split = without_double_edges(count, beside, own)
        middles.append(positions[doubled].mean(axis=1))
        count += len(doubled)
        filled.append(split)
        kept.append(replace(side, new=first + np.arange(len(split))))
        first += len(split)
    grown = np.concatenate([vertices, *middles])
    return CreasedFill(with_fill(region, grown, np.concatenate(filled)), tuple(kept))
