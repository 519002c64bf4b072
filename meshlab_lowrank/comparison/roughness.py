"""Detail energy: how rough a part of a surface is, whatever its triangles look like."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.comparison.sampling import interpolate_normals, sample_surface
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    normalized,
    vertex_normals,
)

SMOOTHING = 4.0  # standard deviation of the smoothing, in mean edge lengths
_CUT_OFF = 2.5  # standard deviations after which the Gaussian is dropped
_AROUND = 2.0  # width of the surroundings, in standard deviations
_SAMPLES_PER_EDGE = 2.5
_MOST_SAMPLES = 40_000


@dataclass(frozen=True)
class DetailEnergy:
    """Mean squared height of the detail, in squared mesh units.

    Attributes
    ----------
    inside : float
        In the part itself; NaN if it has no area.
    around : float
        In the surroundings of the part, 8 mean edge lengths wide; NaN if there are none.
    """

    inside: float
    around: float


def detail_energy(
    vertices: FloatArray, faces: IntArray, part: BoolArray, edge_length: float
) -> DetailEnergy:
    r"""Measure the detail of a part of a surface.

    The surface is sampled evenly. With G a Gaussian average over neighbouring samples (standard
    deviation four edge lengths, samples facing away left out), the height of the surface over
    its own smoothed version is h = (x - G x) . n, n the smoothed normal, and the detail is
    h - G h: the second difference takes out the height that constant curvature gives. Detail of
    wavelength 7 edge lengths passes whole, of 16 by half, of 40 by a thirtieth.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        The whole surface, with the surroundings of the part.
    part : (m,) bool
    edge_length : float
        Mean edge length of the surroundings; the same for every fill that is compared.

    Returns
    -------
    DetailEnergy
    """
    nothing = DetailEnergy(float("nan"), float("nan"))
    sigma = SMOOTHING * edge_length
    core = sample_surface(vertices, faces[part], edge_length, most=_MOST_SAMPLES)
    if len(core.points) == 0:
        return nothing
    ring = _AROUND * sigma
    near = part | _near(vertices, faces, core.points, ring + 2.0 * _CUT_OFF * sigma)
    closer = part | _near(vertices, faces, core.points, ring)
    normals = vertex_normals(vertices, faces)
    coarse = _sample(vertices, faces, normals, near, edge_length)
    fine = _sample(vertices, faces, normals, closer, edge_length / _SAMPLES_PER_EDGE)
    at_coarse, at_fine = (_gaussian_average(at, coarse, sigma) for at in (coarse, fine))
    squared = (_height(fine, coarse, at_fine) - at_fine @ _height(coarse, coarse, at_coarse)) ** 2
    inside = part[fine.faces]
    distance, _ = cKDTree(core.points).query(fine.points, workers=-1)
    around = ~inside & (distance < ring)
    return DetailEnergy(_mean(squared[inside]), _mean(squared[around]))


def _near(vertices: FloatArray, faces: IntArray, points: FloatArray, distance: float) -> BoolArray:
    """Mark faces with a corner within a distance of some points."""
    gap, _ = cKDTree(points).query(vertices, distance_upper_bound=distance, workers=-1)
    return np.asarray(np.isfinite(gap)[faces].any(axis=1))


@dataclass(frozen=True)
class _Oriented:
    """Samples with normals; `faces` are face numbers of the whole mesh."""

    points: FloatArray
    normals: FloatArray
    faces: IntArray


def _sample(
    vertices: FloatArray, faces: IntArray, normals: FloatArray, where: BoolArray, spacing: float
) -> _Oriented:
    samples = sample_surface(vertices, faces[where], spacing, most=_MOST_SAMPLES)
    owners = np.flatnonzero(where)[samples.faces]
    directions = interpolate_normals(normals, faces[owners], samples.barycentric)
    return _Oriented(samples.points, directions, owners)


def _height(at: _Oriented, source: _Oriented, average: sparse.csr_array) -> FloatArray:
    """Height of samples over the smoothed surface, along its smoothed normal."""
    direction = normalized(average @ source.normals)
    return np.asarray(np.einsum("pd,pd->p", at.points - average @ source.points, direction))


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _gaussian_average(at: _Oriented, source: _Oriented, sigma: float) -> sparse.csr_array:
    """Row-stochastic Gaussian weights of the source samples that face the same way."""
    weights = cKDTree(at.points).sparse_distance_matrix(
        cKDTree(source.points), _CUT_OFF * sigma, output_type="ndarray"
    )
    row, column, distance = weights["i"], weights["j"], weights["v"]
    facing = np.einsum("pd,pd->p", at.normals[row], source.normals[column]).clip(1e-6, 1.0)
    values = facing * np.exp(-0.5 * (distance / sigma) ** 2)
    shape = len(at.points), len(source.points)
    matrix = sparse.coo_array((values, (row, column)), shape=shape).tocsr()
    return sparse.csr_array(sparse.diags_array(1.0 / matrix.sum(axis=1)) @ matrix)
