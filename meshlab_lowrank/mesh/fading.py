"""Values given on a part of a surface, continued so that they die away beyond it."""

from __future__ import annotations

from typing import Literal

from scipy import sparse

from meshlab_lowrank.mesh.energies import harmonic_energy
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    cotangent_laplacian,
    vertex_areas,
)


def faded(
    vertices: FloatArray,
    faces: IntArray,
    fixed: BoolArray,
    values: FloatArray,
    *,
    length: float,
    order: Literal[2, 1] = 2,
) -> FloatArray:
    """Continue values as the function s of least ``integral of s^2 + length^4 (Laplacian of s)^2``.

    It goes on with their slope. Of order 1, it is of least
    ``integral of s^2 + length^2 (gradient of s)^2``, and goes on with the values alone.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    fixed : (n,) bool
        Where values are given.
    values : (n, d) float64
        Read where fixed.
    length : float
        Over which they die away.
    order : {2, 1}

    Returns
    -------
    (n, d) float64
        Equal to the given values, bit for bit, where fixed.
    """
    mass = sparse.diags_array(vertex_areas(vertices, faces))
    if order == 2:
        bent = harmonic_energy(vertices, faces, 2)
    else:
        bent = cotangent_laplacian(vertices, faces)
    return minimise_with_fixed(sparse.csr_array(mass + length ** (2 * order) * bent), fixed, values)
