"""Append vertices and faces to the current mesh, in place.

No filter takes new geometry into an existing layer, and a layer made anew has another id, lost
attributes, and leaves the user's references to the old one dangling. So the new elements are bred
from existing ones:

1. Faces around the holes are split at the middle of their edges, again and again. New vertices and
   faces are appended; a split face keeps its row, but its corners move to new vertices.
2. Among the new faces, ones that share no vertex are picked, as many as are to be added.
   The other new faces are deleted.
3. Each vertex is moved to a place that stands for the vertex it shall become, the corners of split
   faces to their old ones; merging vertices at one place then makes the connectivity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymeshlab

from meshlab_lowrank.filters.placing import place
from meshlab_lowrank.filters.reading import texture_indices, wedge_coordinates
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray

_FIRST_SPLITS = 3  # fewer leave no spare vertex inside a face
_FACES_PER_SPLIT_FACE = 4  # picked at three splits; 64 new faces, of which 1 in 6 at the very best


@dataclass(frozen=True)
class Growth:
    """What to append to a mesh of n vertices and m faces.

    Attributes
    ----------
    faces : (m, 3) int64
        The faces that are there.
    new_faces : (q, 3) int64
        Indices from n on are new vertices; each new vertex is used.
    vertex_count : int
        n.
    new_vertex_count : int
    textures : (q,) int64
        Texture index that each new face shall have; only read on meshes with several textures.
    """

    faces: IntArray
    new_faces: IntArray
    vertex_count: int
    new_vertex_count: int
    textures: IntArray


def grow(ms: pymeshlab.MeshSet, growth: Growth) -> IntArray:
    """Append vertices and faces to the current mesh; what was there keeps its row and its data.

    All positions and normals are lost, and polygons become triangles. On meshes with texture
    coordinates per wedge, MeshLab switches those per vertex on, with undefined values.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh is compact and has manifold edges.
    growth : Growth

    Returns
    -------
    (q,) int64
        The new faces in the order in which they were appended: 0, 1, 2, ... unless the mesh has
        several textures.
    """
    ms.meshing_poly_to_tri()  # split faces would pass their hidden edges on
    wedges = wedge_coordinates(ms.current_mesh())
    corners, picked, order = _split(ms, growth)
    _restore_wedges(ms, growth, corners, wedges)
    new_corners = growth.new_faces[order]

    vertex_total = ms.current_mesh().vertex_number()
    label = np.zeros((vertex_total, 3))
    label[corners[picked], 0] = 1.0 + np.arange(len(picked))[:, None]
    place(ms, label, from_zero=wedges is not None)
    ms.compute_selection_by_condition_per_face(
        condselect=f"fi >= {len(growth.faces)} && (x0 < 1 || x0 != x1 || x1 != x2)"
    )
    ms.meshing_remove_selected_faces()

    target = np.zeros((vertex_total, 3))  # unused vertices merge with vertex 0
    target[: growth.vertex_count, 0] = np.arange(growth.vertex_count)
    target[corners[: len(growth.faces)], 0] = growth.faces
    representatives = _spare_vertices(corners, growth)[: growth.new_vertex_count]
    target[representatives, 0] = growth.vertex_count + np.arange(growth.new_vertex_count)
    target[corners[picked], 0] = new_corners
    place(ms, target, from_zero=False)
    ms.meshing_remove_duplicate_vertices()
    return order


def _split(ms: pymeshlab.MeshSet, growth: Growth) -> tuple[IntArray, IntArray, IntArray]:
    """Split faces until enough can be picked: corners of all faces, picked rows, their order."""
    inside = _band(growth)
    places = np.zeros((growth.vertex_count, 3))
    places[:, 0] = np.arange(growth.vertex_count)  # no edge of length 0, which would stay whole
    places[:, 1] = inside
    place(ms, places)
    first = growth.vertex_count
    condition, splits, bred = "y0 + y1 + y2 > 0", _FIRST_SPLITS, "1"
    while True:
        ms.compute_selection_by_condition_per_face(condselect=condition)
        ms.meshing_surface_subdivision_midpoint(
            iterations=splits, threshold=pymeshlab.PureValue(0), selected=True
        )
        corners = ms.current_mesh().face_matrix().astype(np.int64)
        if _separable(corners, growth):
            textures = texture_indices(ms)
            picked, order = _pick(corners, growth, textures)
            if len(picked) == len(growth.new_faces):
                return corners, picked, order
            if textures is not None:  # of one texture there may be plenty by now
                missing = np.delete(growth.textures, order)
                bred = "(" + " || ".join(f"ti == {ti}" for ti in np.unique(missing)) + ")"
        condition, splits = f"(vi0 >= {first} || vi1 >= {first} || vi2 >= {first}) && {bred}", 1


def _band(growth: Growth) -> BoolArray:
    """Mark vertices around the holes at which there are faces enough to breed from."""
    wanted = 1 + len(growth.new_faces) // _FACES_PER_SPLIT_FACE
    inside = np.zeros(growth.vertex_count, dtype=np.bool_)
    inside[growth.new_faces[growth.new_faces < growth.vertex_count]] = True
    while True:
        touched = growth.faces[inside[growth.faces].any(axis=1)]
        if len(touched) >= wanted or inside[touched].all():
            return inside
        inside[touched] = True


def _separable(corners: IntArray, growth: Growth) -> bool:
    """Whether the split faces can be given their old corners back, each on its own."""
    old = corners[: len(growth.faces)]
    new = old >= growth.vertex_count
    own = old[new]
    return len(np.unique(own)) == len(own) and bool((new | (old == growth.faces)).all())


def _spare_vertices(corners: IntArray, growth: Growth) -> IntArray:
    """Give the new vertices that are no corner of an old face, ascending."""
    spare = np.zeros(int(corners.max()) + 1, dtype=np.bool_)
    spare[growth.vertex_count :] = True
    spare[corners[: len(growth.faces)]] = False
    return np.flatnonzero(spare)


def _pick(
    corners: IntArray, growth: Growth, textures: IntArray | None
) -> tuple[IntArray, IntArray]:
    """Pick new faces without shared vertices, and say which of the wanted faces each becomes.

    The first spare vertices are kept: a merged vertex has the row of its first one.
    """
    spare = np.zeros(int(corners.max()) + 1, dtype=np.bool_)
    spare[_spare_vertices(corners, growth)[growth.new_vertex_count :]] = True
    first = len(growth.faces)
    candidates = first + np.flatnonzero(spare[corners[first:]].all(axis=1))
    candidates = _disjoint(corners, candidates, growth.vertex_count)
    if textures is None:
        count = min(len(candidates), len(growth.new_faces))
        return candidates[:count], np.arange(count)
    picked, order = [], []
    for texture in np.unique(growth.textures):
        wanted = np.flatnonzero(growth.textures == texture)
        bred = candidates[textures[candidates] == texture][: len(wanted)]
        picked.append(bred)
        order.append(wanted[: len(bred)])
    rows, wanted = np.concatenate(picked), np.concatenate(order)
    ascending = np.argsort(rows)
    return rows[ascending], wanted[ascending]


def _disjoint(corners: IntArray, candidates: IntArray, first_vertex: int) -> IntArray:
    """Choose many faces without shared vertices: those that win at all three corners, by lot."""
    total = len(candidates)
    lot = np.random.default_rng(0).permutation(total)
    chosen = []
    while len(candidates):
        mine = corners[candidates] - first_vertex
        best = np.full(int(mine.max()) + 1, total)
        np.minimum.at(best, mine.ravel(), np.repeat(lot, 3))
        winner = (best[mine] == lot[:, None]).all(axis=1)
        chosen.append(candidates[winner])
        used = np.zeros(len(best), dtype=np.bool_)
        used[mine[winner]] = True
        left = ~used[mine].any(axis=1)
        candidates, lot = candidates[left], lot[left]
    return np.sort(np.concatenate(chosen)) if chosen else candidates


def _restore_wedges(
    ms: pymeshlab.MeshSet, growth: Growth, corners: IntArray, wedges: FloatArray | None
) -> None:
    """Give split faces the texture coordinates of their old corners."""
    if wedges is None:
        return
    old = corners[: len(growth.faces)]
    moved = old >= growth.vertex_count
    places = np.zeros((ms.current_mesh().vertex_number(), 3))
    places[old[moved], :2] = wedges[moved]
    place(ms, places)
    first = growth.vertex_count
    ms.compute_selection_by_condition_per_face(
        condselect=f"fi < {len(old)} && (vi0 >= {first} || vi1 >= {first} || vi2 >= {first})"
    )
    ms.compute_texcoord_by_function_per_wedge(
        **{f"u{i}": f"vi{i} >= {first} ? x{i} : wtu{i}" for i in range(3)},
        **{f"v{i}": f"vi{i} >= {first} ? y{i} : wtv{i}" for i in range(3)},
        onselected=True,
    )
