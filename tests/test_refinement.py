"""Refinement with the truncated gamma norm."""

from __future__ import annotations

import numpy as np
import pyproximal
import pytest

from meshlab_lowrank.stages.stage5_refine_truncated_gamma import (
    gamma_function,
    leading_signs,
    refine,
    solve_omega,
    solve_w,
    truncated_gamma_norm,
)


def decaying(seed, shape, scale):
    """Matrix with given singular values."""
    rng = np.random.default_rng(seed)
    a = min(shape)
    P, _ = np.linalg.qr(rng.normal(size=(shape[0], a)))
    Q, _ = np.linalg.qr(rng.normal(size=(shape[1], a)))
    return (P * scale) @ Q.T


def test_f_rises_from_zero_and_is_subadditive():
    x = np.linspace(0.0, 5.0, 400)
    for gamma in (0.01, 1.0):
        f = gamma_function(x, gamma)
        assert f[0] == 0.0
        assert (np.diff(f) > 0).all()
        total = gamma_function(x[:, None] + x, gamma)
        assert (total <= f[:, None] + f + 1e-12).all()


def test_truncated_norm_counts_the_values_beyond_the_first_m():
    s = np.array([0.0, 7.0, 0.0, 3.0, 50.0, 9.0])
    assert truncated_gamma_norm(s, 1e-6, 0) == pytest.approx(4.0, abs=1e-5)
    assert truncated_gamma_norm(s, 1e-6, 3) == pytest.approx(1.0, abs=1e-5)
    assert truncated_gamma_norm(s, 1e-6, 9) == 0.0


def test_leading_singular_vectors_attain_the_bound_of_equation_9():
    rng = np.random.default_rng(0)
    omega, m = rng.normal(size=(12, 30)), 3
    P, s, Qt = np.linalg.svd(omega, full_matrices=False)
    bound = s[:m].sum()
    assert np.trace(P[:, :m].T @ omega @ Qt[:m].T) == pytest.approx(bound)
    assert leading_signs(s, m) @ s == pytest.approx(bound)
    for _ in range(20):
        U, _ = np.linalg.qr(rng.normal(size=(12, m)))
        V, _ = np.linalg.qr(rng.normal(size=(30, m)))
        assert np.trace(U.T @ omega @ V) <= bound


def test_leading_signs_follow_size_not_sign():
    np.testing.assert_array_equal(leading_signs(np.array([1.0, -9.0, 3.0, 0.5]), 2), [0, -1, 1, 0])


@pytest.mark.parametrize("gamma", [0.01, 1.0])
@pytest.mark.parametrize("beta", [0.01, 0.5, 20.0])
def test_the_proximal_map_beats_a_dense_grid(beta, gamma):
    a = np.concatenate([np.linspace(0.0, 3.0, 60), np.geomspace(1e-4, 40.0, 60)])
    w = solve_w(a, beta=beta, gamma=gamma)
    grid = np.concatenate([[0.0], np.geomspace(1e-6, 45.0, 20001)])

    def objective(x, a):
        return gamma_function(x, gamma) + 0.5 * beta * (x - a) ** 2

    best = objective(grid[None], a[:, None]).min(axis=1)
    assert (objective(w, a) <= best + 1e-12).all()
    np.testing.assert_array_equal(solve_w(-a, beta=beta, gamma=gamma), -w)


@pytest.mark.parametrize("size", [1e-3, 0.1, 30.0])
def test_the_subproblem_for_omega_is_solved_exactly(size):
    rng = np.random.default_rng(1)
    s, w = size * np.abs(rng.normal(size=(2, 8)))
    z = 0.1 * size * rng.normal(size=8)
    options = {"mu": 0.3, "beta": 0.7, "gamma": 0.01}
    signs = leading_signs(s, 3)
    d = solve_omega(s, w, z, signs, **options)

    def objective(d):
        f = gamma_function(signs @ d, 0.01)
        return -f + 0.15 * np.sum((s - d) ** 2) + 0.35 * np.sum((d - w + z / 0.7) ** 2)

    for step in (1e-4, 1e-2, 1.0):
        for _ in range(30):
            other = d + step * size * rng.normal(size=8)
            if signs @ other >= 0:
                assert objective(other) >= objective(d) - 1e-13


def test_neither_subproblem_raises_the_lagrangian():
    mu, beta, gamma, m = 0.02, 0.05, 0.01, 2
    s = np.array([60.0, 20.0, 12.0, 9.0, 7.0, 3.0, 1.0])

    def lagrangian(d, w, z, signs):
        return (
            gamma_function(np.abs(w), gamma).sum()
            - gamma_function(signs @ d, gamma)
            + 0.5 * mu * np.sum((s - d) ** 2)
            + z @ (d - w)
            + 0.5 * beta * np.sum((d - w) ** 2)
        )

    d, w, z = s, s, np.zeros(7)
    for _ in range(30):
        signs = leading_signs(d, m)
        before = lagrangian(d, w, z, signs)
        d = solve_omega(s, w, z, signs, mu=mu, beta=beta, gamma=gamma)
        between = lagrangian(d, w, z, signs)
        w = solve_w(d + z / beta, beta=beta, gamma=gamma)
        assert between <= before + 1e-12
        assert lagrangian(d, w, z, signs) <= between + 1e-12
        z = z + beta * (d - w)


@pytest.mark.parametrize("shape", [(9, 40), (40, 9)])
def test_the_diagonal_iteration_is_the_iteration_on_matrices(shape):
    """Equations 14 to 16 written out with whole matrices and their own decompositions."""
    mu, beta, gamma, m = 0.05, 0.08, 0.5, 2
    omega = decaying(2, shape, np.array([40, 22, 9, 6.5, 5.5, 4, 2, 1, 0.3]))
    D, W, Z = omega, omega, np.zeros_like(omega)
    for _ in range(60):
        P, _, Qt = np.linalg.svd(D, full_matrices=False)
        UV = P[:, :m] @ Qt[:m]
        linear = (mu * omega + beta * W - Z) / (mu + beta)
        trace = np.sum(UV * D)
        for _ in range(50):  # re-weighting
            D = linear + gamma * (1 + gamma) / (gamma + trace) ** 2 / (mu + beta) * UV
            trace = np.sum(UV * D)
        P, a, Qt = np.linalg.svd(D + Z / beta, full_matrices=False)
        W = (P * solve_w(a, beta=beta, gamma=gamma)) @ Qt
        Z = Z + beta * (D - W)
    result = refine(omega, mu=mu, beta=beta, gamma=gamma, m=m, niter=60, tol=1e-300)
    np.testing.assert_allclose(result, D, atol=1e-9)


def test_with_beta_equal_to_mu_it_drops_what_equation_6_drops():
    s = np.array([40.0, 22.0, 15.0, 14.5, 13.5, 12.0, 6.0, 1.0, 0.0])
    omega = decaying(3, (9, 40), s)
    steps = []
    result = refine(omega, mu=0.01, beta=0.01, gamma=1e-4, m=2, callback=steps.append)
    kept = np.linalg.svd(result, compute_uv=False)
    expected = np.where(s > np.sqrt(2 / 0.01), s, 0.0)
    np.testing.assert_allclose(np.sort(kept)[::-1], expected, atol=1e-3)
    np.testing.assert_allclose(np.sort(steps[-1])[::-1], expected, atol=1e-3)


def test_noise_on_a_low_rank_matrix_gets_less():
    rng = np.random.default_rng(4)
    truth = rng.normal(size=(90, 3)) @ rng.normal(size=(3, 200))
    noisy = truth + 0.3 * rng.normal(size=truth.shape)
    threshold = 0.3 * (np.sqrt(90) + np.sqrt(200)) * 1.1
    result = refine(noisy, mu=2 / threshold**2, beta=2 / threshold**2)
    assert np.linalg.matrix_rank(result, tol=1e-6) == 3
    assert np.linalg.norm(result - truth) < 0.4 * np.linalg.norm(noisy - truth)


def test_a_zero_matrix_stays_zero():
    assert not refine(np.zeros((6, 10)), mu=0.01, beta=0.01).any()


@pytest.mark.parametrize("beta", [0.01, 0.3, 5.0])
@pytest.mark.parametrize("gamma", [0.01, 0.2, 1.0])
def test_eq_15_is_the_proximal_map_of_gemans_penalty(beta, gamma):
    # f is Geman's sigma x / (gamma + x) with sigma = 1 + gamma; Eq. 15 is its map with tau 1/beta.
    geman = pyproximal.Geman(sigma=1.0 + gamma, gamma=gamma)
    a = np.random.default_rng(1).normal(0.0, 3.0 * np.sqrt(2.0 / beta), 2000)
    ours, theirs = solve_w(a, beta=beta, gamma=gamma), geman.prox(a, 1.0 / beta)

    def objective(x):
        return geman.elementwise(x) + 0.5 * beta * (x - a) ** 2

    np.testing.assert_array_less(objective(ours), objective(theirs) + 1e-9)
    tie = np.abs(objective(ours) - 0.5 * beta * a**2) < 1e-9 * (1.0 + 0.5 * beta * a**2)
    assert np.mean(ours[~tie] != 0.0) > 0.5
    np.testing.assert_allclose(ours[~tie], theirs[~tie], rtol=1e-6, atol=1e-7)
