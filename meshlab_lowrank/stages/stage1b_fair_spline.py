"""Stage 1, fairing: a circular B-spline surface along the tangents at the rim (section 3.2).

The paper's own stage 1, written from what it says of it; the rest is chosen here:

- The surface is bicubic: periodic along the rim, and across it from there to a pole in the middle.
- Its first row of control points interpolates the rim, and the second lies along the tangents of
  the measured surface there, towards the middle. The tangents are as long as it is far, or as the
  radius of the curvature of the measured surface in their direction, if that is shorter: a bent rim
  says little of what lies far from it.
- The last rows are the pole and a tangent plane there; of all, these bend the surface least.
- Vertices of the closed fill go where a harmonic map of the fill into the rim, seen along its mean
  normal, has them. The rim has to be a star about its centre, seen so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import isotonic_regression

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.boundary_walk import area_vector
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import (
    FloatArray,
    IntArray,
    cotangent_laplacian,
    normalized,
    vertex_normals,
)
from meshlab_lowrank.mesh.topology import vertex_adjacency
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1b_fair import Fair, FairRegion
from meshlab_lowrank.stages.stage1b_fair_harmonic import HarmonicFairing

_LEAST_TURN = 0.2  # of the mean angle between vertices of a rim, seen from its centre
_MOST_MOVED = 0.2  # radians
_LEAST_EDGES = 4  # of a loop, for a periodic cubic


@dataclass(frozen=True)
class SplineFairing(Stage):
    """Circular B-spline surfaces; see `Fair` and `spline_surface`.

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


def _star_of(region: Region) -> FloatArray | None:
    """Give the loop of a region seen from its middle, see `rim_star`, if it is to have a spline.

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


def _splined(region: Region, star: FloatArray) -> FairRegion | StageError:
    unknown = np.flatnonzero(~region.known_vertices)
    if len(unknown) == 0:
        return FairRegion(region, np.nan)
    try:
        around, inwards = _within(region, star)
    except StageError as error:
        return error
    vertices = region.vertices.copy()
    vertices[unknown] = spline_surface(region, star)(around, inwards)
    return FairRegion(replace(region, vertices=vertices), np.nan)


@dataclass(frozen=True)
class SplineSurface:
    """A bicubic surface that is periodic in one direction and ends in a pole in the other.

    Attributes
    ----------
    rows : BSpline
        The four rows of control points (4, 3), as periodic cubic B-splines over 0 to 1.
    """

    rows: BSpline

    def __call__(self, around: FloatArray, inwards: FloatArray) -> FloatArray:
        """Points (p, 3), for parameters (p,) along the rim and from it (0) to the pole (1)."""
        v = inwards[:, None]
        basis = np.stack([(1 - v) ** 3, 3 * v * (1 - v) ** 2, 3 * v**2 * (1 - v), v**3], axis=1)
        return np.asarray((basis * self.rows(around)).sum(axis=1))


def spline_surface(region: Region, star: FloatArray) -> SplineSurface:
    """Make the surface that spans the loop of a region.

    Parameters
    ----------
    region : Region
        Its known part alone is looked at.
    star : (k, 2) float64
        Its loop, see `rim_star`.

    Returns
    -------
    SplineSurface
        Parameters along the rim are those of `rim_parameters`.
    """
    rim = region.vertices[region.loop]
    tangents = rim_tangents(region)
    width = np.linalg.norm(np.roll(rim, -1, axis=0) - np.roll(rim, 1, axis=0), axis=1)[:, None]
    # The integral of the squared second derivative of a cubic from p to q with tangents m and n is
    # 12 |q - p|^2 - 12 (q - p)(m + n) + 4 (m^2 + m n + n^2); q is the pole, n linear in the star.
    pole = np.ones((len(rim), 1))
    quadratic = np.block(
        [
            [24.0 * pole.T @ (width * pole), -12.0 * pole.T @ (width * star)],
            [-12.0 * star.T @ (width * pole), 8.0 * star.T @ (width * star)],
        ]
    )
    linear = np.concatenate(
        [
            pole.T @ (width * (24.0 * rim + 12.0 * tangents)),
            star.T @ (width * (-12.0 * rim - 4.0 * tangents)),
        ]
    )
    found = np.linalg.solve(quadratic, linear)
    end = np.repeat(found[:1], len(rim), axis=0)
    rows = np.stack([rim, rim + tangents / 3.0, end - star @ found[1:] / 3.0, end], axis=1)
    places = np.append(rim_parameters(rim), 1.0)
    closed = np.concatenate([rows, rows[:1]])
    return SplineSurface(make_interp_spline(places, closed, k=3, bc_type="periodic"))


def rim_star(rim: FloatArray) -> FloatArray | None:
    """See a closed rim (k, 3) along its mean normal, from the centre of the area that it encloses.

    Gives coordinates (k, 2) in that plane, in order around the centre but for a zigzag that is
    straightened; None where a line from the centre meets it twice.
    """
    normal = area_vector(rim)
    if not normal.any():
        return None
    upright = normalized(normal)
    first = normalized(np.cross(upright, np.eye(3)[np.argmin(np.abs(upright))]))
    flat = (rim - rim.mean(axis=0)) @ np.stack([first, np.cross(upright, first)], axis=1)
    after = np.roll(flat, -1, axis=0)
    twice = flat[:, 0] * after[:, 1] - flat[:, 1] * after[:, 0]
    flat = flat - twice @ (flat + after) / (3.0 * twice.sum())
    after = np.roll(flat, -1, axis=0)
    turns = np.arctan2(_cross(flat, after), (flat * after).sum(axis=1))
    if abs(turns.sum() - 2.0 * np.pi) > 1.0:
        return None
    return _straightened(flat, turns)


def _straightened(flat: FloatArray, turns: FloatArray) -> FloatArray | None:
    """Turn points of a rim about its centre until all come in order; None if that takes much.

    The zigzag of edges along a rim has some that are out of order.
    """
    k = len(flat)
    first = (int(np.argmax(turns)) + 1) % k  # behind the widest gap
    order = np.roll(np.arange(k), -first)
    angles = np.cumsum(np.roll(turns, -first)) - turns[first]
    least = _LEAST_TURN * 2.0 * np.pi / k * np.arange(k)
    straight = isotonic_regression(angles - least).x + least
    moved = np.zeros(k)
    moved[order] = straight - angles
    if np.abs(moved).max() > _MOST_MOVED or straight[-1] - straight[0] >= 2.0 * np.pi:
        return None
    cosine, sine = np.cos(moved), np.sin(moved)
    x, y = flat.T
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)


def rim_parameters(rim: FloatArray) -> FloatArray:
    """Lengths (k,) along a closed rim (k, 3) up to each of its vertices, over the whole."""
    sides = np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1)
    return np.asarray((np.cumsum(sides) - sides) / sides.sum())


def rim_tangents(region: Region) -> FloatArray:
    """Tangents (k, 3) of the measured surface at the loop, towards the middle.

    As long as that is far, or as the radius of curvature in their direction, if that is shorter.
    """
    rim, faces = region.vertices[region.loop], region.faces[region.known_faces]
    normals = vertex_normals(region.vertices, faces)[region.loop]
    middle = rim.mean(axis=0) - rim
    inwards = middle - np.einsum("ij,ij->i", middle, normals)[:, None] * normals
    far, inwards = np.linalg.norm(middle, axis=1), normalized(inwards)
    radius = 1.0 / np.maximum(np.abs(_curvatures(region, faces, normals, inwards)), 1e-12)
    return np.asarray(np.minimum(far, radius)[:, None] * inwards)


def _curvatures(
    region: Region, faces: IntArray, normals: FloatArray, inwards: FloatArray
) -> FloatArray:
    """Curvatures (k,) of parabolas through two rings of measured vertices at those of the loop."""
    adjacency = vertex_adjacency(faces, len(region.vertices))
    near = (adjacency @ adjacency + adjacency)[region.loop].tocoo()
    offset = region.vertices[near.col] - region.vertices[region.loop][near.row]
    across = np.einsum("ij,ij->i", offset, inwards[near.row])
    height = np.einsum("ij,ij->i", offset, normals[near.row])

    def total(values: FloatArray) -> FloatArray:
        return np.bincount(near.row, values, minlength=len(normals)).astype(np.float64)

    # normals at a rim are one-sided, so the parabola may have a slope
    x2, x3, x4 = (total(across**power) for power in (2, 3, 4))
    top = x2 * total(height * across**2) - x3 * total(height * across)
    bottom = x2 * x4 - x3**2
    return np.divide(2.0 * top, bottom, out=np.zeros_like(top), where=bottom > 1e-9 * x2 * x4)


def _within(region: Region, star: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Parameters of the new vertices: around the rim, and inwards from it."""
    ids, local = np.unique(region.faces[~region.known_faces], return_inverse=True)
    at_rim = np.searchsorted(ids, region.loop)
    place, held = np.zeros((len(ids), 2)), np.zeros(len(ids), dtype=np.bool_)
    place[at_rim], held[at_rim] = star, True
    laplacian = cotangent_laplacian(region.vertices[ids], local.reshape(-1, 3))
    point = minimise_with_fixed(laplacian, held, place)[~region.known_vertices[ids]]
    # the side of the rim that each is seen against from the centre
    k, after = len(star), np.roll(star, -1, axis=0)
    start = np.arctan2(star[0, 1], star[0, 0])
    angles = np.mod(np.arctan2(star[:, 1], star[:, 0]) - start, 2.0 * np.pi)
    seen = np.mod(np.arctan2(point[:, 1], point[:, 0]) - start, 2.0 * np.pi)
    side = np.searchsorted(angles, seen, side="right") - 1
    step = _cross(point, after[side] - star[side])
    share = np.divide(-_cross(point, star[side]), step, out=np.zeros(len(point)), where=step != 0.0)
    share = np.clip(share, 0.0, 1.0)
    rim = star[side] + share[:, None] * (after[side] - star[side])
    inwards = 1.0 - np.linalg.norm(point, axis=1) / np.linalg.norm(rim, axis=1)
    places = np.append(rim_parameters(region.vertices[region.loop]), 1.0)
    around = places[side] + share * (places[np.minimum(side + 1, k)] - places[side])
    return np.asarray(around), np.asarray(np.clip(inwards, 0.0, 1.0))


def _cross(u: FloatArray, w: FloatArray) -> FloatArray:
    return np.asarray(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])
