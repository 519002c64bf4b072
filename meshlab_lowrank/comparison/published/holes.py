"""What the published fillers share: the holes of a mesh, cut out, and the mesh with their fills."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.stages.stage0_batch import with_fill
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import Region, cut_region
from meshlab_lowrank.stages.stage1a_close_rim import without_double_edges

FillRegion: TypeAlias = Callable[[Region], Region]

_LOG = logging.getLogger(__name__)
_RINGS = 6  # of measured faces around a hole that its filler sees


def fill_each(ms: Any, fill: FillRegion) -> None:
    """Fill the selected loops of the current mesh one by one; the filled mesh becomes current.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Faces at the loops that are to be filled are selected.
    fill : callable
        Takes a region that is open at its loop and gives it with its fill.

    Raises
    ------
    StageError
        If no loop can be filled. Where some can, the others stay open.
    """
    vertices, faces, loops = selected_loops(ms)
    points, filled, errors = [vertices], [faces], []
    for loop, rim_faces in loops:
        try:
            region = fill(cut_region(vertices, faces, loop, rim_faces, reach=0.0, rings=_RINGS))
        except StageError as error:
            _LOG.warning("A loop of %d edges stays open: %s", len(loop), error)
            errors.append(error)
            continue
        new = region.vertex_ids < 0
        ids = region.vertex_ids.copy()
        ids[new] = sum(map(len, points)) + np.arange(int(new.sum()))
        points.append(region.to_global(region.vertices[new]))
        filled.append(ids[region.faces[~region.known_faces]])
    if len(errors) == len(loops):
        raise errors[0] if errors else StageError("No loop at a selected face can be filled.")
    add_mesh(ms, np.concatenate(points), np.concatenate(filled))


def selected_loops(
    ms: Any,
) -> tuple[FloatArray, IntArray, list[tuple[IntArray, IntArray]]]:
    """Give the current mesh and the fillable loops at its selected faces.

    Returns
    -------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    loops : list of ((k,) int64, (k,) int64)
        Vertices of each in the order of its fill, and the face at each of its edges.
    """
    mesh = ms.current_mesh()
    vertices = np.asarray(mesh.vertex_matrix(), dtype=np.float64)
    faces = np.asarray(mesh.face_matrix(), dtype=np.int64)
    selected = np.asarray(mesh.face_selection_array(), dtype=np.bool_)
    loops = [
        (loop.vertices, loop.faces)
        for loop in boundary_loops(vertices, faces)
        if not loop.reason and selected[loop.faces].any()
    ]
    return vertices, faces, loops


def add_mesh(ms: Any, vertices: FloatArray, faces: IntArray) -> None:
    """Add a mesh, which becomes the current one."""
    ms.add_mesh(pymeshlab.Mesh(vertices, faces))


def rim_normals(region: Region) -> FloatArray:
    """Give the normals (k, 3) at the vertices of the loop: means over the measured faces there."""
    faces = region.faces[region.known_faces]
    return vertex_normals(region.vertices, faces)[region.loop]


def closed(region: Region, points: FloatArray, faces: IntArray) -> Region:
    """Append a fill to a region; edges that the surroundings have already are split.

    Parameters
    ----------
    region : Region
    points : (v, 3) float64
        New vertices.
    faces : (f, 3) int64
        Numbers below k are places on the loop, k and above are new vertices.
    """
    n = len(region.vertices)
    numbers = np.concatenate([region.loop, n + np.arange(len(points))])
    vertices = np.concatenate([region.vertices, points])
    at_rim = np.zeros(n, dtype=np.bool_)
    at_rim[region.loop] = True
    beside = region.faces[faces_at(at_rim, region.faces)]
    ends, filled = without_double_edges(len(vertices), beside, numbers[faces])
    middles = vertices[ends].mean(axis=1)
    return with_fill(region, np.concatenate([vertices[n:], middles]), filled)
