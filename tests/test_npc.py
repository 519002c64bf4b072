"""Normal patch covariance, its distance, and the packing of similar patches."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.stages.stage3_similar import Columns, PatchLibrary, Sources
from meshlab_lowrank.stages.stage3_similar_normal_patch_covariance import (
    NormalPatchCovariance,
    most_similar,
    normal_patch_covariance,
    npc_distance,
)
from meshlab_lowrank.stages.stage5_refine_truncated_gamma import global_matrix

NOTHING = Sources(PatchLibrary(np.zeros((0, 60), dtype=np.float32), np.zeros((0, 3))))


@pytest.fixture
def values():
    rng = np.random.default_rng(0)
    values = rng.normal(size=(12, 20, 3)) * [0.3, 0.2, 0.1] + [0, 0, 1.0]
    values /= np.linalg.norm(values, axis=2, keepdims=True)
    values[rng.random((12, 20)) < 0.3] = 0.0
    return values


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def all_distances(values):
    npc = normal_patch_covariance(values)
    return npc_distance(*npc, *npc)


def test_covariance_follows_equation_1(values):
    means, covariances = normal_patch_covariance(values)
    for patch, mean, covariance in zip(values, means, covariances, strict=True):
        np.testing.assert_allclose(mean, patch.sum(axis=0) / 20, atol=1e-15)
        expected = sum(np.outer(n - mean, n - mean) for n in patch) / 20
        np.testing.assert_allclose(covariance, expected, atol=1e-15)


def test_distance_follows_equation_2(values):
    means, covariances = normal_patch_covariance(values)
    distance = npc_distance(means[:5], covariances[:5], means, covariances)
    for i in range(5):
        for j in range(12):
            d = means[i] - means[j]
            expected = np.sqrt(d @ np.linalg.inv(covariances[i] + covariances[j]) @ d)
            assert distance[i, j] == pytest.approx(expected, rel=1e-8)


def test_distance_is_symmetric_and_zero_to_itself(values):
    distance = all_distances(values)
    np.testing.assert_allclose(distance, distance.T, rtol=1e-12)
    assert not np.diag(distance).any()


def test_distance_does_not_depend_on_common_rotation_or_order(values):
    distance = all_distances(values)
    np.testing.assert_allclose(all_distances(values @ rotation(1)), distance, rtol=1e-8)
    np.testing.assert_allclose(all_distances(values[:, ::-1]), distance, rtol=1e-8)


def test_planar_patches_are_equal_or_infinitely_far_apart():
    flat = np.zeros((3, 10, 3))
    flat[:2, :, 2] = 1.0
    flat[2, :, 1] = 1.0
    distance = all_distances(flat)
    np.testing.assert_array_equal(distance[:2, :2], 0.0)
    assert np.isinf(distance[:2, 2]).all()


def test_equal_means_are_at_distance_zero_whatever_the_covariances():
    patches = np.zeros((2, 2, 3))
    patches[0] = [[0.6, 0, 0.8], [-0.6, 0, 0.8]]
    patches[1] = [[0, 0.6, 0.8], [0, -0.6, 0.8]]
    np.testing.assert_array_equal(all_distances(patches), 0.0)


def test_singular_covariances_measure_along_the_cylinder():
    angle = np.linspace(0.0, 1.0, 9)
    bent = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    turned = np.stack([np.sin(angle + 0.2), 0 * angle, np.cos(angle + 0.2)], axis=1)
    npc = normal_patch_covariance(np.stack([bent, turned]))
    d = (npc[0][0] - npc[0][1])[[0, 2]]
    plane = (npc[1][0] + npc[1][1])[np.ix_([0, 2], [0, 2])]
    assert npc_distance(*npc, *npc)[0, 1] == pytest.approx(
        np.sqrt(d @ np.linalg.inv(plane) @ d), rel=1e-6
    )


def test_most_similar_are_the_nearest_others(values):
    npc = normal_patch_covariance(values)
    distance = all_distances(values)
    targets = np.array([3, 7, 0])
    chosen = most_similar(*npc, targets, 4)
    for target, row in zip(targets, chosen, strict=True):
        others = np.delete(np.arange(12), target)
        nearest = others[np.argsort(distance[target, others])]
        np.testing.assert_array_equal(row, nearest[:4])
    assert most_similar(*npc, targets, 40).shape == (3, 11)


def test_identical_planar_patches_find_one_another():
    flat = np.zeros((5, 6, 3))
    flat[[0, 2, 4], :, 2] = 1.0
    flat[[1, 3], :, 0] = 1.0
    chosen = most_similar(*normal_patch_covariance(flat), np.arange(5), 2)
    np.testing.assert_array_equal(chosen, [[2, 4], [3, 0], [0, 4], [1, 0], [0, 2]])


def test_matrices_are_packed_as_in_figures_7_and_8(values):
    omega = global_matrix(values)
    assert omega.shape == (60, 12)
    np.testing.assert_array_equal(omega[3:6, 2], values[2, 1])
    mask = values.any(axis=2)
    search = NormalPatchCovariance(k=2).search(Columns(values, mask.astype(float)), NOTHING)
    groups = search(np.array([5, 1]))
    means, covariances = normal_patch_covariance(values)
    nearest = most_similar(means, covariances, np.array([5, 1]), 2)
    assert groups.columns.shape == (2, 2, 60)
    np.testing.assert_array_equal(groups.columns[0], omega[:, nearest[0]].T)
    np.testing.assert_array_equal(groups.observed[1], mask[nearest[1]])
