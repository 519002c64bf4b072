"""The table of the boundary loops of a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from meshlab_lowrank.mesh.boundary_walk import area_vector, rim_centre
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, face_vectors, normalized
from meshlab_lowrank.mesh.validation import check_arrays
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop, boundary_loops

_FLAT = 1e-3  # area over the square of the length, below which a loop looks nowhere; a circle: 0.08


def measure_holes(vertices: ArrayLike, faces: ArrayLike) -> dict[str, list[Any]]:
    """Tabulate the boundary loops of a mesh.

    Parameters
    ----------
    vertices : (n, 3) array
    faces : (m, 3) array of int

    Returns
    -------
    dict
        One list a column, one entry a boundary loop, in the order of `boundary_loops`: "id",
        "boundary_edges", "perimeter", "diameter", "area", "planarity", "centre" (x, y and z of the
        middle of the rim), "normal" (unit vector of a flat fill, which looks out of the surface),
        "component", "vertex" (the first of the rim), "is_rim", "is_pinched", "shape", "fillable",
        "reason". See `BoundaryLoop` for their meaning and units.

    Raises
    ------
    InvalidMeshError
        If the arrays are no mesh.

    See Also
    --------
    inpaint : Fills them.

    Examples
    --------
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    >>> ms.meshing_remove_selected_faces()
    >>> mesh = ms.current_mesh()
    >>> vertices, faces = mesh.vertex_matrix(), mesh.face_matrix()
    >>> table = meshlab_lowrank.measure_holes(vertices, faces)
    >>> table["boundary_edges"], table["is_rim"], table["fillable"]
    ([20], [False], [True])
    >>> [round(value, 2) + 0.0 for value in table["normal"][0]]
    [0.0, 0.0, 1.0]
    """
    points, triangles = check_arrays(vertices, faces)
    return hole_table(points, triangles, boundary_loops(points, triangles))


def hole_table(
    vertices: FloatArray, faces: IntArray, loops: Sequence[BoundaryLoop]
) -> dict[str, list[Any]]:
    """Give what `measure_holes` gives, of loops that are known."""
    return {
        "id": [loop.id for loop in loops],
        "boundary_edges": [len(loop.vertices) for loop in loops],
        "perimeter": [loop.perimeter for loop in loops],
        "diameter": [loop.diameter for loop in loops],
        "area": [loop.area for loop in loops],
        "planarity": [loop.planarity for loop in loops],
        "centre": [rim_centre(vertices[loop.vertices]).tolist() for loop in loops],
        "normal": [rim_normal(vertices, faces, loop).tolist() for loop in loops],
        "component": [loop.component for loop in loops],
        "vertex": [int(loop.vertices[0]) for loop in loops],
        "is_rim": [loop.is_rim for loop in loops],
        "is_pinched": [loop.pinched for loop in loops],
        "shape": [loop.shape for loop in loops],
        "fillable": [not loop.reason for loop in loops],
        "reason": [loop.reason for loop in loops],
    }


def rim_normal(vertices: FloatArray, faces: IntArray, loop: BoundaryLoop) -> FloatArray:
    """Give the direction in which a hole looks.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    loop : BoundaryLoop

    Returns
    -------
    (3,) float64
        Unit normal of a flat fill, or where the rim encloses no area to speak of, the mean normal
        of the faces at it; zero where these have none.
    """
    normal = area_vector(vertices[loop.vertices])
    if np.linalg.norm(normal) <= _FLAT * loop.perimeter**2:
        normal = face_vectors(vertices, faces[np.unique(loop.faces)]).sum(axis=0)
    return normalized(normal) + 0.0
