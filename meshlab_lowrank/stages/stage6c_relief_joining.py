"""Stage 6, relief: copies joined to one another and to the rim without steps or creases."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.stages.stage6c_relief_field import HeightField
from meshlab_lowrank.stages.stage6c_relief_fronts import Copy

_UNTOLD = 0.01  # weight of the smooth fill's own Laplacian where no copy tells one


class Joiner:
    """Heights whose Laplacian is that of the copies, while longer waves are the smooth fill's.

    Minimises ``sum 1/a (L h - d)^2 + k^4 sum a (h - h0)^2`` over the unknown heights h, with the
    Laplacian L, the vertex areas a, the Laplacian d of the copy whose centre is nearest, and the
    heights h0 of the smooth fill. A wave of the copies passes by ``1 / (1 + (k / q)^4)``, q its
    wave number, so what is longer than the split comes from the smooth fill: there a guess would
    add its own error to the one that the smooth fill has. Since the rows of L at the rim count too,
    the joint has no crease.

    Parameters
    ----------
    field : HeightField
    copies : sequence of Copy
    split : float
        Wavelength, in mean edge lengths, of which half the amplitude passes.
    """

    def __init__(self, field: HeightField, copies: Sequence[Copy], split: float) -> None:
        n, unknown = len(field.heights), field.hole.unknown
        laplacian = field.laplacian
        touched = np.flatnonzero((abs(laplacian) @ unknown.astype(np.float64)) > 0.0)
        nearest = np.full(n, np.inf)
        wanted = laplacian @ field.heights
        for copy in copies:
            values = np.full(n, np.nan)
            values[copy.vertices] = copy.heights
            found = laplacian[copy.vertices] @ values  # NaN where the copy ends
            away = np.linalg.norm(field.base[copy.vertices] - field.base[copy.centre], axis=1)
            nearer = np.isfinite(found) & (away < nearest[copy.vertices])
            rows = copy.vertices[nearer]
            nearest[rows], wanted[rows] = away[nearer], found[nearer]
        weight = np.where(np.isfinite(nearest), 1.0, _UNTOLD)[touched] / field.areas[touched]
        pull = (2.0 * np.pi / split) ** 4 * np.where(unknown, field.areas, 0.0)
        weighted = sparse.csr_array(laplacian[touched].T @ sparse.diags_array(weight))
        system = sparse.csr_array(weighted @ laplacian[touched] + sparse.diags_array(pull))
        self._told = np.isfinite(nearest)
        self._wanted, self._touched, self._weighted = wanted, touched, weighted
        self._free, self._known = np.flatnonzero(unknown), np.where(unknown, 0.0, field.heights)
        self._fixed = pull * field.heights - system @ self._known
        self._solve = factorized(system[self._free][:, self._free])

    def heights(self, gain: FloatArray) -> FloatArray:
        """Join the copies, their Laplacian scaled by a gain (n,) at each vertex.

        Returns
        -------
        (n,) float64
            Known heights as they were.
        """
        wanted = np.where(self._told, gain, 1.0) * self._wanted
        right = self._weighted @ wanted[self._touched] + self._fixed
        result = self._known.copy()
        result[self._free] = self._solve(right[self._free])
        return result
