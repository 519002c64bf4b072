"""Diffusion by fronts: normals of a repeating pattern come back from the rim inwards."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.grid_solver import GridSettings, library_of, target_centres
from meshlab_lowrank.hole import start_state
from meshlab_lowrank.mesh.geometry import normalized, vertex_normals
from meshlab_lowrank.stages import stage4_diffuse_fronts as stage4_front_diffusion
from meshlab_lowrank.stages.stage2_patches_grid import SurfaceLocator, grid_patches
from meshlab_lowrank.stages.stage4_diffuse_fronts import Completion, agree, diffuse

SETTINGS = GridSettings(wavelength=8.0)


def make_case(sheet, height):
    """Sheet with a round hole, filled flat; the base is the plane."""
    flat, faces = sheet(46, 42)
    flat = flat - flat.mean(axis=0)
    truth = np.column_stack([flat[:, :2], height(*flat[:, :2].T)])
    unknown = np.hypot(*flat[:, :2].T) < 6.0
    state = start_state(np.where(unknown[:, None], flat, truth), faces, unknown)
    up = np.tile([0.0, 0.0, 1.0], (len(flat), 1))
    state = replace(state, base=flat, base_normals=up)
    grid = SETTINGS.grid()
    locator = SurfaceLocator(flat, faces)
    distance = np.linalg.norm(grid.offsets, axis=1) / SETTINGS.patch_radius
    completion = Completion(
        targets=grid_patches(locator, flat, up, target_centres(state, SETTINGS), grid),
        falloff=np.exp(-((distance / SETTINGS.falloff) ** 2)),
        library=library_of(state, SETTINGS, grid, locator),
        k=SETTINGS.k,
        rank=SETTINGS.rank,
        ridge=SETTINGS.ridge,
    )
    return state, completion, vertex_normals(truth, faces)


@pytest.fixture(scope="module")
def egg_box(sheet):
    k = 2.0 * np.pi / SETTINGS.wavelength
    return make_case(sheet, lambda x, y: 0.6 * (np.cos(k * x) + np.cos(k * y)))


@pytest.fixture(scope="module")
def diffused(egg_box):
    state, completion, _ = egg_box
    return diffuse(state, completion)


def error(state, truth):
    """Mean angle in radians between the normals of the hole and the true ones."""
    missing = ~state.measured
    cosine = np.einsum("ij,ij->i", state.normals[missing], truth[missing])
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)).mean())


def test_a_repeating_pattern_comes_back(egg_box, diffused):
    state, completion, truth = egg_box
    flat = replace(state, normals=state.base_normals)
    assert error(diffused, truth) < 0.4 * error(flat, truth)
    agreed = agree(diffused, completion, 3)
    assert error(agreed, truth) < 0.4 * error(flat, truth)


def test_passes_of_agreement_mend_bad_normals(egg_box, diffused):
    state, completion, truth = egg_box
    chance = np.random.default_rng(1)
    noise = np.where(state.measured[:, None], 0.0, chance.normal(0.0, 0.3, truth.shape))
    bad = replace(diffused, normals=normalized(diffused.normals + noise))
    assert error(agree(bad, completion, 2), truth) < 0.6 * error(bad, truth)


def test_every_missing_normal_is_recovered_with_unit_length(egg_box, diffused):
    state, completion, _ = egg_box
    for solved in (diffused, agree(diffused, completion, 1)):
        assert (solved.weights > 0).all()
        assert (solved.weights[~state.measured] < 1.0).all()
        np.testing.assert_allclose(np.linalg.norm(solved.normals, axis=1), 1.0)


def test_measured_normals_stay_bit_for_bit(egg_box, diffused):
    state, completion, _ = egg_box
    before = state.normals.copy()
    for solved in (diffused, agree(diffused, completion, 1)):
        np.testing.assert_array_equal(solved.normals[state.measured], before[state.measured])
        np.testing.assert_array_equal(solved.weights[state.measured], 1.0)
        np.testing.assert_array_equal(solved.positions, state.positions)
    np.testing.assert_array_equal(state.normals, before)


def test_correcting_the_blur_of_interpolation_keeps_the_amplitude(egg_box, diffused, monkeypatch):
    state, completion, truth = egg_box
    missing = ~state.measured

    def amplitude():
        found = agree(diffused, completion, 2).normals[missing]
        lean = np.einsum("ij,ij->i", found[:, :2], truth[missing, :2])
        return lean.sum() / (truth[missing, :2] ** 2).sum()

    corrected = amplitude()
    monkeypatch.setattr(stage4_front_diffusion, "_DEBLUR", 0)
    assert amplitude() + 0.02 < corrected < 1.0


def test_no_passes_change_nothing(egg_box, diffused):
    _, completion, _ = egg_box
    np.testing.assert_array_equal(agree(diffused, completion, 0).normals, diffused.normals)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_change_no_bit(egg_box, diffused, threads):
    state, completion, _ = egg_box
    with ThreadPoolExecutor(threads) as executor:
        parallel = diffuse(state, replace(completion, executor=executor))
    assert parallel.normals.tobytes() == diffused.normals.tobytes()


def test_a_plane_stays_a_plane(sheet):
    state, completion, truth = make_case(sheet, lambda x, _: 0.0 * x)
    solved = agree(diffuse(state, completion), completion, 1)
    np.testing.assert_allclose(solved.normals, truth, atol=1e-6)


def test_what_lies_inside_is_never_read(egg_box, diffused):
    state, completion, _ = egg_box
    chance = np.random.default_rng(0)
    noise = np.where(state.unknown[:, None], chance.normal(size=state.positions.shape), 0.0)
    moved = replace(state, positions=state.positions + noise)
    np.testing.assert_array_equal(diffuse(moved, completion).normals, diffused.normals)


def test_nothing_missing_is_left_alone(egg_box):
    state, completion, truth = egg_box
    whole = replace(state, normals=truth, weights=np.ones(len(truth)))
    assert diffuse(whole, completion) is whole
