"""Stage 1, fairing: a circular B-spline surface along the tangents at the rim (section 3.2).

The paper's own stage 1, written from what it says of it; the rest is chosen here:

- The surface is a bicubic B-spline over the mean plane of the rim: periodic along the rim, and from
  there in rows of control points to a pole at its centre. The rim has to be a star about that.
- The first rows interpolate the rim and the slopes of the measured surface there, towards the
  centre. The others lie on the plate that bends least over a disc and is clamped in that way, at
  the rim without its zigzag.
- What is told of the use of the curvature of the rim is too little to follow.
- Vertices of the closed fill lie on the surface where a harmonic map into the rim has them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import isotonic_regression

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.boundary_walk import area_vector
from meshlab_lowrank.mesh.clamped_plate import clamped_plate
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import (
    FloatArray,
    cotangent_laplacian,
    normalized,
    vertex_normals,
)
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1b_fair import Fair, FairRegion
from meshlab_lowrank.stages.stage1b_fair_harmonic import HarmonicFairing

_LEAST_TURN = 0.2  # of the mean angle between vertices of a rim, seen from its centre
_MOST_MOVED = 0.2  # radians
_LEAST_EDGES = 4  # of a loop, for a periodic cubic
_LEAST_SPANS, _MOST_SPANS = 4, 24  # from the rim to the pole
_ZIGZAG = 3  # vertices of the rim to either side over whose distances it is evened out
_STEEPEST = 3.0  # slope of the measured surface over the mean plane of the rim


@dataclass(frozen=True)
class SplineFairing(Stage):
    """Circular B-spline surfaces; see `Fair` and `SplineSurface`.

    Fills that are to be flat or to have tangents only, and those of rings, of loops of three edges
    and of rims that are no star, are given to another fairing.

    Parameters
    ----------
    otherwise : Fair
    """

    otherwise: Fair = field(default_factory=HarmonicFairing)

    @property
    def rings(self) -> int:
        """Rings of vertices around a hole that are looked at."""
        return self.otherwise.rings

    def __call__(self, regions: Sequence[Region]) -> list[FairRegion | StageError]:
        """Move the new vertices; see `Fair`."""
        stars = [_star_of(region) for region in regions]
        rest = [region for region, star in zip(regions, stars, strict=True) if star is None]
        others = iter(self.otherwise(rest) if rest else [])
        return [
            next(others) if star is None else _splined(region, star)
            for region, star in zip(regions, stars, strict=True)
        ]


def _star_of(region: Region) -> Star | None:
    """See the loop of a region from its middle, see `rim_star`, if it is to have a spline.

    None if its fill is to go on otherwise, or its loop is not one closed chain that the fill has.
    """
    if region.continuity != "smooth" or region.islands or len(region.loop) < _LEAST_EDGES:
        return None
    filled, n = region.faces[~region.known_faces], len(region.vertices)
    half_edges = (filled * n + np.roll(filled, -1, axis=1)).ravel()
    along = region.loop * n + np.roll(region.loop, -1)
    if len(np.unique(region.loop)) < len(along) or not np.isin(along, half_edges).all():
        return None
    return rim_star(region.vertices[region.loop])


def _splined(region: Region, star: Star) -> FairRegion | StageError:
    unknown = np.flatnonzero(~region.known_vertices)
    if len(unknown) == 0:
        return FairRegion(region, np.nan)
    try:
        flat = _within(region, star)
    except StageError as error:
        return error
    height = spline_surface(region, star)(*star.parameters(flat))
    vertices = region.vertices.copy()
    vertices[unknown] = star.in_space(flat, height)
    return FairRegion(replace(region, vertices=vertices), np.nan)


@dataclass(frozen=True)
class Star:
    """A rim over its mean plane, seen from its centre.

    Attributes
    ----------
    flat : (k, 2) float64
        Its vertices in the plane, in order around the centre.
    height : (k,) float64
        Above it.
    centre : (3,) float64
    frame : (3, 3) float64
        Rows: two directions in the plane, and its normal.
    """

    flat: FloatArray
    height: FloatArray
    centre: FloatArray
    frame: FloatArray

    def in_space(self, flat: FloatArray, height: FloatArray) -> FloatArray:
        """Places (p, 3) of points (p, 2) of the plane at heights (p,)."""
        return np.asarray(self.centre + np.column_stack([flat, height]) @ self.frame)

    def angles(self) -> FloatArray:
        """Angles (k,) of the vertices about the centre, ascending from that of the first, 0."""
        x, y = self.flat.T
        angle = np.arctan2(y, x)
        return np.asarray(np.mod(angle - angle[0], 2.0 * np.pi))

    def parameters(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angles (p,) of points (p, 2) about the centre, and how far (p,) they lie from the rim.

        The second is 0 at the rim and 1 at the centre.
        """
        angles, after = self.angles(), np.roll(self.flat, -1, axis=0)
        first = np.arctan2(self.flat[0, 1], self.flat[0, 0])
        seen = np.mod(np.arctan2(points[:, 1], points[:, 0]) - first, 2.0 * np.pi)
        side = np.searchsorted(angles, seen, side="right") - 1
        start, step = self.flat[side], after[side] - self.flat[side]
        turn = _cross(points, step)
        share = np.divide(-_cross(points, start), turn, out=np.zeros(len(turn)), where=turn != 0.0)
        rim = start + np.clip(share, 0.0, 1.0)[:, None] * step
        outwards = np.linalg.norm(points, axis=1) / np.linalg.norm(rim, axis=1)
        return seen, np.clip(1.0 - outwards, 0.0, 1.0)


@dataclass(frozen=True)
class SplineSurface:
    """Heights that are a bicubic B-spline, periodic in the angle, from the rim to the pole.

    Attributes
    ----------
    rows : BSpline
        The heights of the rows of control points, (r,), as a periodic spline of the angle.
    knots : (r + 4,) float64
        Of the splines across, over 0 at the rim to 1 at the pole.
    """

    rows: BSpline
    knots: FloatArray

    def __call__(self, angles: FloatArray, inwards: FloatArray) -> FloatArray:
        """Heights (p,) at angles (p,) and so far inwards (p,)."""
        across = BSpline.design_matrix(inwards, self.knots, 3).toarray()
        return np.asarray((across * self.rows(angles)).sum(axis=1))


def spline_surface(region: Region, star: Star) -> SplineSurface:
    """Make the surface that spans the loop of a region.

    Parameters
    ----------
    region : Region
        Its known part alone is looked at.
    star : Star
        Its loop.

    Returns
    -------
    SplineSurface
    """
    far, slope = np.linalg.norm(star.flat, axis=1), rim_slopes(region, star)
    shift = np.arange(-_ZIGZAG, _ZIGZAG + 1)
    even = far[(np.arange(len(far)) + shift[:, None]) % len(far)].mean(axis=0)
    spans = int(np.clip(np.rint(far.mean()), _LEAST_SPANS, _MOST_SPANS))
    places = np.linspace(0.0, 1.0, spans + 1)
    heights = clamped_plate(
        star.angles(),
        star.height + slope * (far - even),
        even * slope,
        (1.0 - places)[:, None] * (far / even),
    )
    heights[0], slope = star.height, far * slope  # over the way to the pole
    ends: Any = ([(1, slope)], [(2, np.zeros(len(far)))])  # derivatives at the rim and the pole
    across = make_interp_spline(places, heights, k=3, bc_type=ends)
    rows = np.ascontiguousarray(across.c.T)
    around = np.append(star.angles(), 2.0 * np.pi)
    closed = np.concatenate([rows, rows[:1]])
    return SplineSurface(make_interp_spline(around, closed, k=3, bc_type="periodic"), across.t)


def rim_slopes(region: Region, star: Star) -> FloatArray:
    """Slopes (k,) of the measured surface at the loop, towards the centre, over the mean plane."""
    faces = region.faces[region.known_faces]
    normals = vertex_normals(region.vertices, faces)[region.loop] @ star.frame.T
    ahead = -normalized(star.flat)
    rise = -np.einsum("ij,ij->i", normals[:, :2], ahead)
    upright = np.maximum(normals[:, 2], 1e-12)
    return np.asarray(np.clip(rise / upright, -_STEEPEST, _STEEPEST))


def rim_star(rim: FloatArray) -> Star | None:
    """See a closed rim (k, 3) along its mean normal, from the centre of the area that it encloses.

    A zigzag is straightened; None where a line from the centre meets the rim twice.
    """
    normal = area_vector(rim)
    if not normal.any():
        return None
    upright = normalized(normal)
    first = normalized(np.cross(upright, np.eye(3)[np.argmin(np.abs(upright))]))
    frame = np.stack([first, np.cross(upright, first), upright])
    local = (rim - rim.mean(axis=0)) @ frame.T
    flat, after = local[:, :2], np.roll(local[:, :2], -1, axis=0)
    twice = _cross(flat, after)
    middle = twice @ (flat + after) / (3.0 * twice.sum())
    flat, after = flat - middle, after - middle
    turns = np.arctan2(_cross(flat, after), (flat * after).sum(axis=1))
    if abs(turns.sum() - 2.0 * np.pi) > 1.0:
        return None
    straight = _straightened(flat, turns)
    if straight is None:
        return None
    centre = rim.mean(axis=0) + middle @ frame[:2]
    return Star(straight, local[:, 2], centre, frame)


def _straightened(flat: FloatArray, turns: FloatArray) -> FloatArray | None:
    """Turn points of a rim about its centre until all come in order; None if that takes much.

    The zigzag of edges along a rim has some that are out of order.
    """
    k = len(flat)
    first = (int(np.argmax(turns)) + 1) % k  # behind the widest gap
    order = np.roll(np.arange(k), -first)
    onward = turns[order]
    angles = np.cumsum(onward) - onward
    least = _LEAST_TURN * 2.0 * np.pi / k * np.arange(k)
    straight = isotonic_regression(angles - least).x + least
    moved = np.zeros(k)
    moved[order] = straight - angles
    if np.abs(moved).max() > _MOST_MOVED or straight[-1] - straight[0] >= 2.0 * np.pi:
        return None
    cosine, sine = np.cos(moved), np.sin(moved)
    x, y = flat.T
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)


def _within(region: Region, star: Star) -> FloatArray:
    """Places (v, 2) of the new vertices in the plane of the rim."""
    ids, local = np.unique(region.faces[~region.known_faces], return_inverse=True)
    at_rim = np.searchsorted(ids, region.loop)
    place, held = np.zeros((len(ids), 2)), np.zeros(len(ids), dtype=np.bool_)
    place[at_rim], held[at_rim] = star.flat, True
    laplacian = cotangent_laplacian(region.vertices[ids], local.reshape(-1, 3))
    return minimise_with_fixed(laplacian, held, place)[~region.known_vertices[ids]]


def _cross(u: FloatArray, w: FloatArray) -> FloatArray:
    return np.asarray(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])
