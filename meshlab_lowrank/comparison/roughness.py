"""Detail energy: how rough a part of a surface is, whatever its triangles look like."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, normalized
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.mesh.triangle_sampling import cut_triangles

SMOOTHING = 2.5  # standard deviation of the smoothing, in mean edge lengths
_CUT_OFF = 2.5  # standard deviations after which the Gaussian is dropped
_AROUND = 8.0  # width of the surroundings, in mean edge lengths
REACH = _AROUND + 2.0 * _CUT_OFF * SMOOTHING  # width of what is looked at, in mean edge lengths
_PIECE = 0.75  # longest edge of the pieces, in mean edge lengths
_MOST_PIECES = 10_000  # that the detail is measured on; evenly chosen among more
_CELL = 1.25  # size of the cells that pieces are gathered in for averaging


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


@lru_cache(maxsize=64)
def detail_energy(surface: SurfacePart, edge_length: float) -> DetailEnergy:
    r"""Measure the detail of a part of a surface.

    With G the Gaussian average over the surface around a point (standard deviation 2.5 edge
    lengths, by area, what faces away left out), the height of the surface over its own smoothed
    version is h = (x - G x) . n, n the smoothed normal, and the detail is h - G h: the second
    difference takes out the height that constant curvature gives. The height of waves of 7 edge
    lengths passes by 0.85, of 10 by 0.5, of 16 by 0.15, of 40 by 0.006.

    Integrals are sums over pieces of triangles, exact for what is linear on a piece, so neither
    the size nor the shape of the triangles shows.

    Parameters
    ----------
    surface : SurfacePart
        With surroundings of 21 edge lengths, where there are that many. Results are kept by the
        identity of this object.
    edge_length : float
        Mean edge length of the surroundings; the same for every fill that is compared.

    Returns
    -------
    DetailEnergy
    """
    if not surface.has_area:
        return DetailEnergy(float("nan"), float("nan"))
    sigma = SMOOTHING * edge_length
    near = surface.part | _near(surface, REACH * edge_length)
    corners = surface.vertices[surface.faces[near]]
    corners, owners = cut_triangles(corners, _PIECE * edge_length)
    pieces = _Patchwork.of_triangles(corners)
    inside = surface.part[near][owners][pieces.kept]
    cells = pieces.gathered(_CELL * edge_length)
    distance, _ = cKDTree(pieces.centres[inside]).query(
        pieces.centres, distance_upper_bound=_AROUND * edge_length
    )
    near_by = np.flatnonzero(np.isfinite(distance))
    some = np.linspace(0, len(near_by) - 1, min(len(near_by), _MOST_PIECES))
    near_by = near_by[some.astype(np.int64)]
    looked_at = pieces.chosen(near_by)
    at_cells, at_pieces = (_average(at, cells, sigma) for at in (cells, looked_at))
    detail = _height(looked_at, cells, at_pieces) - at_pieces @ _height(cells, cells, at_cells)
    inside = inside[near_by]
    weighted = looked_at.areas * detail**2
    return DetailEnergy(
        *(_share(weighted[where], looked_at.areas[where]) for where in (inside, ~inside))
    )


@dataclass(frozen=True)
class _Patchwork:
    """Pieces of a surface: centres (p, 3), area vectors (p, 3), areas (p,)."""

    centres: FloatArray
    vectors: FloatArray
    areas: FloatArray
    kept: BoolArray

    @classmethod
    def of_triangles(cls, corners: FloatArray) -> _Patchwork:
        """Triangles (t, 3, 3) but for those without area; `kept` (t,) tells which."""
        vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(vectors, axis=1)
        kept = areas > 0
        return cls(corners.mean(axis=1)[kept], vectors[kept], areas[kept], kept)

    def chosen(self, number: IntArray) -> _Patchwork:
        """Keep some of the pieces, by number."""
        centres, vectors = self.centres[number], self.vectors[number]
        return _Patchwork(centres, vectors, self.areas[number], self.kept[number])

    def gathered(self, size: float) -> _Patchwork:
        """Join pieces in the same cell of a grid with normals in the same octant."""
        keys = np.column_stack([np.floor(self.centres / size), self.vectors > 0])
        _, label = np.unique(keys, axis=0, return_inverse=True)
        columns = np.column_stack([self.areas[:, None] * self.centres, self.vectors, self.areas])
        sums: FloatArray = np.stack(
            [np.bincount(label.ravel(), weights=c).astype(np.float64) for c in columns.T], axis=1
        )
        areas = sums[:, 6]
        return _Patchwork(sums[:, :3] / areas[:, None], sums[:, 3:6], areas, areas > 0)


def _near(surface: SurfacePart, distance: float) -> BoolArray:
    """Mark faces with a corner within a distance of the corners of the part."""
    own = surface.vertices[np.unique(surface.faces[surface.part])]
    gap, _ = cKDTree(own).query(surface.vertices, distance_upper_bound=distance)
    return np.asarray(np.isfinite(gap)[surface.faces].any(axis=1))


def _average(at: _Patchwork, source: _Patchwork, sigma: float) -> sparse.csr_array:
    """Row-stochastic Gaussian weights, by area, of the source pieces that face the same way."""
    pairs = cKDTree(at.centres).sparse_distance_matrix(
        cKDTree(source.centres), _CUT_OFF * sigma, output_type="ndarray"
    )
    facing = np.einsum("pd,pd->p", at.vectors[pairs["i"]], source.vectors[pairs["j"]]) > 0
    row, column, distance = (pairs[name][facing] for name in "ijv")
    values = source.areas[column] * np.exp(-0.5 * (distance / sigma) ** 2)
    shape = len(at.centres), len(source.centres)
    matrix = sparse.coo_array((values, (row, column)), shape=shape).tocsr()
    return sparse.csr_array(sparse.diags_array(1.0 / matrix.sum(axis=1)) @ matrix)


def _height(at: _Patchwork, source: _Patchwork, average: sparse.csr_array) -> FloatArray:
    """Height of pieces over the smoothed surface, along its smoothed normal."""
    direction = normalized(average @ normalized(source.vectors))
    return np.asarray(np.einsum("pd,pd->p", at.centres - average @ source.centres, direction))


def _share(values: FloatArray, areas: FloatArray) -> float:
    return float(values.sum() / areas.sum()) if len(areas) else float("nan")
