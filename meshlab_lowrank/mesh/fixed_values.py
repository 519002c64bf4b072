"""Quadratic energies minimised with some of the unknowns fixed."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray
from meshlab_lowrank.mesh.linear_solver import factorized


class FixedValueSolver:
    """Holds the factorisation of an energy ``x' Q x`` whose fixed unknowns are always the same.

    Parameters
    ----------
    energy : (n, n) csr_array of float64
        Q, symmetric and positive semi-definite.
    fixed : (n,) bool
        Unknowns whose values are given.

    Raises
    ------
    StageError
        If the fixed values don't determine the others.

    See Also
    --------
    minimise_with_fixed : For a single right side.
    """

    def __init__(self, energy: sparse.csr_array, fixed: BoolArray) -> None:
        self._free, self._fixed = np.flatnonzero(~fixed), np.flatnonzero(fixed)
        rows = energy[self._free]
        self._from_fixed = rows[:, self._fixed]
        self._solve = factorized(rows[:, self._free]) if len(self._free) else None

    def solve(self, values: FloatArray) -> FloatArray:
        """Minimise the energy.

        Parameters
        ----------
        values : (n,) or (n, d) float64
            Read where fixed.

        Returns
        -------
        (n,) or (n, d) float64
            Equal to the given values, bit for bit, where fixed.
        """
        result = values.copy()
        if self._solve is not None:
            result[self._free] = self._solve(-(self._from_fixed @ values[self._fixed]))
        return result


def minimise_with_fixed(
    energy: sparse.csr_array, fixed: BoolArray, values: FloatArray
) -> FloatArray:
    """Minimise ``x' Q x`` over the unknowns that are not fixed.

    Parameters
    ----------
    energy : (n, n) csr_array of float64
    fixed : (n,) bool
    values : (n,) or (n, d) float64
        Read where fixed.

    Returns
    -------
    (n,) or (n, d) float64

    Raises
    ------
    StageError
        If the fixed values don't determine the others.

    See Also
    --------
    FixedValueSolver : Keeps the factorisation for other values.

    Examples
    --------
    A chain of three springs, held at both ends:

    >>> import numpy as np
    >>> from scipy import sparse
    >>> energy = sparse.csr_array([[1.0, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 1]])
    >>> fixed = np.array([True, False, False, True])
    >>> minimise_with_fixed(energy, fixed, np.array([0.0, 9.0, 9.0, 3.0]))
    array([0., 1., 2., 3.])
    """
    return FixedValueSolver(energy, fixed).solve(values)
