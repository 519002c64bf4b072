"""Diffusion by fronts: normals of a repeating pattern come back from the rim inwards."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import pytest

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import normalized, vertex_normals
from meshlab_lowrank.stages.stage2b_patches import Patches
from meshlab_lowrank.stages.stage2b_patches_grid import GridLayer, GridPatches
from meshlab_lowrank.stages.stage3_similar import Sources
from meshlab_lowrank.stages.stage3_similar_masked_distance import MaskedDistance
from meshlab_lowrank.stages.stage4a_complete import Completed
from meshlab_lowrank.stages.stage4a_complete_ridge import RidgeCompletion
from meshlab_lowrank.stages.stage4b_diffuse_fronts import FrontDiffusion, columns_of
from meshlab_lowrank.stages.stage6a_average_at_vertices import AverageAtVertices
from tests.builders import hole_of

WAVELENGTH = 8.0
AVERAGE = AverageAtVertices(corrections=2)


@dataclass(frozen=True)
class Case:
    hole: Hole
    targets: Patches
    sources: Sources
    layer: GridLayer
    truth: np.ndarray

    def diffused(
        self,
        hole=None,
        *,
        passes=3,
        first=True,
        average=AVERAGE,
        complete=None,
        executor=None,
        **settings,
    ):
        """Normals at the vertices after fronts and passes."""
        result = FrontDiffusion(passes=passes, refit_passes=passes, **settings)(
            self.hole if hole is None else hole,
            self.targets,
            self.sources,
            self.layer,
            similar=MaskedDistance(),
            complete=complete or RidgeCompletion(),
            gather=average,
            first=first,
            executor=executor,
        )
        return average(result.hole, result.omega)


def make_case(sheet, height):
    """Sheet with a round hole, filled flat; the base is the plane."""
    flat, faces = sheet(46, 42)
    flat = flat - flat.mean(axis=0)
    truth = np.column_stack([flat[:, :2], height(*flat[:, :2].T)])
    unknown = np.hypot(*flat[:, :2].T) < 6.0
    hole = hole_of(np.where(unknown[:, None], flat, truth), faces, unknown)
    up = np.tile([0.0, 0.0, 1.0], (len(flat), 1))
    hole = replace(hole, base=flat, base_normals=up, wavelength=WAVELENGTH)
    patches = GridPatches()
    layer, radius = patches.layer(hole), patches.radius(hole)
    targets = layer.at(patches.centres(hole))
    similar = MaskedDistance()
    sources = similar.sources(hole, targets, similar.library(hole, layer, radius), radius)
    return Case(hole, targets, sources, layer, vertex_normals(truth, faces))


@pytest.fixture(scope="module")
def egg_box(sheet):
    k = 2.0 * np.pi / WAVELENGTH
    return make_case(sheet, lambda x, y: 0.6 * (np.cos(k * x) + np.cos(k * y)))


@pytest.fixture(scope="module")
def diffused(egg_box):
    return egg_box.diffused(passes=0)


def error(hole, truth):
    """Mean angle in radians between the normals of the hole and the true ones."""
    missing = ~hole.measured
    cosine = np.einsum("ij,ij->i", hole.normals[missing], truth[missing])
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)).mean())


def test_a_repeating_pattern_comes_back(egg_box, diffused):
    flat = replace(egg_box.hole, normals=egg_box.hole.base_normals)
    assert error(diffused, egg_box.truth) < 0.4 * error(flat, egg_box.truth)
    agreed = egg_box.diffused(passes=3)
    assert error(agreed, egg_box.truth) < 0.4 * error(flat, egg_box.truth)


def test_fronts_that_wait_for_the_known_are_better_than_all_at_once(egg_box):
    at_once = egg_box.diffused(passes=0, rings=100, share=0.0)
    assert error(egg_box.diffused(passes=0), egg_box.truth) < error(at_once, egg_box.truth)


def test_passes_of_agreement_mend_bad_normals(egg_box, diffused):
    chance = np.random.default_rng(1)
    noise = chance.normal(0.0, 0.3, egg_box.truth.shape)
    noise[egg_box.hole.measured] = 0.0
    bad = replace(diffused, normals=normalized(diffused.normals + noise))
    mended = egg_box.diffused(bad, passes=2, first=False)
    assert error(mended, egg_box.truth) < 0.6 * error(bad, egg_box.truth)


def test_a_patch_that_fits_badly_has_little_say(egg_box, diffused):
    wrong = egg_box.targets.centres[:, None] % 2 == 0

    def spoil(values, weights, groups, residual):
        """Half of the targets come back upside down; the residual may tell."""
        found = RidgeCompletion()(values, weights, groups)
        rows = [np.flatnonzero((columns.values == value).all(axis=(1, 2)))[0] for value in values]
        bad = wrong[rows]
        values = np.where(bad[..., None], found.values * [-1.0, -1.0, 1.0], found.values)
        return Completed(values, np.where(bad[:, 0], residual, 0.0))

    columns = columns_of(diffused, egg_box.targets)
    ignored, heard = (
        egg_box.diffused(
            diffused,
            passes=1,
            first=False,
            complete=lambda *given, residual=residual: spoil(*given, residual),
        )
        for residual in (0.0, 2.0)
    )
    assert error(heard, egg_box.truth) < 0.5 * error(ignored, egg_box.truth)


def test_every_missing_normal_is_recovered_with_unit_length(egg_box, diffused):
    for solved in (diffused, egg_box.diffused(passes=1)):
        assert (solved.weights > 0).all()
        assert (solved.weights[~egg_box.hole.measured] < 1.0).all()
        np.testing.assert_allclose(np.linalg.norm(solved.normals, axis=1), 1.0)


def test_measured_normals_stay_bit_for_bit(egg_box, diffused):
    hole = egg_box.hole
    before = hole.normals.copy()
    for solved in (diffused, egg_box.diffused(passes=1)):
        np.testing.assert_array_equal(solved.normals[hole.measured], before[hole.measured])
        np.testing.assert_array_equal(solved.weights[hole.measured], 1.0)
        np.testing.assert_array_equal(solved.positions, hole.positions)
    np.testing.assert_array_equal(hole.normals, before)


def test_correcting_the_blur_of_interpolation_keeps_the_amplitude(egg_box, diffused):
    missing = ~egg_box.hole.measured
    truth = egg_box.truth[missing]

    def amplitude(corrections):
        average = AverageAtVertices(corrections=corrections)
        solved = egg_box.diffused(diffused, passes=2, first=False, average=average)
        found = solved.normals[missing]
        return np.einsum("ij,ij->i", found[:, :2], truth[:, :2]).sum() / (truth[:, :2] ** 2).sum()

    assert amplitude(0) + 0.02 < amplitude(2) < 1.0


def test_no_passes_only_read_what_the_fronts_found(egg_box, diffused):
    again = egg_box.diffused(diffused, passes=0, first=False)
    cosine = np.einsum("ij,ij->i", again.normals, diffused.normals)
    assert np.degrees(np.arccos(cosine.clip(-1.0, 1.0))).max() < 4.0


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_change_no_bit(egg_box, threads):
    with ThreadPoolExecutor(threads) as executor:
        parallel = egg_box.diffused(passes=1, executor=executor)
    assert parallel.normals.tobytes() == egg_box.diffused(passes=1).normals.tobytes()


def test_a_plane_stays_a_plane(sheet):
    case = make_case(sheet, lambda x, _: 0.0 * x)
    np.testing.assert_allclose(case.diffused(passes=1).normals, case.truth, atol=1e-6)


def test_what_lies_inside_is_never_read(egg_box):
    hole = egg_box.hole
    chance = np.random.default_rng(0)
    noise = np.where(hole.unknown[:, None], chance.normal(size=hole.positions.shape), 0.0)
    moved = egg_box.diffused(replace(hole, positions=hole.positions + noise))
    np.testing.assert_array_equal(moved.normals, egg_box.diffused().normals)


def test_nothing_known_recovers_nothing(egg_box):
    hole = replace(
        egg_box.hole,
        normals=np.zeros_like(egg_box.hole.normals),
        weights=np.zeros_like(egg_box.hole.weights),
    )
    result = FrontDiffusion()(
        hole,
        egg_box.targets,
        egg_box.sources,
        egg_box.layer,
        similar=MaskedDistance(),
        complete=RidgeCompletion(),
        gather=AVERAGE,
        first=True,
        executor=None,
    )
    assert result is None
