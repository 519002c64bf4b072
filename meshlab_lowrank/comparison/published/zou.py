"""Zou, Ju and Carr: the triangulation of least weight of one loop, or of two loops together.

Written from the published idea, not the authors' code. Chosen where the idea leaves it open:

- The weight is the area. No vertices are added, and nothing is refined or faired afterwards.
- Two loops are joined by a ring where that weighs less than both apart, the pair that saves most
  first; three are not joined to one another.
- Edges that the mesh has already are banned. A pair whose ring would have an edge twice is not
  joined, nor one that is far apart or long.

References
----------
Zou, Ju and Carr, An algorithm for triangulating multiple 3D polygons, 2013.
Barequet and Sharir, Filling gaps in the boundary of a polyhedron, 1995.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from meshlab_lowrank.comparison.published.holes import add_mesh, selected_loops
from meshlab_lowrank.comparison.published.least_area import least_areas, pieces
from meshlab_lowrank.comparison.published.zou_ring import RING_WORK, ring_work, triangulated_ring
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_vectors
from meshlab_lowrank.mesh.topology import edges_of

MOST_EDGES = 600

_LOG = logging.getLogger(__name__)
_LONG = "This loop of {} edges is too long for a triangulation of least weight; it takes up to {}."
_TIED = "This loop of {} edges meets itself, so that it can't be triangulated."


def fill(ms: Any) -> None:
    """Fill the selected loops of the current mesh; the filled mesh becomes the current one.

    Parameters
    ----------
    ms : pymeshlab.MeshSet

    Raises
    ------
    StageError
        If no loop can be filled: each has more than 600 edges, as time grows with the third power,
        or meets itself. Where some can, the others stay open.
    """
    vertices, faces, loops = selected_loops(ms)
    if not loops:
        msg = "No loop at a selected face can be filled."
        raise StageError(msg)
    filled = triangulated_loops(vertices, faces, [loop for loop, _ in loops])
    add_mesh(ms, vertices, np.concatenate([faces, filled]))


def triangulated_loops(
    vertices: FloatArray, faces: IntArray, loops: Sequence[IntArray]
) -> IntArray:
    """Give the triangles of least area that close loops, alone or two together.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        Their edges are not used again.
    loops : sequence of (k,) int64
        Each in the order of its fill.

    Returns
    -------
    (f, 3) int64
        Loops that can't be triangulated stay open.

    Raises
    ------
    StageError
        If none of them can be triangulated.
    """
    alone = [_alone(vertices, faces, loop) for loop in loops]
    weight = [np.inf if isinstance(each, StageError) else _area(vertices, each) for each in alone]
    gains: list[tuple[float, int, int]] = []
    rings: dict[tuple[int, int], IntArray] = {}
    for i, j in combinations(range(len(loops)), 2):
        if not _may_join(vertices[loops[i]], vertices[loops[j]]):
            continue
        both = np.concatenate([loops[i], loops[j]])
        banned = edges_among(faces, len(vertices), both)
        ring = triangulated_ring(vertices[loops[i]], vertices[loops[j]], banned)
        if ring is not None:
            rings[i, j] = both[ring]
            gains.append((_area(vertices, rings[i, j]) - weight[i] - weight[j], i, j))
    open_loops = set(range(len(loops)))
    chosen = []
    for gain, i, j in sorted(gains):
        if gain < 0.0 and {i, j} <= open_loops:
            chosen.append(rings[i, j])
            open_loops -= {i, j}
    chosen += [each for i in sorted(open_loops) if not isinstance(each := alone[i], StageError)]
    if not chosen:
        raise next(each for each in alone if isinstance(each, StageError))
    return np.concatenate(chosen)


def _alone(vertices: FloatArray, faces: IntArray, loop: IntArray) -> IntArray | StageError:
    try:
        return loop[triangulated_loop(vertices[loop], edges_among(faces, len(vertices), loop))]
    except StageError as error:
        _LOG.warning("A loop of %d edges stays open unless joined: %s", len(loop), error)
        return error


def triangulated_loop(points: FloatArray, banned: BoolArray) -> IntArray:
    """Triangulate a closed chain of points with the least area, by dynamic programming.

    Parameters
    ----------
    points : (k, 3) float64
    banned : (k, k) bool
        Pairs between which no edge may run inside.

    Returns
    -------
    (k - 2, 3) int64
        Each runs along the chain.

    Raises
    ------
    StageError
        If it has more than 600 points, or the bans leave no triangulation.
    """
    k = len(points)
    if k > MOST_EDGES:
        raise StageError(_LONG.format(k, MOST_EDGES))
    banned = banned.copy()
    banned[0, k - 1] = False  # the side that closes the chain
    weight, apex = least_areas(points, banned, k - 1)
    if not np.isfinite(weight[0, k - 1]):
        raise StageError(_TIED.format(k))
    return np.array(pieces(apex, 0, k - 1), dtype=np.int64)


def edges_among(faces: IntArray, n: int, chosen: IntArray) -> BoolArray:
    """Mark the pairs (k, k) of chosen vertices that have an edge, or are one vertex."""
    place = np.full(n, -1)
    place[chosen] = np.arange(len(chosen))
    ends = place[edges_of(faces).vertices]
    ends = ends[(ends >= 0).all(axis=1)]
    result = chosen[:, None] == chosen
    result[ends[:, 0], ends[:, 1]] = result[ends[:, 1], ends[:, 0]] = True
    return np.asarray(result)


def _may_join(one: FloatArray, other: FloatArray) -> bool:
    """Whether two loops are short enough for a ring, and not so far apart that it weighs more."""
    if ring_work(len(one), len(other)) > RING_WORK:
        return False
    larger = max(float(np.linalg.norm(np.ptp(each, axis=0))) for each in (one, other))
    return float(cdist(one, other).min()) <= larger


def _area(vertices: FloatArray, triangles: IntArray) -> float:
    return float(np.linalg.norm(face_vectors(vertices, triangles), axis=1).sum())
