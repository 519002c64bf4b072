"""The library of turned patches and the search in it, against plain loops."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from meshlab_lowrank.batches import run_batches
from meshlab_lowrank.mesh.geometry import normalized, vertex_normals
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.stages.stage2a_frames_base import BaseFrames
from meshlab_lowrank.stages.stage2b_patches import normals_in
from meshlab_lowrank.stages.stage2b_patches_grid import GridLayer, GridPatches, hexagonal_grid
from meshlab_lowrank.stages.stage3_similar import PatchLibrary
from meshlab_lowrank.stages.stage3_similar_masked_distance import (
    MaskedDistance,
    largest,
    similar_patches,
    turned_patches,
)
from sample_meshes.shapes import make_shape
from tests.builders import hole_of


@pytest.fixture(scope="module")
def random_patches():
    """Library of 300 patches of 37 unit normals, and 40 targets that are partly missing."""
    chance = np.random.default_rng(4)
    sources = normalized(chance.normal(size=(300, 37, 3)))
    targets = normalized(chance.normal(size=(40, 37, 3)))
    weights = chance.uniform(size=(40, 37)) * (chance.uniform(size=(40, 37)) < 0.6)
    targets[weights == 0] = 0.0
    library = PatchLibrary(sources.reshape(300, -1).astype(np.float32), np.zeros((300, 3)))
    return sources, library, targets, weights


def test_the_distance_is_that_of_a_plain_loop(random_patches):
    sources, library, targets, weights = random_patches
    found = similar_patches(targets, weights, library, 7)
    assert found.shape == (40, 7)
    for target, weight, row in zip(targets, weights, found, strict=True):
        squares = ((sources - target) ** 2).sum(axis=2)
        distance = (weight * squares).sum(axis=1) / weight.sum()
        np.testing.assert_allclose(distance[row], np.sort(distance)[:7], atol=1e-5)


def test_a_patch_of_the_library_is_found_from_its_known_part(random_patches):
    sources, library, _, weights = random_patches
    wanted = np.arange(0, 200, 5)
    targets = sources[wanted] * (weights > 0)[..., None]
    np.testing.assert_array_equal(similar_patches(targets, weights, library, 3)[:, 0], wanted)


def test_a_small_library_gives_all_it_has(random_patches):
    _, library, targets, weights = random_patches
    few = PatchLibrary(library.rows[:4], library.places[:4])
    assert len(few) == 4
    found = similar_patches(targets, weights, few, 10)
    np.testing.assert_array_equal(np.sort(found, axis=1), np.tile(np.arange(4), (40, 1)))


def test_barred_patches_are_not_taken(random_patches):
    _, library, targets, weights = random_patches
    first = similar_patches(targets, weights, library, 9)
    barred = np.zeros((len(targets), len(library)), dtype=np.bool_)
    np.put_along_axis(barred, first[:, [0, 2]], values=True, axis=1)
    found = similar_patches(targets, weights, library, 7, barred=barred)
    np.testing.assert_array_equal(found, np.delete(first, [0, 2], axis=1))


def test_turned_patches_are_patches_of_a_turned_grid():
    vertices, faces = make_shape("torus", "bumps", count=3000, seed=3)
    normals = vertex_normals(vertices, faces)
    grid = hexagonal_grid(4.0, 1.0)
    layer = GridLayer(
        hole_of(vertices, faces, np.zeros(len(vertices), bool)), grid, 4.0, BaseFrames()
    )
    centres = np.arange(0, len(vertices), 40)
    known = np.ones(len(vertices), dtype=bool)

    def values(angle):
        return normals_in(layer.at(centres, angle), normals, known)[0]

    turned = turned_patches(values(0.0), grid.turns).reshape(6, len(centres), grid.size, 3)
    for number in range(6):
        np.testing.assert_allclose(turned[number], values(number * np.pi / 3.0), atol=1e-5)


def test_a_whole_turn_changes_nothing():
    grid = hexagonal_grid(3.0, 1.0)
    values = normalized(np.random.default_rng(0).normal(size=(5, grid.size, 3)))
    turned = turned_patches(values, grid.turns)
    assert turned.dtype == np.float32
    np.testing.assert_array_equal(turned[:5], values.reshape(5, -1).astype(np.float32))
    one = turned[5:10].reshape(5, grid.size, 3).astype(np.float64)
    for _ in range(5):
        one = turned_patches(one, grid.turns)[5:10].reshape(5, grid.size, 3).astype(np.float64)
    np.testing.assert_allclose(one, values, atol=1e-6)


@pytest.mark.parametrize("count", [0, 1, 255, 256, 257, 1000])
def test_batches_cover_everything_once(count):
    parts = run_batches(lambda part: np.arange(count)[part], count, 256, None)
    assert all(len(part) <= 256 for part in parts)
    np.testing.assert_array_equal(np.concatenate([[], *parts]), np.arange(count))


def test_threads_keep_the_order():
    with ThreadPoolExecutor(2) as executor:
        parallel = run_batches(lambda part: part.start, 5000, 16, executor)
    assert parallel == run_batches(lambda part: part.start, 5000, 16, None)
    assert parallel == sorted(parallel)


@pytest.fixture(scope="module")
def wide(sheet):
    """A wide wavy sheet with a hole in its middle."""
    points, faces = sheet(64, 56)
    points = points - points.mean(axis=0)
    points[:, 2] = 0.3 * np.cos(points[:, 0])
    unknown = np.hypot(*points[:, :2].T) < 4.0
    return replace(hole_of(points, faces, unknown), wavelength=5.0)


def test_the_library_keeps_off_what_is_missing_and_prefers_what_is_near(wide):
    patches = GridPatches()
    layer, radius = patches.layer(wide), patches.radius(wide)
    few = MaskedDistance(patches=200, angles=0).library(wide, layer, radius)
    all_ = MaskedDistance(patches=10**6, angles=0).library(wide, layer, radius)
    assert 150 < len(few) <= 200 < 0.2 * len(all_)
    for library in (few, all_):
        away = cKDTree(wide.base[~wide.measured]).query(library.places)[0]
        assert away.min() > 0.9 * radius
    far_few, far_all = (np.hypot(*library.places[:, :2].T) for library in (few, all_))
    assert np.median(far_few) < 0.75 * np.median(far_all)
    assert far_few.max() > 0.8 * far_all.max()  # but not only what is near


def test_the_seed_draws_the_library(wide):
    patches = GridPatches()
    layer, radius = patches.layer(wide), patches.radius(wide)
    one, again, other = (
        MaskedDistance(patches=100, angles=0, seed=seed).library(wide, layer, radius)
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.rows, again.rows)
    assert one.places.shape == other.places.shape
    assert (one.places != other.places).any()


def test_every_turn_of_the_library_is_a_patch_laid_at_that_angle(wide):
    patches = GridPatches()
    layer, radius = patches.layer(wide), patches.radius(wide)
    library = MaskedDistance(patches=20, angles=2).library(wide, layer, radius)
    rows = library.rows.reshape(2, 6, -1, layer.size, 3)
    centres = cKDTree(wide.base).query(library.places[: rows.shape[2]])[1]
    for index in range(2):
        for turn in range(6):
            angle = (turn + 0.5 * index) * np.pi / 3.0
            expected, _ = normals_in(layer.at(centres, angle), wide.normals, wide.measured)
            error = np.linalg.norm(rows[index, turn] - expected, axis=2)
            assert np.median(error) < 1e-5


@pytest.mark.parametrize("width", [50, 640, 6400, 6437])
@pytest.mark.parametrize("k", [1, 8, 48])
def test_the_largest_are_found_block_by_block(width, k):
    chance = np.random.default_rng(width + k)
    values = chance.normal(size=(7, width)).astype(np.float32)
    values[0] = np.round(values[0])  # many are equal
    values[1, 40:] = -np.inf  # as barred ones are
    found = largest(values, k)
    assert found.shape == (7, k)
    for row, places in zip(values, found, strict=True):
        assert len(np.unique(places)) == k
        assert sorted(row[places]) == sorted(row)[-k:]


def test_a_finer_surface_is_searched_more_densely():
    once = replace(AUTO, similar=MaskedDistance(patches=50)).for_finer()
    assert once.similar.patches == 75
    assert once.passes == 1
