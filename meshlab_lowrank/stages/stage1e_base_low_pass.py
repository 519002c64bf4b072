"""Stage 1, base: the low-pass surface that carries the frames of the patches."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.energies import harmonic_energy
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    cotangent_laplacian,
    vertex_areas,
    vertex_normals,
)
from meshlab_lowrank.mesh.interpolation import NEIGHBOURS, interpolation
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.mesh.sampling import spread_points
from meshlab_lowrank.mesh.topology import edges_of
from meshlab_lowrank.stages.stage import Stage

_CUTOFF_STRENGTH = 10.0  # 1 / (1 + 10) of the amplitude is left at the cut-off
_COARSE_EDGES = 7.5  # coarse vertices per cut-off wavelength
_LEAST_AREA = 1e-3  # of a vertex, in mean ones


@dataclass(frozen=True)
class LowPassBase(Stage):
    """Smoothing spline through the known surface, then through the completed one.

    Parameters
    ----------
    cutoff : float
        Wavelength below which detail is removed, in wavelengths of the detail.
    order : {3, 2}
        Three- or bi-harmonic.
    """

    cutoff: float = 1.8
    order: int = 3

    def __call__(self, hole: Hole, *, first: bool) -> Hole:
        """Fit the base; see `Base`."""
        pull = np.ones(len(hole.positions))
        if first and not hole.draped:
            pull = hole.weights > 0
        base = smooth_base(
            hole.positions,
            hole.faces,
            pull,
            cutoff=self.cutoff * hole.wavelength,
            order=self.order,
        )
        return replace(hole, base=base, base_normals=vertex_normals(base, hole.faces))


def smooth_base(
    vertices: FloatArray,
    faces: IntArray,
    pull: FloatArray | BoolArray,
    *,
    cutoff: float,
    order: int = 3,
) -> FloatArray:
    """Low-pass a surface by a harmonic smoothing spline.

    Solves ``(P'A K P + t Q) b = P'A K X``, B = P b, with the vertex areas A, the pull K (1 on
    known vertices, 0 in the hole), the harmonic energy Q of a coarse mesh, and the
    interpolation P from its vertices, which reproduces quadratic surfaces. Natural boundary
    conditions hold at the border of the mesh. Where K is 0 the result continues the
    surroundings smoothly.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    pull : (n,) float64 or bool
        K, weight of each vertex's own position.
    cutoff : float
        Wavelength, in the units of the mesh, below which detail is removed.
    order : {3, 2}
        Three-harmonic, or bi-harmonic, which continues the tangent only.

    Returns
    -------
    (n, 3) float64
    """
    smoothed = _coarsely_smoothed(vertices, faces, 0.5 * (cutoff / 6.0) ** 2)
    seeds = spread_points(smoothed, cutoff / _COARSE_EDGES)
    if len(seeds) < 2 * NEIGHBOURS:  # so small that there is nothing to gain
        seeds = np.arange(len(vertices))
        if len(seeds) < NEIGHBOURS:
            return smoothed
    coarse_faces = _coarse_faces(smoothed, faces, seeds)
    normals = vertex_normals(smoothed, faces)
    onto = interpolation(smoothed, normals, smoothed[seeds], normals[seeds])
    energy = harmonic_energy(smoothed[seeds], coarse_faces, order, least_area=_LEAST_AREA)
    strength = _CUTOFF_STRENGTH / (2.0 * np.pi / cutoff) ** (2 * order)
    mass = vertex_areas(vertices, faces) * np.asarray(pull, dtype=np.float64)
    weighted = onto.T @ sparse.diags_array(mass)
    system = weighted @ onto + strength * energy
    system += 1e-9 * mass.mean() * sparse.eye_array(len(seeds))
    return np.asarray(onto @ factorized(system)(weighted @ vertices))


def _coarsely_smoothed(vertices: FloatArray, faces: IntArray, time: float) -> FloatArray:
    """Smooth by ``3 D^2 - 2 D^3``, with D an implicit step of heat flow.

    D alone shrinks a body of strong curvature before it removes the detail on it.
    """
    areas = vertex_areas(vertices, faces)
    areas = np.maximum(areas, 1e-3 * areas.mean())
    system = sparse.diags_array(areas) + time * cotangent_laplacian(vertices, faces)
    solve = factorized(system)
    once = solve(areas[:, None] * vertices)
    twice = solve(areas[:, None] * once)
    return 3.0 * twice - 2.0 * solve(areas[:, None] * twice)


def _coarse_faces(points: FloatArray, faces: IntArray, seeds: IntArray) -> IntArray:
    """Dual of the geodesic Voronoi cells of the seeds, as triangles of seed numbers."""
    n = len(points)
    ends = edges_of(faces).vertices
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    graph = sparse.coo_array((lengths, (ends[:, 0], ends[:, 1])), shape=(n, n)).tocsr()
    _, _, source = csgraph.dijkstra(
        graph, directed=False, indices=seeds, min_only=True, return_predecessors=True
    )
    number = np.full(n + 1, -1)
    number[seeds] = np.arange(len(seeds))
    corners = number[np.where(source >= 0, source, n)][faces]
    first, second, third = corners.T
    proper = (first != second) & (second != third) & (third != first) & (corners.min(axis=1) >= 0)
    corners = corners[proper]
    _, unique = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    return np.asarray(corners[unique], dtype=np.int64)
