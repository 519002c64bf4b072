"""Singular value thresholding."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.stages.stage3_similar import Groups
from meshlab_lowrank.stages.stage4a_complete_svt import (
    SingularValueThresholding,
    shrink,
    svt_complete,
)


def nuclear(X):
    return np.linalg.svd(X, compute_uv=False).sum()


def low_rank(seed, shape, rank):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(shape[0], rank)) @ rng.normal(size=(rank, shape[1]))


@pytest.mark.parametrize("shape", [(30, 8), (8, 30), (5, 5)])
@pytest.mark.parametrize("tau", [0.1, 0.9, 4.0, 100.0])
def test_shrink_thresholds_singular_values(shape, tau):
    Y = np.random.default_rng(1).normal(size=shape)
    U, s, Vt = np.linalg.svd(Y, full_matrices=False)
    expected = (U * np.maximum(s - tau, 0.0)) @ Vt
    np.testing.assert_allclose(shrink(Y, tau), expected, atol=1e-11)


def test_shrink_minimises_what_defines_the_proximal_operator():
    rng = np.random.default_rng(2)
    Y, tau = rng.normal(size=(20, 6)), 1.5

    def objective(X):
        return tau * nuclear(X) + 0.5 * np.sum((X - Y) ** 2)

    X = shrink(Y, tau)
    for size in (1e-3, 1e-2, 0.1, 1.0):
        for _ in range(20):
            assert objective(X + size * rng.normal(size=Y.shape)) > objective(X)


def test_shrink_and_its_dual_projection_add_up():
    """Moreau: Y - prox(Y) is the projection onto the spectral ball of radius tau."""
    Y, tau = np.random.default_rng(3).normal(size=(20, 6)), 1.5
    X = shrink(Y, tau)
    rest = Y - X
    assert np.linalg.norm(rest, 2) == pytest.approx(tau)
    assert np.sum(rest * X) == pytest.approx(tau * nuclear(X))


def test_a_stack_is_shrunk_matrix_by_matrix():
    stack = np.random.default_rng(4).normal(size=(3, 12, 5))
    expected = np.stack([shrink(Y, 0.7) for Y in stack])
    np.testing.assert_allclose(shrink(stack, 0.7), expected, atol=1e-13)


def test_large_tau_recovers_a_low_rank_matrix_and_the_papers_does_not():
    truth = low_rank(5, (60, 12), 2)
    observed = np.random.default_rng(6).random(truth.shape) < 0.7
    error = {}
    for tau in (0.9, 200.0):
        X = svt_complete(truth[None], observed[None], tau=tau, delta=1.0, niter=5000, tol=1e-6)[0]
        np.testing.assert_allclose(X[observed], truth[observed], atol=1e-3)
        error[tau] = np.linalg.norm((X - truth)[~observed]) / np.linalg.norm(truth[~observed])
    assert error[200.0] < 0.01
    assert error[0.9] > 0.5


def test_the_limit_minimises_its_objective_among_completions():
    truth, tau = low_rank(7, (20, 6), 2), 3.0
    rng = np.random.default_rng(8)
    observed = rng.random(truth.shape) < 0.7
    X = svt_complete(truth[None], observed[None], tau=tau, delta=1.0, niter=20000, tol=1e-9)[0]

    def objective(X):
        return tau * nuclear(X) + 0.5 * np.sum(X**2)

    for size in (1e-2, 0.1, 1.0):
        for _ in range(20):
            change = np.where(observed, 0.0, size * rng.normal(size=X.shape))
            assert objective(X + change) > objective(X)


def test_stop_rule_and_callback():
    truth = np.stack([low_rank(seed, (30, 6), 2) for seed in (9, 10)])
    observed = np.random.default_rng(11).random(truth.shape) < 0.8
    residuals = []
    X = svt_complete(truth, observed, tol=1e-3, callback=lambda r: residuals.append(r.copy()))
    scale = np.linalg.norm(np.where(observed, truth, 0.0), axis=(1, 2))
    assert (residuals[-1] <= 1e-3 * scale).all()
    assert (residuals[-2] > 1e-3 * scale).any()
    left = np.linalg.norm(np.where(observed, X - truth, 0.0), axis=(1, 2))
    np.testing.assert_allclose(left, residuals[-1], rtol=1e-9)
    svt_complete(truth, observed, niter=3, callback=lambda r: residuals.append(r.copy()))
    assert len(residuals[-1]) == 2


def test_matrices_of_a_stack_are_solved_independently():
    truth = np.stack([low_rank(seed, (30, 6), 2) * seed for seed in (1, 2, 3)])
    observed = np.random.default_rng(12).random(truth.shape) < 0.8
    together = svt_complete(truth, observed)
    alone = [svt_complete(truth[i : i + 1], observed[i : i + 1])[0] for i in range(3)]
    np.testing.assert_allclose(together, np.stack(alone), atol=1e-12)


def test_missing_entries_are_never_read():
    truth = low_rank(13, (30, 6), 2)
    observed = np.random.default_rng(14).random(truth.shape) < 0.8
    hidden = np.where(observed, truth, np.nan)
    expected = svt_complete(truth[None], observed[None])
    np.testing.assert_array_equal(svt_complete(hidden[None], observed[None]), expected)


def test_rows_and_matrices_that_nobody_observes_stay_zero():
    truth = low_rank(15, (30, 6), 2)[None]
    observed = np.ones_like(truth, dtype=bool)
    observed[0, 4] = False
    assert not svt_complete(truth, observed)[0, 4].any()
    assert not svt_complete(truth, np.zeros_like(observed)).any()


@pytest.mark.parametrize("missing", [0, 1, 3])
def test_the_stage_completes_what_is_missing_and_keeps_what_is_known(missing):
    chance = np.random.default_rng(3)
    patch = chance.normal(size=(6, 3))
    patch /= np.linalg.norm(patch, axis=1, keepdims=True)
    values, weights = np.tile(patch, (4, 1, 1)), np.ones((4, 6))
    weights[:missing, :2] = 0.0
    groups = Groups(np.tile(patch.ravel(), (4, 7, 1)), None, np.tile(np.arange(7), (4, 1)))
    given = values * (weights > 0.0)[..., None]
    found = SingularValueThresholding(tau=300.0, delta=1.5, niter=5000)(given, weights, groups)
    np.testing.assert_array_equal(found.values[weights > 0.0], values[weights > 0.0])
    np.testing.assert_allclose(found.values, values, atol=0.05)


def test_the_stage_reads_no_normal_that_is_not_observed():
    chance = np.random.default_rng(4)
    columns = chance.normal(size=(2, 5, 18))
    observed = chance.uniform(size=(2, 5, 6)) < 0.7
    spoiled = np.where(np.repeat(observed, 3, axis=2), columns, 9.0)
    values, weights = chance.normal(size=(2, 6, 3)), np.ones((2, 6))
    weights[:, :3] = 0.0
    listed = np.zeros((2, 5), dtype=np.int64)
    one, two = (
        SingularValueThresholding()(values, weights, Groups(given, observed, listed)).values
        for given in (columns, spoiled)
    )
    np.testing.assert_array_equal(one, two)
