"""The cut-out part of the mesh round one hole, in local units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.face_grid import FaceGrid
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, edge_lengths
from meshlab_lowrank.mesh.topology import (
    compacted,
    faces_around,
    faces_at,
    vertex_components,
)
from meshlab_lowrank.parameters import Continuation

_GRID = 2.0**-26  # of local coordinates: far above rounding, far below any triangle that matters


def _no_edges() -> IntArray:
    return np.zeros((0, 2), dtype=np.int64)


@dataclass(frozen=True)
class Region:
    """One hole with its surroundings, in units of the mean edge length around the hole.

    Attributes
    ----------
    vertices : (n, 3) float64
        Local coordinates: global = local * scale + centre.
    faces : (m, 3) int64
    known_vertices : (n,) bool
        False on the vertices that fill the hole.
    known_faces : (m,) bool
        False on the faces that fill the hole.
    vertex_ids : (n,) int64
        Index in the whole mesh, -1 for new vertices.
    face_ids : (m,) int64
        Index in the whole mesh, -1 for new faces.
    centre : (3,) float64
    scale : float
        Mean edge length around the hole, in the units of the mesh.
    loop : (k,) int64
        The boundary loop as indices into vertices, ordered as ``BoundaryLoop.vertices``: a face
        that fills the hole runs from loop[i] to loop[i + 1]. Where pieces of surface lie inside
        the hole, their rims come after it; see `loops`.
    islands : tuple of int
        Places in ``loop`` at which the rims of such pieces begin.
    continuity : {"flat", "tangent", "smooth"}
        How its fill shall go on from the rim, see `InpaintParameters`.
    most_faces : float
        That its fill may get where nobody asks for an edge length.
    coarsening : float
        How many times longer than around the hole the edges of its fill are for that.
    creases : (e, 2) int64
        Edges of its fill along creases that were joined across the hole.
    """

    vertices: FloatArray
    faces: IntArray
    known_vertices: BoolArray
    known_faces: BoolArray
    vertex_ids: IntArray
    face_ids: IntArray
    centre: FloatArray
    scale: float
    loop: IntArray
    islands: tuple[int, ...] = ()
    continuity: Continuation = "smooth"
    most_faces: float = np.inf
    coarsening: float = 1.0
    creases: IntArray = field(default_factory=_no_edges)

    def loops(self) -> list[IntArray]:
        """Give the outer loop, then those of islands."""
        return np.split(self.loop, self.islands)

    def to_global(self, positions: FloatArray) -> FloatArray:
        """Local coordinates (..., 3) in the units of the mesh."""
        return positions * self.scale + self.centre


def cut_region(
    vertices: FloatArray,
    faces: IntArray,
    loop: IntArray,
    rim_faces: IntArray,
    *,
    reach: float,
    rings: int = 0,
    grid: FaceGrid | None = None,
) -> Region:
    """Cut out the surroundings of a boundary loop, or of several that lie near one another.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    loop : (k,) int64
        Vertices of the boundary loop, ordered as ``BoundaryLoop.vertices``.
    rim_faces : (k,) int64
        The face at each edge of the loop.
    reach : float
        Distance from the loop up to which faces are taken, in mean edge lengths. The rim's own
        faces are always taken.
    rings : int
        Rings of vertices around the loop whose faces are taken however far they are.
    grid : FaceGrid, optional
        Of the mesh; makes many calls cheaper, and changes nothing else.

    Returns
    -------
    Region
        Only faces connected to the loop within the reach; nothing of other sheets nearby. Its
        vertices are snapped to a fine grid, so that the rounding of the input, which depends on
        its units and its distance from the origin, decides no ties.

    Raises
    ------
    StageError
        If all faces at the loop are points.
    """
    frame = _frame(vertices, faces, loop, rim_faces)
    rim = vertices[loop]
    distance = reach * frame.scale
    low, high = rim.min(axis=0) - distance, rim.max(axis=0) + distance
    kept = [rim_faces]
    if rings:
        kept.append(np.flatnonzero(_rings_of_faces(faces, loop, rings)))
    near = np.unique(np.concatenate(kept))
    boxed = _in_box(vertices, faces, low, high) if grid is None else grid.within(low, high)
    candidates = np.union1d(boxed, near)
    used, corners = np.unique(faces[candidates], return_inverse=True)
    corners = corners.reshape(-1, 3)
    found = cKDTree(rim).query(vertices[used], distance_upper_bound=distance)[0]
    taken = np.asarray(np.isfinite(found)[corners].all(axis=1))
    taken[np.searchsorted(candidates, near)] = True
    labels = vertex_components(corners[taken], len(used))
    local_loop = np.searchsorted(used, loop)
    taken &= np.isin(labels[corners[:, 0]], labels[local_loop])
    return _region(vertices, faces, candidates[taken], loop, frame)


def _in_box(vertices: FloatArray, faces: IntArray, low: FloatArray, high: FloatArray) -> IntArray:
    """Faces whose corners all lie in a box."""
    inside = np.ones(len(vertices), dtype=np.bool_)
    for axis in range(3):
        column = vertices[:, axis]
        inside &= column >= low[axis]
        inside &= column <= high[axis]
    return np.flatnonzero(~faces_at(~inside, faces))


@dataclass(frozen=True)
class _Frame:
    """Local coordinates: corner and half the extent of the rim, and the unit."""

    corner: FloatArray
    half: FloatArray
    scale: float


def _frame(vertices: FloatArray, faces: IntArray, loop: IntArray, rim_faces: IntArray) -> _Frame:
    scale = float(edge_lengths(vertices, faces[rim_faces]).mean())
    if scale == 0.0:
        msg = "All faces at this hole have shrunk to points."
        raise StageError(msg)
    rim = vertices[loop]
    corner = rim.min(axis=0)
    return _Frame(corner, 0.5 * (rim.max(axis=0) - corner), scale)


def _region(
    vertices: FloatArray, faces: IntArray, face_ids: IntArray, loop: IntArray, frame: _Frame
) -> Region:
    """Region of some faces."""
    vertex_ids, corners = np.unique(faces[face_ids], return_inverse=True)
    # far from the origin the centre would be rounded; differences to a vertex are not
    positions = (vertices[vertex_ids] - frame.corner - frame.half) / frame.scale
    return Region(
        vertices=np.rint(positions / _GRID) * _GRID,
        faces=np.ascontiguousarray(corners.reshape(-1, 3)),
        known_vertices=np.ones(len(vertex_ids), dtype=np.bool_),
        known_faces=np.ones(len(face_ids), dtype=np.bool_),
        vertex_ids=vertex_ids,
        face_ids=face_ids,
        centre=frame.corner + frame.half,
        scale=frame.scale,
        loop=np.searchsorted(vertex_ids, loop),
    )


def cut_rings(
    vertices: FloatArray,
    faces: IntArray,
    loops: Sequence[IntArray],
    rim_faces: Sequence[IntArray],
    *,
    rings: int,
) -> list[Region | StageError]:
    """Cut out some rings of faces around each of many boundary loops, in one go.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    loops : sequence of (k,) int64
        See `cut_region`.
    rim_faces : sequence of (k,) int64
    rings : int
        Faces that hold a vertex less than so many rings away from the loop are taken.

    Returns
    -------
    list of Region or StageError
        In the order of the loops; the error of `cut_region` for each that has no extent.
    """
    if len(loops) == 0:
        return []
    near = _rings_of_faces(faces, np.concatenate(loops), rings)
    near[np.concatenate(rim_faces)] = True
    face_ids = np.flatnonzero(near)
    used, corners = compacted(faces[face_ids], len(vertices))
    seeds = [np.searchsorted(used, loop) for loop in loops]
    taken = faces_around(corners, len(used), seeds, rings)
    regions: list[Region | StageError] = []
    for loop, rim, rows in zip(loops, rim_faces, taken, strict=True):
        own = np.union1d(face_ids[rows], rim)
        try:
            frame = _frame(vertices, faces, loop, rim)
        except StageError as error:
            regions.append(error)
        else:
            regions.append(_region(vertices, faces, own, loop, frame))
    return regions


def _rings_of_faces(faces: IntArray, seeds: IntArray, rings: int) -> BoolArray:
    """Mark the faces (m,) that hold a vertex less than some rings away from the seeds."""
    marked = np.zeros(int(faces.max()) + 1, dtype=np.bool_)
    marked[seeds] = True
    near = np.zeros(len(faces), dtype=np.bool_)
    for _ in range(rings):
        near = faces_at(marked, faces)
        marked[faces[near]] = True
    return near


def cut_selection(
    vertices: FloatArray,
    faces: IntArray,
    selected: BoolArray,
    *,
    reach: float,
    rings: int = 0,
) -> list[Region]:
    """Cut out the surroundings of each connected patch of selected vertices.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    selected : (n,) bool
        Vertices without faces are ignored.
    reach : float
        In mean edge lengths around each patch.
    rings : int
        See `cut_region`.

    Returns
    -------
    list of Region
        One for each patch connected by edges, ordered by its smallest vertex; the patch is what
        is not known, its ``loop`` the known vertices next to it, in ascending order. Other
        patches are left out, so that nothing is learnt from them.
    """
    used = np.zeros(len(vertices), dtype=np.bool_)
    used[faces[faces_at(selected, faces)]] = True
    chosen = selected & used
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    ends = ends[chosen[ends].all(axis=1)]
    labels = vertex_components(np.column_stack([ends, ends[:, 1]]), len(vertices))
    regions = []
    for label in np.unique(labels[chosen]):
        patch = chosen & (labels == label)
        open_faces = np.flatnonzero(~faces_at(chosen & ~patch, faces))
        rest = faces[open_faces]
        at_patch = np.flatnonzero(faces_at(patch, rest))
        around = np.unique(rest[at_patch])
        rim = around[~patch[around]]
        region = cut_region(vertices, rest, around, at_patch, reach=reach, rings=rings)
        known = ~patch[region.vertex_ids]
        regions.append(
            replace(
                region,
                face_ids=open_faces[region.face_ids],
                known_vertices=known,
                known_faces=known[region.faces].all(axis=1),
                loop=np.searchsorted(region.vertex_ids, rim),
            )
        )
    return regions
