"""Stage 1, first half: close one boundary loop and give the fill the local edge length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.topology import edges_of
from meshlab_lowrank.stage0_region import Region

_ROUNDS = 20
_LENGTH_FACTOR = 0.92  # the remesher's mean edge is longer than its target by this much


def close_region(region: Region, *, edge_length: float | None = None) -> Region:
    """Fill ``region.loop`` with triangles of the local edge length.

    Existing vertices, faces and edges stay as they are; new rows are appended.

    Parameters
    ----------
    region : Region
    edge_length : float or None
        Edge length of the new triangles in local units; None: that of the boundary loop.

    Returns
    -------
    Region
        Closed at the loop, manifold, oriented like the surroundings.

    Raises
    ------
    StageError
        If MeshLab leaves the loop open or tears it.
    """
    loop = region.loop
    corners = region.vertices[loop]
    length = edge_length
    if length is None:
        length = float(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1).mean())
    positions, faces = _filled_loop(corners, _outward(region), length)
    k, n = len(loop), len(region.vertices)
    new = len(positions) - k
    ids = np.concatenate([loop, np.arange(n, n + new)])
    return replace(
        region,
        vertices=np.concatenate([region.vertices, positions[k:]]),
        faces=np.concatenate([region.faces, ids[faces]]),
        known_vertices=np.concatenate([region.known_vertices, np.zeros(new, dtype=np.bool_)]),
        known_faces=np.concatenate([region.known_faces, np.zeros(len(faces), dtype=np.bool_)]),
        vertex_ids=np.concatenate([region.vertex_ids, np.full(new, -1)]),
        face_ids=np.concatenate([region.face_ids, np.full(len(faces), -1)]),
    )


def _outward(region: Region) -> FloatArray:
    """Opposite corners of the faces at the edges of the loop, (k, 3)."""
    n = len(region.vertices)
    tail, head = region.loop, np.roll(region.loop, -1)
    starts, ends = region.faces, np.roll(region.faces, -1, axis=1)
    keys = (starts * n + ends).ravel()
    order = np.argsort(keys)
    found = order[np.searchsorted(keys[order], head * n + tail)]
    apex = np.roll(region.faces, 1, axis=1).ravel()[found]
    return region.vertices[apex]


def _filled_loop(
    corners: FloatArray, apexes: FloatArray, length: float
) -> tuple[FloatArray, IntArray]:
    """Close a loop with MeshLab; give the loop's corners followed by new vertices, and the faces.

    MeshLab sees the loop with a strip of faces of its own, so that neither pinched vertices nor
    other holes nearby mislead it.
    """
    k = len(corners)
    tail = np.arange(k)
    head = np.roll(tail, -1)
    middle = 0.5 * (corners + corners[head])
    strip = np.concatenate([corners, 0.5 * (middle + apexes)])
    faces = np.concatenate(
        [np.stack([head, tail, k + tail], axis=1), np.stack([head, k + tail, k + head], axis=1)]
    )
    mesh_set = pymeshlab.MeshSet(verbose=False)
    mesh_set.add_mesh(pymeshlab.Mesh(strip, faces.astype(np.int32)))
    mesh = mesh_set.current_mesh()
    mesh.add_face_custom_scalar_attribute(np.arange(len(faces)) + 1.0, "strip")
    mesh.add_vertex_custom_scalar_attribute(np.arange(len(strip)) + 1.0, "strip")
    mesh_set.compute_selection_by_condition_per_face(condselect=f"(strip > 0.5) && (strip < {k}.5)")
    mesh_set.meshing_close_holes(
        maxholesize=k + 1,
        selected=True,
        newfaceselected=True,
        selfintersection=True,
        refinehole=False,
        refineholeedgelen=pymeshlab.PercentageValue(3),
    )
    mesh_set.compute_selection_by_condition_per_face(condselect="strip < 0.5")
    mesh_set.meshing_isotropic_explicit_remeshing(
        iterations=_ROUNDS,
        adaptive=False,
        selectedonly=True,
        targetlen=pymeshlab.PureValue(length * _LENGTH_FACTOR),
        featuredeg=180.0,
        checksurfdist=False,
        maxsurfdist=pymeshlab.PercentageValue(1),
        splitflag=True,
        collapseflag=True,
        swapflag=True,
        smoothflag=True,
        reprojectflag=False,
    )
    mesh = mesh_set.current_mesh()
    marks = mesh.vertex_custom_scalar_attribute_array("strip")
    filled = mesh.face_matrix()[mesh.face_custom_scalar_attribute_array("strip") < 0.5]
    kept = np.flatnonzero(marks > 0.5)
    if not np.array_equal(mesh.vertex_matrix()[kept], strip):
        msg = "MeshLab moved the rim of the hole while it closed it."
        raise StageError(msg)
    number = np.full(len(marks), -1, dtype=np.int64)
    number[kept[:k]] = np.arange(k)
    added = np.flatnonzero(marks < 0.5)
    number[added] = np.arange(k, k + len(added))
    result = number[filled.astype(np.int64)]
    _check_closed(result, k)
    return np.concatenate([corners, mesh.vertex_matrix()[added]]), result


def _check_closed(faces: IntArray, k: int) -> None:
    """Raise unless the border of the faces is the loop 0, 1, ..., k - 1 and nothing else."""
    edges = edges_of(faces)
    border = edges.vertices[edges.face_count == 1]
    tail = np.arange(k)
    loop = np.sort(np.stack([tail, np.roll(tail, -1)], axis=1), axis=1)
    loop = loop[np.lexsort((loop[:, 1], loop[:, 0]))]
    if not np.array_equal(border, loop) or np.any(edges.face_count > 2) or np.any(faces < 0):
        msg = f"MeshLab did not close this loop of {k} edges cleanly."
        raise StageError(msg)
