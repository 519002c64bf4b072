"""Stage 0: pieces of measured surface that lie inside a hole, so that the gap is a ring."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.boundary_walk import area_vector
from meshlab_lowrank.mesh.geometry import FloatArray, normalized
from meshlab_lowrank.mesh.polygons import depth_inside, sides_of
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop

_AGAINST = -0.3  # cosine between the mean normals of the two loops, which run opposite ways
_STEEPEST = 1.0  # slope against the smooth fill, from the rim of the hole to that of the island


def islands_in(
    vertices: FloatArray,
    holes: Sequence[BoundaryLoop],
    fills: Mapping[int, FloatArray],
    loops: Sequence[BoundaryLoop],
    crossed: Mapping[int, Sequence[BoundaryLoop]],
) -> dict[int, list[BoundaryLoop]]:
    """Find the pieces of surface that lie inside holes.

    A piece does if its rim, seen along the mean normal of the hole, lies within the hole's loop,
    faces the same way, and can be reached from there with a slope of at most 45 degrees against
    the smooth fill; nearer to the loop than a mean edge length, with a height of that. So a sheet
    that lies below the hole at some distance counts for none.

    Parameters
    ----------
    vertices : (n, 3) float64
    holes : sequence of BoundaryLoop
    fills : mapping of int to (v, 3) float64
        New vertices of the smooth fills of holes, by their places in the sequence; the others have
        no island.
    loops : sequence of BoundaryLoop
        All of the mesh; outer rims of open sheets and single faces may be those of pieces.
    crossed : mapping of int to sequence of BoundaryLoop
        By the same places, the loops of what a smooth fill runs through, which may be so too.

    Returns
    -------
    dict of int to list of BoundaryLoop
        The rims of the pieces in each hole that has some; a piece in several holes belongs to that
        of the smallest area.
    """
    numbers = list(fills)
    rims = [loop for loop in loops if loop.is_rim or loop.shape == "single face"]
    others = {loop.id: loop for each in crossed.values() for loop in each}
    pieces = {loop.id: loop for loop in rims} | others
    if not pieces or not numbers:
        return {}
    outlines = [vertices[holes[i].vertices] for i in numbers]
    low, high = (np.array([end(rim, axis=0) for rim in outlines]) for end in (np.min, np.max))
    extent = (high - low).max(axis=1, keepdims=True)  # (h, 1): a piece may rise above the rim
    areas = np.array([holes[i].area for i in numbers])
    free = {loop.id for loop in rims}
    found: dict[int, list[BoundaryLoop]] = {}
    for piece in pieces.values():
        points = vertices[piece.vertices]
        boxed = (points.min(axis=0) >= low - extent) & (points.max(axis=0) <= high + extent)
        near = np.flatnonzero(boxed.all(axis=1) & (areas > piece.area))
        for place in near[np.argsort(areas[near], kind="stable")]:
            i = numbers[place]
            met = piece.id in free or piece.id in {loop.id for loop in crossed.get(i, ())}
            apart = holes[i].component != piece.component
            if met and apart and _is_inside(vertices, holes[i], piece, fills[i]):
                found.setdefault(i, []).append(piece)
                break
    return found


def reaches_into(vertices: FloatArray, hole: BoundaryLoop, piece: BoundaryLoop) -> bool:
    """Whether a loop lies at a hole: half of its vertices within the hole's outline.

    None of them is farther from the plane of the hole than its diameter.
    """
    outline, inner = _seen(vertices[hole.vertices], vertices[piece.vertices])
    within = 2 * np.count_nonzero(_depth(inner, outline) > 0.0) >= len(inner)
    return bool(within and np.abs(inner[:, 2]).max() <= hole.diameter)


def _is_inside(
    vertices: FloatArray, hole: BoundaryLoop, piece: BoundaryLoop, fill: FloatArray
) -> bool:
    rim = vertices[hole.vertices]
    normals = normalized(np.stack([area_vector(rim), area_vector(vertices[piece.vertices])]))
    if normals[0] @ normals[1] > _AGAINST:
        return False
    free = vertices[np.setdiff1d(piece.vertices, hole.vertices)]
    if len(free) == 0:
        return False
    outline, inner, surface = _seen(rim, free, np.concatenate([rim, fill]))
    length = hole.perimeter / len(rim)
    depth = _depth(inner, outline)
    nearest = cKDTree(surface[:, :2]).query(inner[:, :2])[1]
    height = np.abs(inner[:, 2] - surface[nearest, 2])
    return bool(np.all((depth > 0.0) & (height <= np.maximum(_STEEPEST * depth, length))))


def _seen(rim: FloatArray, *others: FloatArray) -> list[FloatArray]:
    """Coordinates of a rim and other points in its plane, and heights above it, each (k, 3)."""
    normal = normalized(area_vector(rim)[None])[0]
    side = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    frame = normalized(np.stack([side, np.cross(normal, side), normal]))
    return [(points - rim[0]) @ frame.T for points in (rim, *others)]


def _depth(points: FloatArray, outline: FloatArray) -> FloatArray:
    """Distance of points from an outline in its plane, negative outside."""
    return depth_inside(points[:, :2], outline[:, :2], sides_of([np.arange(len(outline))]))
