"""Pernot, Moraru and Véron: the fill whose curvature varies least.

Written from the published idea, not the authors' code. Chosen where the idea leaves it open:

- The hole is closed by MeshLab, with triangles of the local edge length; only places are sought.
- The pull of its neighbours on a vertex stands for the curvature there: the cotangent Laplacian
  over the area, a vector along the normal with a length of twice the mean curvature.
- The sum of its squared changes along edges is least, weighted by cotangents. What the pull
  changes by because the normal turns doesn't count, so that spheres vary as little as planes.
- Weights, areas and normals are those of the last shape; four times over.

References
----------
Pernot, Moraru and Véron, Filling holes in meshes using a mechanical model to simulate the
curvature variation minimization, 2006.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.fairing import fair_surface
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    cotangent_laplacian,
    vertex_normals,
)
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.mesh.topology import boundary_vertices
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1a_close_meshlab import close_region

_ROUNDS = 4
_LEAST_AREA = 1e-3  # of the mean, of a vertex


def fill(region: Region) -> Region:
    """Fill the loop of a region.

    Raises
    ------
    StageError
        If MeshLab can't close the loop, or the surroundings are too few to determine the fill.
    """
    whole = close_region(region)
    unknown = ~whole.known_vertices
    start = fair_surface(whole.vertices, whole.faces, unknown, order=2)
    return replace(whole, vertices=least_variation(start, whole.faces, unknown))


def least_variation(vertices: FloatArray, faces: IntArray, unknown: BoolArray) -> FloatArray:
    """Move unknown vertices to where the curvature varies least.

    Parameters
    ----------
    vertices : (n, 3) float64
        Unknown ones roughly in place; at least three rings of known ones around them.
    faces : (m, 3) int64
    unknown : (n,) bool

    Returns
    -------
    (n, 3) float64
        Known vertices are where they were, bit for bit.

    Raises
    ------
    StageError
        If the known vertices don't determine the others.
    """
    result = vertices.copy()
    free = np.flatnonzero(unknown)
    if len(free) == 0:
        return result
    inner = ~boundary_vertices(faces, len(vertices))
    for _ in range(_ROUNDS):
        laplacian = cotangent_laplacian(result, faces)
        upper = sparse.triu(laplacian, k=1).tocoo()
        i, j, weight = upper.row, upper.col, -upper.data
        areas = _areas(result, i, j, weight)
        pull = sparse.csr_array(sparse.diags_array(1.0 / areas) @ laplacian)
        kept = inner[i] & inner[j]
        i, j, root = i[kept], j[kept], np.sqrt(np.maximum(weight[kept], 0.0))
        change = sparse.csr_array(sparse.diags_array(root) @ (pull[i] - pull[j]))
        turning = root[:, None] * _turning(pull @ result, vertex_normals(result, faces), i, j)
        system = sparse.csr_array(change[:, free].T @ change[:, free])
        right = change[:, free].T @ (turning - change[:, ~unknown] @ result[~unknown])
        result[free] = factorized(system)(np.asarray(right))
    return result


def _areas(vertices: FloatArray, i: IntArray, j: IntArray, weight: FloatArray) -> FloatArray:
    """Areas (n,) of the Voronoi cells, given the weights of the edges from i to j.

    With these the pull along the radius is the same everywhere on a sphere, whatever its triangles.
    """
    share = 0.25 * weight * ((vertices[i] - vertices[j]) ** 2).sum(axis=1)
    n = len(vertices)
    areas = np.bincount(i, share, minlength=n) + np.bincount(j, share, minlength=n)
    return np.asarray(np.maximum(areas, _LEAST_AREA * areas.mean()))


def _turning(pulls: FloatArray, normals: FloatArray, i: IntArray, j: IntArray) -> FloatArray:
    """Change of a pull from one end of edges to the other that says nothing of the curvature.

    What its part along the normal does as the normal turns, and all of its part along the surface,
    which is due to the shapes of the triangles.
    """
    upright = np.einsum("ij,ij->i", pulls, normals)[:, None] * normals
    along = pulls - upright
    mean = 0.5 * (pulls[i] * normals[i] + pulls[j] * normals[j]).sum(axis=1, keepdims=True)
    return np.asarray(mean * (normals[i] - normals[j]) + along[i] - along[j])
