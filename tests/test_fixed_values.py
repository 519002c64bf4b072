"""Quadratic energies with fixed values: optimality, and what is fixed stays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.energies import harmonic_energy
from meshlab_lowrank.mesh.fixed_values import FixedValueSolver, minimise_with_fixed
from meshlab_lowrank.mesh.geometry import cotangent_laplacian
from meshlab_lowrank.mesh.topology import boundary_vertices


@pytest.fixture(scope="module")
def flat(sheet):
    return sheet(14, 12)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_gradient_vanishes_where_nothing_is_fixed(flat, order):
    vertices, faces = flat
    energy = cotangent_laplacian(*flat) if order == 1 else harmonic_energy(*flat, order)
    chance = np.random.default_rng(0)
    fixed = boundary_vertices(faces, len(vertices)) | (chance.uniform(size=len(vertices)) < 0.3)
    values = chance.normal(size=(len(vertices), 2))
    found = minimise_with_fixed(energy, fixed, values)
    np.testing.assert_allclose((energy @ found)[~fixed], 0.0, atol=1e-9)
    assert found[fixed].tobytes() == values[fixed].tobytes()
    for _ in range(3):  # nothing near has less energy
        other = found + np.where(fixed[:, None], 0.0, 0.1 * chance.normal(size=found.shape))
        assert np.vdot(other, energy @ other) > np.vdot(found, energy @ found)


def test_harmonic_functions_of_linear_values_are_linear(flat):
    vertices, faces = flat
    fixed = boundary_vertices(faces, len(vertices))
    linear = vertices @ [2.0, -1.0, 0.0] + 0.5
    given = np.where(fixed, linear, np.nan)  # what is not fixed is not read
    found = minimise_with_fixed(cotangent_laplacian(*flat), fixed, given)
    np.testing.assert_allclose(found, linear, atol=1e-10)


def test_one_factorisation_serves_many_values(flat):
    vertices, faces = flat
    fixed = boundary_vertices(faces, len(vertices))
    solver = FixedValueSolver(cotangent_laplacian(*flat), fixed)
    for seed in range(3):
        values = np.random.default_rng(seed).normal(size=len(vertices))
        expected = minimise_with_fixed(cotangent_laplacian(*flat), fixed, values)
        np.testing.assert_array_equal(solver.solve(values), expected)


def test_all_fixed_is_a_copy_and_none_is_refused():
    energy = sparse.csr_array([[1.0, -1.0], [-1.0, 1.0]])
    values = np.array([3.0, 4.0])
    found = minimise_with_fixed(energy, np.ones(2, dtype=bool), values)
    np.testing.assert_array_equal(found, values)
    assert found is not values
    with pytest.raises(StageError):
        minimise_with_fixed(sparse.csr_array((2, 2)), np.zeros(2, dtype=bool), values)
