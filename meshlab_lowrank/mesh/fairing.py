"""Smooth surfaces that continue a known one: bi- or three-harmonic, whichever predicts better."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.energies import harmonic_energy
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.mesh.topology import boundary_vertices, vertex_adjacency, vertex_rings

_PASSES = 3  # the operators and the normals are those of the last shape
_REGULAR = 1e-12  # holds vertices that have no normal
_BAND = 5  # rings of known vertices that are predicted to choose between the two energies
_GAIN = 0.6  # the three-harmonic surface is taken if it predicts them that much better
_LEAST_BAND = 20


def fair_surface(
    vertices: FloatArray, faces: IntArray, unknown: BoolArray, *, order: int | None = None
) -> FloatArray:
    """Move unknown vertices onto a surface that continues the known one smoothly.

    Order 2 is the bi-harmonic surface: least integral of the squared Laplacian, with the known
    rim and its tangents held. On smooth surroundings the three-harmonic surface (order 3: least
    squared gradient of the Laplacian, curvature held too) is several times nearer to the truth,
    but it amplifies roughness. To choose, both predict the five rings of known vertices around
    the hole from what lies beyond them, and the three-harmonic one is taken if its error there is
    less than 0.6 of the other's.

    For the bi-harmonic surface the vertices move along their normals, which keeps the shape of
    the triangles: with all coordinates free, the tangents of a rough rim drag them along the
    surface, further each time. The three-harmonic one, for smooth rims, solves for coordinates.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    unknown : (n,) bool
    order : {2, 3}, optional
        None: chosen by prediction.

    Returns
    -------
    (n, 3) float64
        Known vertices are where they were, bit for bit.
    """
    moved = np.flatnonzero(unknown)
    if len(moved) == 0:
        return vertices
    n = len(vertices)
    rings = vertex_rings(vertex_adjacency(faces, n), moved, _BAND + 4)
    kept = faces[np.all(rings[faces] >= 0, axis=1)]
    used, near = np.unique(kept, return_inverse=True)
    near = near.reshape(-1, 3)
    free = unknown[used]
    positions = vertices[used]
    for _ in range(_PASSES):
        positions = _moved_along_normals(positions, near, free)
    if order is None:
        band = (rings[used] >= 1) & (rings[used] <= _BAND)
        order = 3 if _three_predicts_better(positions, near, free, band) else 2
    if order == 3:
        positions = minimise_with_fixed(harmonic_energy(positions, near, 3), ~free, positions)
    result = vertices.copy()
    result[used[free]] = positions[free]
    return result


def _moved_along_normals(vertices: FloatArray, faces: IntArray, free: BoolArray) -> FloatArray:
    """Minimise the bi-harmonic energy of this shape over moves along its normals."""
    moved = np.flatnonzero(free)
    energy = harmonic_energy(vertices, faces, 2)[moved]  # (f, n)
    among = sparse.csr_array(energy[:, moved])
    normals = vertex_normals(vertices, faces)[moved]
    system = sparse.csr_array(_REGULAR * sparse.diags_array(among.diagonal()))
    for axis in normals.T:
        system = system + sparse.diags_array(axis) @ among @ sparse.diags_array(axis)
    distance = factorized(system)(-np.sum(normals * (energy @ vertices), axis=1))
    result = vertices.copy()
    result[moved] += distance[:, None] * normals
    return result


def _three_predicts_better(
    vertices: FloatArray, faces: IntArray, free: BoolArray, band: BoolArray
) -> bool:
    """Whether the three-harmonic surface predicts the band of known vertices much better."""
    n = len(vertices)
    border = np.flatnonzero(boundary_vertices(faces, n))
    band = band & (vertex_rings(vertex_adjacency(faces, n), border, 2) < 0)
    if np.count_nonzero(band) < _LEAST_BAND:
        return False
    guesses = [
        minimise_with_fixed(harmonic_energy(vertices, faces, order), ~(free | band), vertices)
        for order in (2, 3)
    ]
    two, three = (np.linalg.norm((guess - vertices)[band]) for guess in guesses)
    return bool(three < _GAIN * two)
