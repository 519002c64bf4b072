"""Stage 6, relief: heights over a smooth base, and how strong their detail is where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    cotangent_laplacian,
    vertex_areas,
    vertex_normals,
)
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.stages.stage1e_base_low_pass import smooth_base

_DETAIL = 2.5  # standard deviation of the average that heights are compared with, in edge lengths
_AROUND = 4.0  # of the average over squared detail
_CLEAR = 2.0  # known detail nearer to the hole than this is mixed with the smooth fill's
_LEAST_AREA = 0.05  # of a vertex, in mean ones
_LEAST = 0.05  # of the mean: what is flat is not infinitely weaker
_TINY = 1e-12


class Smoother:
    """Averages over the surface around each vertex, by two implicit steps of heat flow.

    Parameters
    ----------
    areas : (n,) float64
        Of the vertices.
    laplacian : (n, n) csr_array of float64
    width : float
        Standard deviation of the average in each direction of the surface.
    """

    def __init__(self, areas: FloatArray, laplacian: sparse.csr_array, width: float) -> None:
        self._areas = areas
        self._solve = factorized(sparse.diags_array(areas) + 0.25 * width**2 * laplacian)

    def __call__(self, values: FloatArray) -> FloatArray:
        """Average values (n,) float64."""
        return self._solve(self._areas * self._solve(self._areas * values))


@dataclass(frozen=True)
class HeightField:
    """A hole's surface as heights over a base.

    Attributes
    ----------
    hole : Hole
    base, normals : (n, 3) float64
        The smooth surface below, and its unit normals.
    heights : (n,) float64
        Of the surface along these normals; of the smooth fill where it is unknown.
    source : (n,) bool
        Vertices whose height was measured.
    areas : (n,) float64
        Of the vertices.
    laplacian : (n, n) csr_array of float64
        Of the cotangents.
    """

    hole: Hole
    base: FloatArray
    normals: FloatArray
    heights: FloatArray
    source: BoolArray
    areas: FloatArray
    laplacian: sparse.csr_array
    _blur: Smoother
    _spread: Smoother

    @classmethod
    def over_base(cls, hole: Hole, cutoff: float) -> HeightField:
        """Measure a hole over the base that lacks waves shorter than the cut-off (edge lengths)."""
        base = smooth_base(hole.positions, hole.faces, ~hole.unknown, cutoff=cutoff)
        normals = vertex_normals(base, hole.faces)
        areas = vertex_areas(hole.positions, hole.faces)
        areas = np.maximum(areas, _LEAST_AREA * areas.mean())
        laplacian = cotangent_laplacian(hole.positions, hole.faces)
        return cls(
            hole=hole,
            base=base,
            normals=normals,
            heights=np.einsum("ij,ij->i", hole.positions - base, normals),
            source=hole.measured & ~hole.unknown,
            areas=areas,
            laplacian=laplacian,
            _blur=Smoother(areas, laplacian, _DETAIL),
            _spread=Smoother(areas, laplacian, _AROUND),
        )

    def strength(self, heights: FloatArray) -> FloatArray:
        """Size of the detail of heights (n,) at each vertex, (n,) float64."""
        detail = heights - self._blur(heights)
        detail -= self._blur(detail)  # the height that constant curvature gives
        return np.abs(detail)

    def around(self, values: FloatArray, counted: BoolArray | FloatArray) -> FloatArray:
        """Average values (n,) around each vertex over those that are counted, (n,), by area."""
        weight = counted.astype(np.float64)
        return self._spread(weight * values) / np.maximum(self._spread(weight), _TINY)

    def carried_on(self, values: FloatArray, weights: FloatArray | None = None) -> FloatArray:
        """Average positive values around each known vertex, and carry them on into the hole.

        Between a strong and a weak part of the rim they go by equal ratios, so that a sharp edge
        at one side of a smooth place makes no rubble of it.

        Parameters
        ----------
        values : (n,) float64
            Not read where the surface is unknown, nor next to it.
        weights : (n,) float64, optional
            What each counts for its area; by default all alike.

        Returns
        -------
        (n,) float64
        """
        away = cKDTree(self.base[self.hole.unknown]).query(self.base)[0]
        clear = self.source & (away > _CLEAR)
        counted = clear if clear.any() else self.source
        weight = counted if weights is None else np.where(counted, weights, 0.0)
        near = self.around(np.where(counted, values, 0.0), weight)
        level = np.log(np.maximum(near, _LEAST * values[counted].mean() + _TINY))
        system = self.laplacian + 1e-9 * sparse.eye_array(len(self.areas))
        return np.exp(minimise_with_fixed(sparse.csr_array(system), self.source, level))

    def raised(self, heights: FloatArray) -> FloatArray:
        """Positions (n, 3) float64 of the surface with these heights; known ones stay."""
        change = np.where(self.hole.unknown, heights - self.heights, 0.0)
        return self.hole.positions + change[:, None] * self.normals
