"""Stage 1, second half: give the fill the shape that continues its surroundings smoothly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    cotangent_laplacian,
    vertex_areas,
)
from meshlab_lowrank.mesh.topology import vertex_adjacency, vertex_rings
from meshlab_lowrank.stage0_region import Region

_RINGS = 3
_PASSES = 3


def fair_region(region: Region) -> Region:
    """Move the new vertices onto the surface of least curvature variation.

    Parameters
    ----------
    region : Region

    Returns
    -------
    Region
        Known vertices are where they were.
    """
    unknown = np.flatnonzero(~region.known_vertices)
    if len(unknown) == 0:
        return region
    n = len(region.vertices)
    ring = vertex_rings(vertex_adjacency(region.faces, n), unknown, _RINGS)
    faces = region.faces[np.all(ring[region.faces] >= 0, axis=1)]
    used, local = np.unique(faces, return_inverse=True)
    positions = region.vertices[used]
    free = ~region.known_vertices[used]
    for _ in range(_PASSES):
        positions = _faired(positions, local.reshape(-1, 3), free)
    vertices = region.vertices.copy()
    vertices[unknown] = positions[free]
    return replace(region, vertices=vertices)


def _faired(positions: FloatArray, faces: IntArray, free: BoolArray) -> FloatArray:
    """Bi-harmonic positions of the free vertices, the others held."""
    laplacian = cotangent_laplacian(positions, faces)
    areas = np.maximum(vertex_areas(positions, faces), 1e-12)
    energy = laplacian @ sparse.diags_array(1.0 / areas) @ laplacian
    energy = sparse.csr_array(energy)
    rows = energy[np.flatnonzero(free)]
    system = sparse.csc_array(rows[:, np.flatnonzero(free)])
    right = -(rows[:, np.flatnonzero(~free)] @ positions[~free])
    factor = splu(system, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    result = positions.copy()
    result[free] = factor.solve(right)
    return result
