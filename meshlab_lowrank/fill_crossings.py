"""What the fills of a mesh cross: themselves, the measured surface, and one another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from meshlab_lowrank.mesh.crossings import crossing_pairs, faces_near
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.stages.stage0_region import Region

_NONE = np.zeros(0, dtype=np.int64)


def crossings_of(
    vertices: FloatArray, measured: IntArray, regions: Sequence[Region | None]
) -> list[IntArray]:
    """Find the pairs of a face of a fill, and one of it or of the measured surface, that cross.

    Parameters
    ----------
    vertices : (n, 3) float64
    measured : (f, 3) int64
        All faces of the mesh.
    regions : sequence of Region or None
        Closed; None has no crossings.

    Returns
    -------
    list of (p,) int64
        For each region the rows of measured faces, -1 for pairs of faces of the fill.
    """
    filled, added, number = _gathered(vertices, regions)
    if len(filled) == 0:
        return [_NONE] * len(regions)
    corners = _at(filled, vertices, added)
    near = faces_near(vertices, measured, corners.min(axis=1), corners.max(axis=1))
    both = np.concatenate([filled, measured[near]])
    used, local = np.unique(both, return_inverse=True)
    rows = np.arange(len(both))
    one, other = crossing_pairs(
        _at(used, vertices, added), local.reshape(-1, 3), rows[: len(filled)], rows
    ).T
    own = other < len(filled)  # such a pair comes twice
    counted = ~own | ((one < other) & (number[one] == number[np.where(own, other, 0)]))
    rows = np.append(np.full(len(filled), -1), near)[other[counted]]
    of_pair = number[one[counted]]  # ascending
    return np.split(rows, np.searchsorted(of_pair, np.arange(1, len(regions))))


def crossings_between(vertices: FloatArray, regions: Sequence[Region]) -> list[int]:
    """Count for each fill the pairs of a face of it and one of another fill that cross.

    Parameters
    ----------
    vertices : (n, 3) float64
    regions : sequence of Region
        Closed.

    Returns
    -------
    list of int
    """
    filled, added, number = _gathered(vertices, regions)
    if len(regions) < 2 or len(filled) == 0:
        return [0] * len(regions)
    corners = _at(filled, vertices, added)
    rows = np.flatnonzero(_meets_another(corners, number))
    used, local = np.unique(filled[rows], return_inverse=True)
    every = np.arange(len(rows))
    one, other = crossing_pairs(_at(used, vertices, added), local.reshape(-1, 3), every, every).T
    of_one, of_other = number[rows][one], number[rows][other]
    counts = np.bincount(of_one[of_one != of_other], minlength=len(regions))
    return [int(count) for count in counts]


def crossings_of_patches(vertices: FloatArray, faces: IntArray, patch: IntArray) -> IntArray:
    """Count the pairs of a face of a patch and any other face of its mesh that cross.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    patch : (m,) int64
        Number of the patch of each face, -1 for none.

    Returns
    -------
    (patches,) int64
    """
    rows = np.flatnonzero(patch >= 0)
    corners = vertices[faces[rows]]
    near = faces_near(vertices, faces, corners.min(axis=1), corners.max(axis=1))
    one, other = crossing_pairs(vertices, faces, rows, near).T
    counted = (one < other) | (patch[one] != patch[other])  # pairs within a patch come twice
    return np.bincount(patch[one[counted]], minlength=int(patch.max(initial=-1)) + 1)


def _gathered(
    vertices: FloatArray, regions: Sequence[Region | None]
) -> tuple[IntArray, FloatArray, IntArray]:
    """Give the new faces of regions, the vertices that are added for them, and whose they are."""
    n = len(vertices)
    added, faces, of = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [_NONE]
    for i, region in enumerate(regions):
        if region is None or not np.isfinite(region.vertices).all():
            continue
        new = ~region.known_vertices
        ids = region.vertex_ids.copy()
        ids[new] = n + np.arange(np.count_nonzero(new))
        n += int(np.count_nonzero(new))
        added.append(region.to_global(region.vertices[new]))
        faces.append(ids[region.faces[~region.known_faces]])
        of.append(np.full(len(faces[-1]), i))
    return np.concatenate(faces), np.concatenate(added), np.concatenate(of)


def _meets_another(corners: FloatArray, number: IntArray) -> BoolArray:
    """Mark triangles (f, 3, 3) that reach into the box around those of another number (f,)."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    count = int(number.max()) + 1
    lowest, highest = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(lowest, number, low)
    np.maximum.at(highest, number, high)
    found = np.zeros(len(corners), dtype=np.bool_)
    first = np.searchsorted(number, np.arange(count + 1))
    order = np.argsort(lowest[:, 0], kind="stable")
    last = np.searchsorted(lowest[order, 0], highest[order, 0], side="right")
    for place, i in enumerate(order.tolist()):
        others = order[place + 1 : last[place]]
        meets = (lowest[others] <= highest[i]) & (highest[others] >= lowest[i])
        for j in others[meets.all(axis=1)].tolist():
            for own, box in ((i, j), (j, i)):
                rows = slice(first[own], first[own + 1])
                inside = (low[rows] <= highest[box]) & (high[rows] >= lowest[box])
                found[rows] |= inside.all(axis=1)
    return found


def _at(ids: IntArray, vertices: FloatArray, added: FloatArray) -> FloatArray:
    """Points (..., 3) of vertices by their numbers, those that are added numbered on."""
    n = len(vertices)
    points = np.empty((*ids.shape, 3))
    points[ids < n] = vertices[ids[ids < n]]
    points[ids >= n] = added[ids[ids >= n] - n]
    return points
