"""The cut-out part of the mesh round one hole, in local units."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, edge_lengths
from meshlab_lowrank.mesh.topology import faces_at, vertex_components

_GRID = 2.0**-26  # of local coordinates: far above rounding, far below any triangle that matters


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
        that fills the hole runs from loop[i] to loop[i + 1].
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
) -> Region:
    """Cut out the surroundings of a boundary loop.

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
    scale = float(edge_lengths(vertices, faces[rim_faces]).mean())
    if scale == 0.0:
        msg = "All faces at this hole have shrunk to points."
        raise StageError(msg)
    rim = vertices[loop]
    corner = rim.min(axis=0)
    half = 0.5 * (rim.max(axis=0) - corner)
    distance = reach * scale
    inside = np.ones(len(vertices), dtype=np.bool_)
    for axis in range(3):
        column = vertices[:, axis]
        inside &= column >= rim[:, axis].min() - distance
        inside &= column <= rim[:, axis].max() + distance
    near = _rings_of_faces(faces, loop, rings)
    near[rim_faces] = True
    inside[faces[near]] = True
    boxed = np.flatnonzero(~faces_at(~inside, faces))
    used, corners = np.unique(faces[boxed], return_inverse=True)
    corners = corners.reshape(-1, 3)
    found = cKDTree(rim).query(vertices[used], distance_upper_bound=distance)[0]
    kept = np.isfinite(found)[corners].all(axis=1)
    kept |= near[boxed]
    labels = vertex_components(corners[kept], len(used))
    local_loop = np.searchsorted(used, loop)
    kept &= np.isin(labels[corners[:, 0]], labels[local_loop])
    face_ids = boxed[kept]
    vertex_ids, corners = np.unique(faces[face_ids], return_inverse=True)
    # far from the origin the centre would be rounded; differences to a vertex are not
    positions = (vertices[vertex_ids] - corner - half) / scale
    return Region(
        vertices=np.rint(positions / _GRID) * _GRID,
        faces=np.ascontiguousarray(corners.reshape(-1, 3)),
        known_vertices=np.ones(len(vertex_ids), dtype=np.bool_),
        known_faces=np.ones(len(face_ids), dtype=np.bool_),
        vertex_ids=vertex_ids,
        face_ids=face_ids,
        centre=corner + half,
        scale=scale,
        loop=np.searchsorted(vertex_ids, loop),
    )


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
