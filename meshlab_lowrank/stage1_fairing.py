"""Stage 1, second half: give the fill the shape that continues its surroundings smoothly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    cotangent_laplacian,
    vertex_areas,
)
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.mesh.topology import boundary_vertices, vertex_adjacency, vertex_rings
from meshlab_lowrank.stage0_region import Region

_PASSES = 2  # the operators are those of the last pass's shape
_BAND = 5  # rings of known vertices that are predicted to choose between the two energies
_GAIN = 0.6  # the three-harmonic surface is taken if it predicts them that much better
_LEAST_BAND = 20


def fair_region(region: Region) -> Region:
    """Move the new vertices onto a surface that continues the known one smoothly.

    Bi-harmonic: least integral of the squared Laplacian, with the known rim and its tangents
    held. On smooth surroundings the three-harmonic surface (least squared gradient of the
    Laplacian, curvature held too) is several times nearer to the truth, but it amplifies
    roughness. Both predict the five rings of known vertices around the hole from what lies
    beyond, and the three-harmonic one is taken if its error there is less than 0.6 of the other's.

    Parameters
    ----------
    region : Region
        With a closed loop.

    Returns
    -------
    Region
        Known vertices are where they were.
    """
    unknown = np.flatnonzero(~region.known_vertices)
    if len(unknown) == 0:
        return region
    n = len(region.vertices)
    rings = vertex_rings(vertex_adjacency(region.faces, n), unknown, _BAND + 4)
    kept = region.faces[np.all(rings[region.faces] >= 0, axis=1)]
    used, faces = np.unique(kept, return_inverse=True)
    faces = faces.reshape(-1, 3)
    free = ~region.known_vertices[used]
    positions = region.vertices[used]
    result = positions
    for _ in range(_PASSES):
        result = harmonic_surface(result, faces, free, order=2)
    band = (rings[used] >= 1) & (rings[used] <= _BAND)
    if _predicts_better(result, faces, free, band):
        for _ in range(_PASSES):
            result = harmonic_surface(result, faces, free, order=3)
    vertices = region.vertices.copy()
    vertices[used[free]] = result[free]
    return replace(region, vertices=vertices)


def harmonic_surface(
    vertices: FloatArray, faces: IntArray, free: BoolArray, *, order: int
) -> FloatArray:
    """Move the free vertices to the least of a bi- or three-harmonic energy.

    The energy is left free at the border of the mesh, so a few rings of fixed vertices around
    the free ones give their tangents (order 2) and curvature (order 3) to the result.

    Parameters
    ----------
    vertices : (n, 3) float64
        The operators are taken from this shape.
    faces : (m, 3) int64
    free : (n,) bool
        None of them on the border of the mesh.
    order : {2, 3}
        2: integral of the squared Laplacian; 3: of the squared gradient of the Laplacian.

    Returns
    -------
    (n, 3) float64
    """
    border = boundary_vertices(faces, len(vertices))
    areas = np.maximum(vertex_areas(vertices, faces), np.finfo(np.float64).tiny)
    inner = sparse.diags_array(np.where(border, 0.0, 1.0 / areas))
    second = inner @ cotangent_laplacian(vertices, faces)  # (n, n), zero rows at the border
    weight = sparse.csr_array(sparse.diags_array(areas))
    if order == 3:
        weight = cotangent_laplacian(vertices, faces[~border[faces].any(axis=1)])
    energy = sparse.csr_array(second.T @ weight @ second)[np.flatnonzero(free)]
    right = -(energy[:, np.flatnonzero(~free)] @ vertices[~free])
    result = vertices.copy()
    result[free] = factorized(energy[:, np.flatnonzero(free)])(right)
    return result


def _predicts_better(
    vertices: FloatArray, faces: IntArray, free: BoolArray, band: BoolArray
) -> bool:
    """Whether the three-harmonic surface predicts the band of known vertices much better."""
    n = len(vertices)
    border = np.flatnonzero(boundary_vertices(faces, n))
    band = band & (vertex_rings(vertex_adjacency(faces, n), border, 2) < 0)
    if np.count_nonzero(band) < _LEAST_BAND:
        return False
    errors = []
    for order in (2, 3):
        guess = harmonic_surface(vertices, faces, free | band, order=order)
        errors.append(np.linalg.norm((guess - vertices)[band]))
    return bool(errors[1] < _GAIN * errors[0])
