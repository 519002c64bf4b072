"""Append vertices and faces to the current mesh, in place.

No filter takes new geometry into an existing layer, and a layer made anew has another id, lost
attributes, and leaves the user's references to the old one dangling. So the new elements are bred
from existing ones:

1. Vertices around the holes are set aside, and faces between them are split at the middle of their
   edges, again and again. New vertices and faces are appended; a split face keeps its row, but its
   corners move to new vertices.
2. Among the new faces, ones that share no vertex are picked, as many as are to be added.
   The other new faces are deleted.
3. Each new vertex is moved to the vertex that it shall become, the corners of split faces to their
   old ones; merging vertices at one place then makes the connectivity. Vertices that coincided
   before were set aside as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymeshlab

from meshlab_lowrank.filters.placing import Aside, select_at
from meshlab_lowrank.filters.reading import texture_indices, wedge_coordinates
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import faces_at

_SPLITS = 3  # fewer leave no spare vertex inside a face
_HASH = 0x9E3779B97F4A7C15  # odd, of bits that follow no pattern
_FACES_PER_SPLIT_FACE = 4  # picked at three splits; 64 new faces, of which 1 in 6 at the very best


@dataclass(frozen=True)
class Growth:
    """What to append to a mesh of n vertices.

    Attributes
    ----------
    new_faces : (q, 3) int64
        Indices from n on are new vertices; each new vertex is used.
    new_vertex_count : int
    textures : (q,) int64
        Texture index that each new face shall have; only read on meshes with several textures.
    """

    new_faces: IntArray
    new_vertex_count: int
    textures: IntArray


@dataclass(frozen=True)
class Grown:
    """What has become of the mesh.

    Attributes
    ----------
    order : (q,) int64
        The new faces in the order in which they were appended: 0, 1, 2, ... unless the mesh has
        several textures.
    aside : Aside
        All new vertices, and old ones among which are all that new faces use.
    positions : (k, 3) float64
        Where the old ones lay.
    """

    order: IntArray
    aside: Aside
    positions: FloatArray


@dataclass(frozen=True)
class _Band:
    """Faces to breed from: those between the vertices that are set aside.

    Attributes
    ----------
    rows : (b,) int64
    corners : (b, 3) int64
    wedges : (b, 3, 2) float64 or None
        Their texture coordinates, if they have any.
    vertex_count, face_count : int
        Of the mesh as it was.
    """

    rows: IntArray
    corners: IntArray
    wedges: FloatArray | None
    vertex_count: int
    face_count: int


def grow(ms: pymeshlab.MeshSet, growth: Growth) -> Grown:
    """Append vertices and faces to the current mesh; what was there keeps its row and its data.

    Vertices around the holes stay aside, all normals are lost, and polygons become triangles. On
    meshes with texture coordinates per wedge, MeshLab switches those per vertex on, with undefined
    values.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh is compact and has manifold edges.
    growth : Growth

    Returns
    -------
    Grown
    """
    ms.meshing_poly_to_tri()  # split faces would pass their hidden edges on
    mesh = ms.current_mesh()
    vertices, faces = mesh.vertex_matrix(), mesh.face_matrix()
    select_at(ms, vertices[_around(faces, growth, len(vertices)) | coincident(vertices)])
    aside = Aside(ms)
    positions = vertices[aside.ids]
    rows = np.flatnonzero(~faces_at(~mesh.vertex_selection_array(), faces))
    wedges = wedge_coordinates(mesh)
    wedges = None if wedges is None else wedges[rows]
    band = _Band(rows, faces[rows].astype(np.int64), wedges, len(vertices), len(faces))
    del vertices, faces  # splitting takes much memory

    kept, new, picked, order = _split(ms, growth, band, aside)
    aside.gather()
    _restore_wedges(ms, band, kept, aside)
    old = len(positions)
    target = np.zeros((len(aside.ids), 3))
    target[:, 0] = aside.start
    target[:old, 1] = aside.ids[:old]
    target[old:, 1] = aside.ids[0]  # with which unused vertices merge
    row = old - band.vertex_count  # of a new vertex, less its index
    target[row + kept[kept >= band.vertex_count], 1] = band.corners[kept >= band.vertex_count]
    final = band.vertex_count + np.arange(growth.new_vertex_count)
    spare = _spare_vertices(kept, mesh.vertex_number(), band.vertex_count)
    target[row + spare[: len(final)], 1] = final
    target[row + new[picked], 1] = growth.new_faces[order]
    target[row + new[picked], 2] = 1.0 + np.arange(len(picked))[:, None]
    aside.move(target)
    ms.compute_selection_by_condition_per_face(
        condselect=f"fi >= {band.face_count} && (z0 < 1 || z0 != z1 || z1 != z2)"
    )
    ms.meshing_remove_selected_faces()
    aside.select()
    ms.compute_coord_by_function(x="x", y="y", z="0", onselected=True)
    ms.meshing_remove_duplicate_vertices()
    aside.ids = np.concatenate([aside.ids[:old], final])
    return Grown(order, aside, positions)


def coincident(vertices: FloatArray) -> BoolArray:
    """Mark vertices (n, 3) that lie where others lie, and maybe a few more."""
    keys = np.zeros(len(vertices), dtype=np.uint64)
    for column in vertices.T:
        keys = (keys ^ (column + 0.0).view(np.uint64)) * np.uint64(_HASH)
        keys ^= keys >> np.uint64(32)
    ordered = np.sort(keys)
    repeated = ordered[1:][ordered[1:] == ordered[:-1]]
    return np.isin(keys, repeated) if len(repeated) else np.zeros(len(keys), dtype=np.bool_)


def _around(faces: IntArray, growth: Growth, n: int) -> BoolArray:
    """Mark vertices around the holes between which there are faces enough to breed from."""
    wanted = 1 + len(growth.new_faces) // _FACES_PER_SPLIT_FACE
    inside = np.zeros(n, dtype=np.bool_)
    inside[growth.new_faces[growth.new_faces < n]] = True
    found = 0
    while True:
        touched = faces[faces_at(inside, faces)]
        inside[touched] = True
        if len(touched) >= wanted or len(touched) == found:
            return inside
        found = len(touched)


def _split(
    ms: pymeshlab.MeshSet, growth: Growth, band: _Band, aside: Aside
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Split faces until enough can be picked.

    Returns the corners that the old faces of the band have now, those of the new faces, which of
    these are picked, and which of the wanted faces each becomes.
    """
    first = band.vertex_count
    condition, splits, bred = (
        " && ".join(f"x{i} >= {aside.start!r}" for i in range(3)),
        _SPLITS,
        "1",
    )
    while True:
        ms.compute_selection_by_condition_per_face(condselect=condition)
        ms.meshing_surface_subdivision_midpoint(
            iterations=splits, threshold=pymeshlab.PureValue(0), selected=True
        )
        corners = ms.current_mesh().face_matrix()
        kept = corners[band.rows].astype(np.int64)
        new = corners[band.face_count :].astype(np.int64)
        del corners
        if _separable(kept, band):
            textures = texture_indices(ms)
            picked, order = _pick(kept, new, growth, first, textures)
            if len(picked) == len(growth.new_faces):
                return kept, new, picked, order
            if textures is not None:  # of one texture there may be plenty by now
                missing = np.delete(growth.textures, order)
                bred = "(" + " || ".join(f"ti == {ti}" for ti in np.unique(missing)) + ")"
        condition, splits = f"(vi0 >= {first} || vi1 >= {first} || vi2 >= {first}) && {bred}", 1


def _separable(kept: IntArray, band: _Band) -> bool:
    """Whether the split faces can be given their old corners back, each on its own."""
    new = kept >= band.vertex_count
    own = kept[new]
    return len(np.unique(own)) == len(own) and bool((new | (kept == band.corners)).all())


def _spare_vertices(kept: IntArray, total: int, first: int) -> IntArray:
    """Give the new vertices that are no corner of an old face, ascending."""
    spare = np.zeros(total, dtype=np.bool_)
    spare[first:] = True
    spare[kept] = False
    return np.flatnonzero(spare)


def _pick(
    kept: IntArray, new: IntArray, growth: Growth, first: int, textures: IntArray | None
) -> tuple[IntArray, IntArray]:
    """Pick new faces without shared vertices, and say which of the wanted faces each becomes.

    The first spare vertices are kept: a merged vertex has the row of its first one.
    """
    total = 1 + int(new.max())
    spare = np.zeros(total, dtype=np.bool_)
    spare[_spare_vertices(kept, total, first)[growth.new_vertex_count :]] = True
    candidates = _disjoint(new, np.flatnonzero(spare[new].all(axis=1)), first)
    if textures is None:
        count = min(len(candidates), len(growth.new_faces))
        return candidates[:count], np.arange(count)
    available = textures[len(textures) - len(new) :][candidates]
    picked, order = [], []
    for texture in np.unique(growth.textures):
        wanted = np.flatnonzero(growth.textures == texture)
        bred = candidates[available == texture][: len(wanted)]
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


def _restore_wedges(ms: pymeshlab.MeshSet, band: _Band, kept: IntArray, aside: Aside) -> None:
    """Give split faces the texture coordinates of their old corners."""
    if band.wedges is None:
        return
    first = band.vertex_count
    moved = kept >= first
    values = np.zeros((len(aside.ids), 3))
    values[np.searchsorted(aside.ids, kept[moved]), :2] = band.wedges[moved]
    aside.hand(values)
    ms.compute_selection_by_condition_per_face(
        condselect=f"fi < {band.face_count} && (vi0 >= {first} || vi1 >= {first} || vi2 >= {first})"
    )
    ms.compute_texcoord_by_function_per_wedge(
        **{f"u{i}": f"vi{i} >= {first} ? nx{i} : wtu{i}" for i in range(3)},
        **{f"v{i}": f"vi{i} >= {first} ? ny{i} : wtv{i}" for i in range(3)},
        onselected=True,
    )
