"""Stage 1, drape: the smoothing spline whose stiffness foretells the surroundings best."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.hole import Hole, depth_of
from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.fading import faded
from meshlab_lowrank.mesh.fairing import fair_surface
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    face_normals,
    vertex_normals,
)
from meshlab_lowrank.mesh.interpolation import interpolation
from meshlab_lowrank.mesh.topology import compacted, edges_of, faces_at, half_edge_pairs
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage1c_level_even import even_surface
from meshlab_lowrank.stages.stage1e_base_low_pass import smooth_base

_EDGES = 3.2  # a repeat, of the coarse surface on which the stiffness is chosen
_DEEP = 4.0  # edges that a hole is deep there, at least
_BAND = 0.3  # width of the known surface that is foretold, in depths of the hole
_NARROWEST = 0.35  # the same in wavelengths, at least
_LEAST_BAND = 20  # vertices
_SEEN = 1.2  # cut-off of what is foretold, in wavelengths
_LAID = 4  # splines, each in the metric of the last
_STILL = 0.01  # cut-offs by which what is not known moves, so that no other metric is needed
_JOIN = 0.25  # length over which the fill leaves the rim, in wavelengths
_RIM_RINGS = 2
_GRID = 2.0**-8  # edges of the coarse surface, far below what it holds
_FOLDED = -0.2  # cosine between the normals of two neighbouring faces


@dataclass(frozen=True)
class ForetoldDrape(Stage):
    """Lay the fill onto a three-harmonic smoothing spline through the known surface; see `Drape`.

    A fill that is faired to its rim takes the detail cut by the rim for the slope of the body, and
    the wider the hole, the further it swings off. The spline sees all the surroundings, but how
    stiff it may be depends on the body: a stiff one averages the detail better, a soft one follows
    strong curvature. So known surface around the hole is taken as missing too and foretold from
    what lies beyond, on a coarse surface, and the stiffness that foretells it best is taken; the
    faired fill stays where the same fairing foretells it better still.

    Parameters
    ----------
    cutoffs : tuple of float
        Wavelengths below which the splines remove detail, in wavelengths of the detail; empty: the
        fill is left.
    least_depth : float
        Of a hole, in wavelengths (shortened where patches are), from which on its fill is laid;
        others don't swing far.
    """

    cutoffs: tuple[float, ...] = (0.9, 1.2, 1.6, 2.1, 2.8)
    least_depth: float = 1.8

    def __call__(self, hole: Hole) -> Hole:
        """Lay the fill; see `Drape`."""
        known = ~hole.unknown
        depth = float(depth_of(hole).max())
        if not self.cutoffs or depth < self.least_depth * hole.patch_wavelength:
            return hole
        coarse = _coarse(hole, depth)
        if coarse is None:
            return hole
        cutoff = best_cutoff(coarse, self.cutoffs, hole.wavelength, depth)
        if cutoff is None:
            return hole
        laid = laid_out(
            coarse.positions,
            coarse.faces,
            coarse.known,
            cutoff=cutoff * hole.wavelength,
            times=_LAID,
        )
        onto = interpolation(
            hole.positions,
            vertex_normals(hole.positions, hole.faces),
            coarse.positions,
            vertex_normals(coarse.positions, coarse.faces),
        )
        spline, length = np.asarray(onto @ laid), _JOIN * hole.wavelength
        orders: tuple[Literal[2, 1], ...] = (2, 1)
        for order in orders:
            joined = joined_at_rim(
                hole.positions, spline, hole.faces, known, length=length, order=order
            )
            if not folds_more(joined, hole):
                return replace(hole, positions=joined, draped=True)
        return hole

    def for_trial(self) -> ForetoldDrape:
        """Leave the fills of fake holes, which are small."""
        return replace(self, cutoffs=())


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
    positions: FloatArray, faces: IntArray, known: BoolArray, *, cutoff: float, times: int
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


def joined_at_rim(
    positions: FloatArray,
    laid: FloatArray,
    faces: IntArray,
    known: BoolArray,
    *,
    length: float,
    order: Literal[2, 1] = 2,
) -> FloatArray:
    """Lead a spline to the known surface at the rim.

    What the known surface has beyond the spline dies away into the hole, with its tangents, or, of
    order 1, without; see `faded`.

    Parameters
    ----------
    positions, laid : (n, 3) float64
        The surface, and the spline.
    faces : (m, 3) int64
    known : (n,) bool
    length : float
    order : {2, 1}

    Returns
    -------
    (n, 3) float64
        Equal to the surface, bit for bit, where it is known.
    """
    near = ~known
    for _ in range(_RIM_RINGS):
        near[faces[faces_at(near, faces)]] = True
    used, own = compacted(faces[faces_at(near, faces)], len(positions))
    beyond = faded(
        laid[used], own, known[used], (positions - laid)[used], length=length, order=order
    )
    result = np.where(known[:, None], positions, laid)
    free = ~known[used]
    result[used[free]] += beyond[free]
    return result


def folds_more(positions: FloatArray, hole: Hole) -> bool:
    """Whether new positions (n, 3) fold a hole's fill at more edges than it was folded at."""
    own = hole.faces[faces_at(hole.unknown, hole.faces)]
    first, second = half_edge_pairs(edges_of(own)) // 3
    before, after = (
        np.count_nonzero(np.einsum("ij,ij->i", normals[first], normals[second]) < _FOLDED)
        for normals in (face_normals(points, own) for points in (hole.positions, positions))
    )
    return bool(after > before)


def best_cutoff(
    coarse: Coarse, cutoffs: tuple[float, ...], wavelength: float, depth: float
) -> float | None:
    """Choose the stiffness by known surface around the hole, foretold from what lies beyond.

    Parameters
    ----------
    coarse : Coarse
    cutoffs : tuple of float
        In wavelengths.
    wavelength, depth : float
        Of the detail and of the hole, in the units of the surface.

    Returns
    -------
    float or None
        One of the cut-offs; None where a surface that is faired to its rim foretells it better, or
        there is too little to tell.
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

    errors = [
        miss(laid_out(positions, faces, beyond, cutoff=cutoff * wavelength, times=_LAID))
        for cutoff in cutoffs
    ]
    with suppress(StageError):  # then there is no such surface
        if miss(fair_surface(positions, faces, ~beyond)) < min(errors):
            return None
    return cutoffs[int(np.argmin(errors))]


def _coarse(hole: Hole, depth: float) -> Coarse | None:
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
