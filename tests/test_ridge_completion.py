"""Ridge completion: what it gives back exactly, and that it is a projection on singular vectors."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.mesh.geometry import normalized
from meshlab_lowrank.stages.stage3_similar import Groups
from meshlab_lowrank.stages.stage4a_complete_mean import GroupMean
from meshlab_lowrank.stages.stage4a_complete_ridge import ridge_completion

SP = 30
UPRIGHT = (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def groups():
    """20 groups of 8 patches near to an upright one."""
    chance = np.random.default_rng(2)
    members = normalized(chance.normal(UPRIGHT, 0.4, (20, 8, SP, 3)))
    return members.reshape(20, 8, 3 * SP)


@pytest.fixture(scope="module")
def weights():
    chance = np.random.default_rng(3)
    return chance.uniform(0.3, 1.0, (20, SP)) * (chance.uniform(size=(20, SP)) < 0.6)


def test_a_member_of_the_group_comes_back_whole(groups, weights):
    truth = groups[:, 5].reshape(20, SP, 3)
    values = truth * (weights > 0)[..., None]
    found = ridge_completion(values, weights, groups, rank=7, ridge=1e-10)
    completed, residual = found.values, found.residual
    np.testing.assert_allclose(completed, truth, atol=1e-5)
    np.testing.assert_allclose(residual, 0.0, atol=1e-9)


@pytest.mark.parametrize("rank", [1, 3, 6])
def test_it_projects_on_the_leading_singular_vectors(groups, rank):
    chance = np.random.default_rng(5)
    values = normalized(chance.normal(UPRIGHT, 0.4, (20, SP, 3)))
    completed = ridge_completion(values, np.ones((20, SP)), groups, rank=rank, ridge=0.0).values
    for group, value, found in zip(groups, values, completed, strict=True):
        mean = group.mean(axis=0)
        _, _, right = np.linalg.svd(group - mean)
        leading = right[:rank]
        expected = mean + leading.T @ (leading @ (value.ravel() - mean))
        np.testing.assert_allclose(found, normalized(expected.reshape(SP, 3)), atol=1e-8)


def test_it_solves_the_ridge_regression(groups, weights):
    chance = np.random.default_rng(6)
    values = normalized(chance.normal(UPRIGHT, 0.4, (20, SP, 3)))
    completed = ridge_completion(values, weights, groups, rank=4, ridge=0.05).values
    for group, value, weight, found in zip(groups, values, weights, completed, strict=True):
        mean = group.mean(axis=0)
        _, singular, right = np.linalg.svd(group - mean)
        # the same as least squares with the penalty as further rows
        root = np.sqrt(np.repeat(weight, 3))
        rows = np.concatenate([root[:, None] * right[:4].T, np.diag(singular[0] / singular[:4])])
        rows[-4:] *= np.sqrt(0.05)
        right_side = np.concatenate([root * (value.ravel() - mean), np.zeros(4)])
        c = np.linalg.lstsq(rows, right_side, rcond=None)[0]
        expected = normalized((mean + c @ right[:4]).reshape(SP, 3))
        np.testing.assert_allclose(found, expected, atol=1e-8)


def test_missing_samples_are_never_read(groups, weights):
    values = groups[:, 2].reshape(20, SP, 3) * (weights > 0)[..., None]
    other = np.where((weights > 0)[..., None], values, 7.0)
    one = ridge_completion(values, weights, groups, rank=5, ridge=0.01)
    two = ridge_completion(other, weights, groups, rank=5, ridge=0.01)
    np.testing.assert_allclose(one.values, two.values, atol=1e-12)
    np.testing.assert_allclose(one.residual, two.residual, atol=1e-12)


def test_the_residual_is_the_weighted_mean_squared_distance(groups, weights):
    values = groups[:, 0].reshape(20, SP, 3) * (weights > 0)[..., None]
    found = ridge_completion(values, weights, groups[:, 1:], rank=3, ridge=0.01)
    completed, residual = found.values, found.residual
    squares = ((completed - values) ** 2).sum(axis=2)
    np.testing.assert_allclose(residual, (weights * squares).sum(axis=1) / weights.sum(axis=1))


def test_a_strong_ridge_gives_the_mean(groups, weights):
    values = groups[:, 0].reshape(20, SP, 3) * (weights > 0)[..., None]
    completed = ridge_completion(values, weights, groups, rank=6, ridge=1e9).values
    mean = normalized(groups.mean(axis=1).reshape(20, SP, 3))
    np.testing.assert_allclose(completed, mean, atol=1e-6)


@pytest.mark.parametrize("size", [1, 2, 8])
def test_groups_of_equal_patches_give_that_patch(groups, weights, size):
    same = np.repeat(groups[:, :1], size, axis=1)
    completed = ridge_completion(np.zeros((20, SP, 3)), weights, same, rank=6, ridge=0.01).values
    np.testing.assert_allclose(completed, groups[:, 0].reshape(20, SP, 3), atol=1e-9)


def test_normals_have_unit_length(groups, weights):
    values = groups[:, 1].reshape(20, SP, 3) * (weights > 0)[..., None]
    completed = ridge_completion(values, weights, groups, rank=6, ridge=0.01).values
    np.testing.assert_allclose(np.linalg.norm(completed, axis=2), 1.0)


def test_the_mean_of_a_group_is_completion_of_rank_0(groups, weights):
    found = GroupMean()(np.zeros((20, SP, 3)), weights, Groups(groups, None, np.zeros((20, 8))))
    expected = normalized(groups.mean(axis=1).reshape(20, SP, 3))
    np.testing.assert_allclose(found.values, expected, atol=1e-12)
