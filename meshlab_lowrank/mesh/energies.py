"""Bi- and three-harmonic energies of functions on a mesh."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, cotangent_laplacian, vertex_areas
from meshlab_lowrank.mesh.topology import boundary_vertices


def harmonic_energy(
    vertices: FloatArray, faces: IntArray, order: int, *, least_area: float = 1e-6
) -> sparse.csr_array:
    """Quadratic form of a bi- or three-harmonic energy, free at the border of the mesh.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    order : {2, 3}
        2: integral of the squared Laplacian; 3: of the squared gradient of the Laplacian.
    least_area : float
        Least area of a vertex, in mean ones, so that slivers do not rule the energy.

    Returns
    -------
    (n, n) csr_array of float64
        Zero on constants; near zero on linear functions, also at the border of the mesh, where
        the cotangent Laplacian is left out.
    """
    border = boundary_vertices(faces, len(vertices))
    areas = vertex_areas(vertices, faces)
    areas = np.maximum(areas, least_area * areas.mean())
    inverse = np.divide(1.0, areas, out=np.zeros_like(areas), where=~border & (areas > 0.0))
    inner = sparse.diags_array(inverse)
    curvature = inner @ cotangent_laplacian(vertices, faces)  # (n, n), zero rows at the border
    if order == 2:
        return sparse.csr_array((curvature.T @ sparse.diags_array(areas)) @ curvature)
    stiffness = cotangent_laplacian(vertices, faces[~border[faces].any(axis=1)])
    return sparse.csr_array(curvature.T @ (stiffness @ curvature))
