"""Smooth surfaces that continue a known one: bi- or three-harmonic, whichever predicts better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.energies import harmonic_energy
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    cotangent_laplacian,
    vertex_normals,
)
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.mesh.topology import (
    boundary_vertices,
    compacted,
    faces_at,
    vertex_adjacency,
    vertex_rings,
)

_PASSES = 3  # the operators and the normals are those of the last shape
_REGULAR = 1e-12  # holds vertices that have no normal
_BAND = 5  # rings of known vertices that are predicted to choose between the two energies
_GAIN = 0.6  # the three-harmonic surface is taken if it predicts them that much better
_LEAST_BAND = 20
_TOUCHED_RINGS = 3  # whose vertices enter the bi-harmonic energy, with all their faces
NEEDED_RINGS = _BAND + 4  # around a hole; what lies beyond changes nothing


@dataclass(frozen=True)
class Faired:
    """Several surfaces that were faired in one go.

    Attributes
    ----------
    positions : (n, 3) float64
        Known vertices are where they were, bit for bit.
    misfit : (g,) float64
        For each group how far, along the normals, the better energy misses the known vertices
        around the hole that it predicts from what lies beyond them: root mean square, in the
        units of the mesh. NaN where there are too few, or nothing was predicted.
    cubic : (g,) bool
        Whether the three-harmonic energy was taken.
    """

    positions: FloatArray
    misfit: FloatArray
    cubic: BoolArray


def membrane(
    vertices: FloatArray, faces: IntArray, unknown: BoolArray, *, passes: int = 5
) -> FloatArray:
    """Move unknown vertices onto the surface of least area that their neighbours span.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    unknown : (n,) bool
    passes : int
        Harmonic solves, each with the weights of the last shape.

    Returns
    -------
    (n, 3) float64
        Known vertices are where they were, bit for bit; flat within a planar rim.

    References
    ----------
    Pinkall and Polthier, Computing discrete minimal surfaces and their conjugates, 1993.
    """
    rows = np.flatnonzero(faces_at(unknown, faces))
    used, near = compacted(faces[rows], len(vertices))
    result, fixed = vertices.copy(), ~unknown[used]
    for _ in range(passes if len(rows) else 0):
        laplacian = cotangent_laplacian(result[used], near)
        result[used[~fixed]] = minimise_with_fixed(laplacian, fixed, result[used])[~fixed]
    return result


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

    See Also
    --------
    fair_surfaces : Several surfaces in one go.
    """
    groups = np.zeros(len(vertices), dtype=np.int64)
    return fair_surfaces(vertices, faces, unknown, groups, order=order).positions


def fair_surfaces(
    vertices: FloatArray,
    faces: IntArray,
    unknown: BoolArray,
    groups: IntArray,
    *,
    order: int | None = None,
) -> Faired:
    """Fair surfaces that have nothing to do with one another by one factorisation a step.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        No face has corners of two groups.
    unknown : (n,) bool
    groups : (n,) int64
        Number of the surface of each vertex, from 0; each chooses its energy for itself.
    order : {2, 3}, optional
        See `fair_surface`.

    Returns
    -------
    Faired
    """
    misfit = np.full(int(groups.max(initial=-1)) + 1, np.nan)
    cubic = np.full(len(misfit), order == 3)
    moved = np.flatnonzero(unknown)
    if len(moved) == 0:
        return Faired(vertices, misfit, cubic)
    n = len(vertices)
    needed = _TOUCHED_RINGS if order == 2 else NEEDED_RINGS
    rings = vertex_rings(vertex_adjacency(faces, n), moved, needed)
    kept = faces[np.all(rings[faces] >= 0, axis=1)]
    used, near = np.unique(kept, return_inverse=True)
    near = near.reshape(-1, 3)
    free, of, ring = unknown[used], groups[used], rings[used]
    positions = vertices[used]
    touched = near[np.all(ring[near] <= _TOUCHED_RINGS, axis=1)]
    for _ in range(_PASSES):
        positions = _moved_along_normals(positions, touched, free)
    if order is None:
        band = (ring >= 1) & (ring <= _BAND)
        cubic, misfit = _predicted(positions, near, free, band=band, groups=of, count=len(misfit))
    if cubic.any():
        chosen = cubic[of]
        part = near[chosen[near[:, 0]]]
        energy = harmonic_energy(positions, part, 3)
        positions = minimise_with_fixed(energy, ~(free & chosen), positions)
    result = vertices.copy()
    result[used[free]] = positions[free]
    return Faired(result, misfit, cubic)


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


def _predicted(
    vertices: FloatArray,
    faces: IntArray,
    free: BoolArray,
    *,
    band: BoolArray,
    groups: IntArray,
    count: int,
) -> tuple[BoolArray, FloatArray]:
    """Whether the three-harmonic surface predicts the band of each group much better, and how well.

    Gives a flag and the root mean square error along the normals for each group.
    """
    n = len(vertices)
    border = np.flatnonzero(boundary_vertices(faces, n))
    band = band & (vertex_rings(vertex_adjacency(faces, n), border, 2) < 0)
    sizes = np.bincount(groups[band], minlength=count)
    band &= (sizes >= _LEAST_BAND)[groups]
    cubic, misfit = np.zeros(count, dtype=np.bool_), np.full(count, np.nan)
    told = np.flatnonzero(sizes >= _LEAST_BAND)
    if len(told) == 0:
        return cubic, misfit
    normals = vertex_normals(vertices, faces)
    errors, heights = [], []
    for order in (2, 3):
        energy = harmonic_energy(vertices, faces, order)
        miss = minimise_with_fixed(energy, ~(free | band), vertices)[band] - vertices[band]
        height = np.einsum("ij,ij->i", miss, normals[band])
        errors.append(np.bincount(groups[band], (miss**2).sum(axis=1), minlength=count)[told])
        heights.append(np.bincount(groups[band], height**2, minlength=count)[told])
    cubic[told] = errors[1] < _GAIN**2 * errors[0]
    misfit[told] = np.sqrt(np.minimum(*heights) / sizes[told])
    return cubic, misfit
