"""Stage 1, drape: splines through the surroundings of a hole, weighed by how they foretell them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.fairing import fair_surface
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, vertex_normals
from meshlab_lowrank.stages.stage1c_level_even import even_surface
from meshlab_lowrank.stages.stage1e_base_low_pass import smooth_base

_EDGES = 3.2  # a repeat, of the coarse surface on which splines are weighed
_DEEP = 4.0  # edges that a hole is deep there, at least
_BAND = 0.3  # width of the known surface that is foretold, in depths of the hole
_NARROWEST = 0.35  # the same in wavelengths, at least
_LEAST_BAND = 20  # vertices
_SEEN = 1.2  # cut-off of what is foretold, in wavelengths
_LAID = 4  # times that a spline is laid, each in the metric of the last
_STILL = 0.01  # cut-offs by which what is not known moves, so that no other metric is needed
_LEAST_WEIGHT = 0.1  # of the best spline's, of those that are worth their time
_GRID = 2.0**-8  # edges of the coarse surface, far below what it holds


@dataclass(frozen=True)
class Coarse:
    """A coarse copy of a hole's surface, in the same units.

    Attributes
    ----------
    positions : (n, 3) float64
    faces : (m, 3) int64
    known : (n,) bool
    """

    positions: FloatArray
    faces: IntArray
    known: BoolArray


def laid_out(
    positions: FloatArray, faces: IntArray, known: BoolArray, *, cutoff: float, times: int = _LAID
) -> FloatArray:
    """Fit a spline to the known part of a surface, with the rest laid onto it along its normals.

    Taken as it is, the spline would drag what is not known along the surface, further each time.

    Parameters
    ----------
    positions : (n, 3) float64
    faces : (m, 3) int64
    known : (n,) bool
    cutoff : float
        See `smooth_base`.
    times : int
        Most fits, each with the metric that the last gave to what is not known.

    Returns
    -------
    (n, 3) float64
        The spline on what is known, and what is not known laid onto it.
    """
    surface = spline = positions
    for _ in range(times):
        spline = smooth_base(surface, faces, known, cutoff=cutoff)
        normals = vertex_normals(surface, faces)
        raised = np.einsum("ij,ij->i", spline - surface, normals)[:, None] * normals
        surface = np.where(known[:, None], surface, surface + raised)
        if np.linalg.norm(raised[~known], axis=1).max(initial=0.0) < _STILL * cutoff:
            break
    return np.where(known[:, None], spline, surface)


def foretelling(
    coarse: Coarse,
    cutoffs: Sequence[float],
    wavelength: float,
    depth: float,
    *,
    sharpness: float = 2.0,
) -> FloatArray | None:
    """Weigh splines by known surface around the hole, foretold from what lies beyond.

    Parameters
    ----------
    coarse : Coarse
    cutoffs : sequence of float
        In wavelengths.
    wavelength, depth : float
        Of the detail and of the hole, in the units of the surface.
    sharpness : float
        Power of the inverse variance of what is foretold by which they are weighed; infinite for
        the best alone.

    Returns
    -------
    (c,) float64 or None
        Parts of a mean, sum 1; None where a surface that is faired to its rim foretells better
        than all of them, or there is too little to tell.
    """
    positions, faces, known = coarse.positions, coarse.faces, coarse.known
    away = np.zeros(len(positions))
    away[known] = cKDTree(positions[~known]).query(positions[known])[0]
    width = max(_BAND * depth, _NARROWEST * wavelength)
    band = known & (away < width)
    beyond = known & ~band
    if min(band.sum(), beyond.sum()) < _LEAST_BAND:
        return None
    seen = smooth_base(positions, faces, known, cutoff=_SEEN * wavelength)
    normals = vertex_normals(seen, faces)[band]

    def miss(told: FloatArray) -> float:
        return float(np.mean(np.einsum("ij,ij->i", (told - seen)[band], normals) ** 2))

    errors = np.asarray(
        [miss(laid_out(positions, faces, beyond, cutoff=each * wavelength)) for each in cutoffs]
    )
    with suppress(StageError):  # then there is no such surface
        if miss(fair_surface(positions, faces, ~beyond)) < errors.min():
            return None
    weights = (errors.min() / np.maximum(errors, np.finfo(float).tiny)) ** sharpness
    weights[weights < _LEAST_WEIGHT] = 0.0
    return np.asarray(weights / weights.sum())


def coarse_surface(hole: Hole, depth: float) -> Coarse | None:
    """Make the surface on which the stiffness is chosen; None where there is no such surface."""
    spacing = max(min(hole.wavelength / _EDGES, depth / _DEEP), 1.0)
    spacing = round(spacing / _GRID) * _GRID
    # what the remesher makes of a rounding error would reach the fill
    snapped = np.rint(hole.positions / (spacing * _GRID)) * _GRID
    try:
        positions, faces = even_surface(snapped, hole.faces)
    except StageError:
        return None
    positions = positions * spacing
    below = TriangleIndex(hole.positions, hole.faces).closest(positions)
    known = hole.known_faces[below.faces]
    if known.all() or not known.any():
        return None
    return Coarse(positions, faces, known)
