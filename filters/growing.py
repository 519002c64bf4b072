"""Append vertices and faces to the current mesh, in place.

No filter takes new geometry into an existing layer, and a layer made anew has another id, lost
attributes, and leaves the user's references to the old one dangling. So the new elements are bred
from existing ones:

1. Vertices around the holes are set aside, and faces are bred from those at them. New vertices and
   faces are appended; old faces keep their row, but corners may move to new vertices.
2. Among the new faces, ones that share no vertex are picked, as many as are to be added.
3. Each new vertex is moved to the vertex that it shall become, the corners of old faces to their
   old ones; merging vertices at one place then makes the connectivity. Of the faces that were not
   picked, it deletes those that collapse; others are deleted before. Vertices that coincided
   from the first were set aside as well.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pymeshlab

from meshlab_lowrank.filters.breeding import Band, Growth, breed, can_tear
from meshlab_lowrank.filters.placing import CARRIED, Aside, carry, place, select_at
from meshlab_lowrank.filters.reading import has_vertex_attribute, wedge_coordinates
from meshlab_lowrank.filters.undoing import Undo
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.mesh_files import INPAINT_TRUST

_HASH = 0x9E3779B97F4A7C15  # odd, of bits that follow no pattern


@dataclass(frozen=True)
class Fill:
    """What was appended to a mesh of n vertices and m faces.

    Attributes
    ----------
    vertices : (v, 3) float64
        Positions that the new vertices shall have.
    faces : (q, 3) int64
        The new faces, in their order.
    vertex_count, face_count : int
        n and m.
    trust, error : (v,) float64
        See `InpaintResult`.
    """

    vertices: FloatArray
    faces: IntArray
    vertex_count: int
    face_count: int
    trust: FloatArray
    error: FloatArray


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


def grow(ms: pymeshlab.MeshSet, growth: Growth, undo: Undo) -> Grown:
    """Append vertices and faces to the current mesh; what was there keeps its row and its data.

    Vertices around the holes stay aside, and all normals are lost. On meshes with texture
    coordinates per wedge, MeshLab switches those per vertex on, with undefined values.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh is compact.
    growth : Growth
    undo : Undo
        Gets what is about to change.

    Returns
    -------
    Grown
    """
    mesh = ms.current_mesh()
    tearing = can_tear(mesh)
    vertices, faces = mesh.vertex_matrix(), mesh.face_matrix()
    around = _around(faces, growth.new_faces, growth.band_size(tearing=tearing), len(vertices))
    around[growth.bad_vertices] = True
    select_at(ms, vertices[around | coincident(vertices)])
    chosen = mesh.vertex_selection_array()
    positions = vertices[chosen]
    rows = np.flatnonzero(faces_at(chosen, faces))
    wedges = wedge_coordinates(mesh)
    wedges = None if wedges is None else wedges[rows]
    band = Band(rows, faces[rows].astype(np.int64), wedges, len(vertices), len(faces))
    del vertices, faces  # breeding takes much memory
    undo.remember(np.flatnonzero(chosen), positions, band)
    aside = Aside(ms)

    torn = tearing or len(growth.bad_vertices) > 0
    with _quality_kept(ms, undo) if torn else contextlib.nullcontext():
        brood = breed(ms, growth, band, aside, tearing=tearing)
    aside.gather()
    _restore_wedges(ms, band, brood.kept, aside)
    old = len(positions)
    target = np.zeros((len(aside.ids), 3))
    target[:, 0] = aside.start
    target[:old, 1] = aside.ids[:old]
    target[old:, 1] = aside.ids[0]  # with which unused vertices merge
    row = old - band.vertex_count  # of a new vertex, less its index
    moved = brood.kept >= band.vertex_count
    target[row + brood.kept[moved], 1] = band.corners[moved]
    final = band.vertex_count + np.arange(growth.new_vertex_count)
    target[row + brood.spare, 1] = final
    target[row + brood.picked, 1] = growth.new_faces[brood.order]
    others = brood.others.astype(np.float64)
    others[brood.others >= band.vertex_count] = target[
        row + brood.others[brood.others >= band.vertex_count], 1
    ]
    left = (others != np.roll(others, 1, axis=1)).all(axis=1).any()
    if left:
        target[row + brood.picked, 2] = 1.0 + np.arange(len(brood.picked))[:, None]
    aside.move(target)
    if left:
        ms.compute_selection_by_condition_per_face(
            condselect=f"fi >= {band.face_count} && (z0 < 1 || z0 != z1 || z1 != z2)"
        )
        ms.meshing_remove_selected_faces()
        aside.select()
        ms.compute_coord_by_function(x="x", y="y", z="0", onselected=True)
    ms.meshing_remove_duplicate_vertices()
    aside.ids = np.concatenate([aside.ids[:old], final])
    return Grown(brood.order, aside, positions)


@contextlib.contextmanager
def _quality_kept(ms: pymeshlab.MeshSet, undo: Undo) -> Iterator[None]:
    """Write the quality of vertices again if there is one."""
    mesh = ms.current_mesh()
    switches = {"normalize": False, "map": False, "onselected": False}
    if not mesh.has_vertex_scalar():
        yield
    elif not has_vertex_attribute(mesh, INPAINT_TRUST):  # in which it can wait
        ms.compute_new_custom_scalar_attribute_per_vertex(name=INPAINT_TRUST, expr="q")
        yield
        ms.compute_scalar_by_function_per_vertex(q=INPAINT_TRUST, **switches)
    else:
        quality = mesh.vertex_scalar_array()
        yield
        positions = mesh.vertex_matrix()
        values = np.zeros(len(positions))
        values[: len(quality)] = quality
        with undo.moving_all(positions):
            carry(ms, values)
            ms.compute_scalar_by_function_per_vertex(q=CARRIED, **switches)
            place(ms, positions)


def coincident(vertices: FloatArray) -> BoolArray:
    """Mark vertices (n, 3) that lie where others lie, and maybe a few more."""
    keys = np.zeros(len(vertices), dtype=np.uint64)
    for column in vertices.T:
        keys = (keys ^ (column + 0.0).view(np.uint64)) * np.uint64(_HASH)
        keys ^= keys >> np.uint64(32)
    ordered = np.sort(keys)
    repeated = ordered[1:][ordered[1:] == ordered[:-1]]
    return np.isin(keys, repeated) if len(repeated) else np.zeros(len(keys), dtype=np.bool_)


def _around(faces: IntArray, new_faces: IntArray, wanted: int, n: int) -> BoolArray:
    """Mark vertices (n,) around the holes, at which there are as many faces as wanted or all."""
    inside = np.zeros(n, dtype=np.bool_)
    inside[new_faces[new_faces < n]] = True
    found = 0
    while True:
        touched = faces[faces_at(inside, faces)]
        inside[touched] = True
        if len(touched) >= wanted or len(touched) == found:
            return inside
        found = len(touched)


def _restore_wedges(ms: pymeshlab.MeshSet, band: Band, kept: IntArray, aside: Aside) -> None:
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
