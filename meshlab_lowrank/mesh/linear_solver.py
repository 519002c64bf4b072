"""Sparse direct solution of symmetric positive definite systems."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import FloatArray


def factorized(matrix: sparse.sparray) -> Callable[[FloatArray], FloatArray]:
    """Factorise a symmetric positive definite matrix once, to solve for many right sides.

    Pivots stay on the diagonal, which such matrices allow: otherwise the fill-in of bi- and
    three-harmonic systems grows several times over.

    Parameters
    ----------
    matrix : (n, n) sparse array of float64

    Returns
    -------
    callable
        Takes the right side, (n,) or (n, d) float64, and gives the solution of that shape.

    Raises
    ------
    StageError
        If the matrix is singular.
    """
    try:
        factors = splu(
            sparse.csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        msg = "The surroundings of this hole don't determine a smooth fill."
        raise StageError(msg) from error

    def solve(right: FloatArray) -> FloatArray:
        return np.asarray(factors.solve(right))

    return solve
