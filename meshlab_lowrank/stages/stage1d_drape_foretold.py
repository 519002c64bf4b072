"""Stage 1, drape: the mean of smoothing splines, weighed by how they foretell the surroundings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from meshlab_lowrank.hole import Hole, depth_of
from meshlab_lowrank.mesh.fading import faded
from meshlab_lowrank.mesh.fairing import membrane
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    vertex_normals,
)
from meshlab_lowrank.mesh.interpolation import interpolation
from meshlab_lowrank.mesh.topology import compacted, faces_at
from meshlab_lowrank.mesh.unfolding import folded_pairs
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage1d_drape_splines import coarse_surface, foretelling, laid_out

_JOIN = 0.25  # length over which the fill leaves the rim, in wavelengths
_RIM_RINGS = 2
_MOST_SPREAD = 0.05  # of the vertices of a fill, beyond which it is laid wrongly


@dataclass(frozen=True)
class ForetoldDrape(Stage):
    """Lay the fill onto three-harmonic smoothing splines through the known surface; see `Drape`.

    A fill that is faired to its rim takes the detail cut by the rim for the slope of the body, and
    the wider the hole, the further it swings off. A spline sees all the surroundings, but how
    stiff it may be depends on the body: a stiff one averages the detail better, a soft one follows
    strong curvature. So known surface around the hole is taken as missing too and foretold from
    what lies beyond, on a coarse surface, and the splines are averaged, the more those count that
    foretell it better; the faired fill stays where the same fairing foretells it better still.

    Parameters
    ----------
    cutoffs : tuple of float
        Wavelengths below which the splines remove detail, in wavelengths of the detail; empty: the
        fill is left.
    sharpness : float
        See `foretelling`.
    least_depth : float
        Of a hole, in wavelengths (shortened where patches are), from which on its fill is laid;
        others don't swing far.
    """

    cutoffs: tuple[float, ...] = (0.9, 1.2, 1.6, 2.1, 2.8, 3.7)
    sharpness: float = 2.0
    least_depth: float = 1.8

    def __call__(self, hole: Hole) -> Hole:
        """Lay the fill; see `Drape`."""
        depth = float(depth_of(hole).max())
        if not self.cutoffs or depth < self.least_depth * hole.patch_wavelength:
            return hole
        spline = self._mean_spline(hole, depth)
        if spline is None:
            return hole
        known, length = ~hole.unknown, _JOIN * hole.wavelength
        orders: tuple[Literal[2, 1], ...] = (2, 1)
        for order in orders:
            joined = joined_at_rim(
                hole.positions, spline, hole.faces, known, length=length, order=order
            )
            if not folds_more(joined, hole):
                return replace(hole, positions=joined, draped=True)
        spread = spread_where_folded(joined, hole)
        if spread is None or folds_more(spread, hole):
            return hole
        return replace(hole, positions=spread, draped=True)

    def for_trial(self) -> ForetoldDrape:
        """Leave the fills of fake holes, which are small."""
        return replace(self, cutoffs=())

    def _mean_spline(self, hole: Hole, depth: float) -> FloatArray | None:
        """Give the mean of the splines at the vertices (n, 3); None where none is of use."""
        coarse = coarse_surface(hole, depth)
        if coarse is None:
            return None
        weights = foretelling(
            coarse, self.cutoffs, hole.wavelength, depth, sharpness=self.sharpness
        )
        if weights is None:
            return None
        mean = np.zeros_like(coarse.positions)
        for cutoff, weight in zip(self.cutoffs, weights, strict=True):
            if weight > 0.0:
                surface = coarse.positions, coarse.faces, coarse.known
                mean += weight * laid_out(*surface, cutoff=cutoff * hole.wavelength)
        onto = interpolation(
            hole.positions,
            vertex_normals(hole.positions, hole.faces),
            coarse.positions,
            vertex_normals(coarse.positions, coarse.faces),
        )
        return np.asarray(onto @ mean)


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
    return len(_folded_pairs(positions, hole)) > len(_folded_pairs(hole.positions, hole))


def spread_where_folded(positions: FloatArray, hole: Hole) -> FloatArray | None:
    """Spread the vertices of a fill evenly where new positions (n, 3) fold it.

    Where a fill is laid far from where it was, its triangles may close up in places. A minimal
    surface takes the place of what is folded and the faces around; None where that is more than
    a few places.
    """
    free = np.zeros(len(positions), dtype=np.bool_)
    free[hole.faces[_folded_pairs(positions, hole)]] = True
    free[hole.faces[faces_at(free, hole.faces)]] = True
    free &= hole.unknown
    if np.count_nonzero(free) > _MOST_SPREAD * np.count_nonzero(hole.unknown):
        return None
    return membrane(positions, hole.faces, free)


def _folded_pairs(positions: FloatArray, hole: Hole) -> IntArray:
    """Pairs (p, 2) of faces of the fill that lie folded onto one another."""
    own = np.flatnonzero(faces_at(hole.unknown, hole.faces))
    return np.asarray(own[folded_pairs(positions, hole.faces[own])])
