"""Fake holes: where they lie, and how recovered detail is judged in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.hole import depth_of
from meshlab_lowrank.mesh.geometry import cotangent_laplacian
from meshlab_lowrank.mesh.topology import boundary_vertices
from meshlab_lowrank.tuning.fake_holes import judge, make_fake_holes
from meshlab_lowrank.tuning.trust import Trust
from tests.builders import hole_of


@pytest.fixture(scope="module")
def hole(sheet):
    """Egg box of 60 x 60 with a hole of radius 7 that is filled flat."""
    points, faces = sheet(70, 60)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    waves = 0.4 * (np.cos(0.7 * x) + np.cos(0.7 * y))
    unknown = np.hypot(x, y) < 7.0
    height = np.where(unknown, 0.0, waves)
    return hole_of(np.column_stack([x, y, height]), faces, unknown)


@pytest.fixture(scope="module")
def fake(hole):
    return make_fake_holes(hole, 0)


def discs(fake):
    return [np.flatnonzero(fake.parts == i) for i in range(fake.parts.max() + 1)]


def test_discs_keep_apart_from_all_that_is_missing(hole, fake):
    assert len(discs(fake)) >= 2
    border = boundary_vertices(hole.faces, len(hole.positions))
    for i, disc in enumerate(discs(fake)):
        assert len(disc) > 20
        others = hole.unknown | border | ((fake.parts >= 0) & (fake.parts != i))
        gaps = fake.truth[disc][:, None] - fake.truth[others]
        assert np.linalg.norm(gaps, axis=2).min() > 1.5


def test_discs_are_missing_and_the_rest_is_as_it_was(hole, fake):
    inside = fake.parts >= 0
    np.testing.assert_array_equal(fake.hole.unknown, hole.unknown | inside)
    assert hole.measured[inside].all()
    assert not fake.hole.measured[inside].any()
    np.testing.assert_array_equal(fake.truth, hole.positions)
    assert fake.hole.positions[~inside].tobytes() == hole.positions[~inside].tobytes()
    assert not fake.hole.normals[~fake.hole.measured].any()
    known = fake.hole.measured
    np.testing.assert_array_equal(fake.hole.normals[known], hole.normals[known])


def test_discs_lie_on_a_smooth_fill(fake):
    assert np.ptp(fake.truth[fake.parts >= 0, 2]) > 1.0
    laplacian = cotangent_laplacian(fake.truth, fake.hole.faces)
    core = depth_of(fake.hole) > 1.5
    bent, smooth = (
        np.linalg.norm((laplacian @ points)[core & (fake.parts >= 0)])
        for points in (fake.truth, fake.hole.positions)
    )
    assert smooth < 0.5 * bent


def test_the_seed_decides_the_places(hole, fake):
    again = make_fake_holes(hole, 0)
    np.testing.assert_array_equal(again.parts, fake.parts)
    np.testing.assert_array_equal(again.hole.positions, fake.hole.positions)
    assert (make_fake_holes(hole, 1).parts != fake.parts).any()


def test_where_there_is_no_room_there_are_none(sheet):
    points, faces = sheet(16, 14)
    unknown = np.linalg.norm(points - points.mean(axis=0), axis=1) < 3.0
    assert make_fake_holes(hole_of(points, faces, unknown), 0) is None


def solved(fake, detail):
    """A state whose discs have the given detail along the normals of its base."""
    normals = fake.hole.base_normals
    true = np.einsum("ij,ij->i", fake.truth - fake.hole.positions, normals)
    positions = fake.hole.positions + detail(true)[:, None] * normals
    return replace(fake.hole, positions=positions)


def test_exact_detail_is_believed(fake):
    trust = judge(fake, replace(fake.hole, positions=fake.truth))
    np.testing.assert_allclose(trust.strength, 1.0)
    assert trust.explained == pytest.approx(1.0)
    assert trust.error == pytest.approx(0.0, abs=1e-12)


def test_noise_is_not_believed(fake):
    chance = np.random.default_rng(0)
    trust = judge(fake, solved(fake, chance.permutation))
    assert trust.strength.max() < 0.3
    assert trust.explained < 0.2
    assert trust.error > 1.0


def test_detail_too_low_to_tell_from_chance_is_not_believed(fake):
    start = fake.hole.positions
    low = replace(fake, truth=start + 0.02 * (fake.truth - start))
    trust = judge(low, replace(fake.hole, positions=low.truth))
    assert trust.strength.max() < 0.1


def test_one_odd_disc_changes_little(fake):
    odd = np.where((fake.parts == 0)[:, None], fake.hole.positions, fake.truth)
    trust = judge(fake, replace(fake.hole, positions=odd))
    assert fake.parts.max() >= 2
    np.testing.assert_allclose(trust.strength, 1.0)
    assert trust.explained == pytest.approx(1.0)


def test_discs_that_disagree_are_believed_less_than_their_median(fake):
    factors = 2.0 + np.arange(fake.parts.max() + 1) % 3
    normals = fake.hole.base_normals
    true = np.einsum("ij,ij->i", fake.truth - fake.hole.positions, normals)
    height = np.where(fake.parts >= 0, factors[fake.parts] * true, 0.0)
    odd = replace(fake.hole, positions=fake.hole.positions + height[:, None] * normals)
    alike = judge(fake, solved(fake, lambda true: np.median(factors) * true))
    assert (judge(fake, odd).strength < 0.95 * alike.strength).all()


@pytest.mark.parametrize("factor", [0.0, -1.0])
def test_no_detail_and_detail_upside_down_are_not_believed(fake, factor):
    trust = judge(fake, solved(fake, lambda true: factor * true))
    np.testing.assert_array_equal(trust.strength, 0.0)
    assert trust.explained == pytest.approx(0.0, abs=1e-9)
    assert trust.error == pytest.approx((1.0 - factor) ** 2, rel=1e-6)


def test_detail_that_is_too_strong_is_scaled_down(fake):
    strong = judge(fake, solved(fake, lambda true: 4.0 * true)).strength
    stronger = judge(fake, solved(fake, lambda true: 8.0 * true)).strength
    assert (strong < 0.5).all()
    np.testing.assert_allclose(stronger, 0.5 * strong, rtol=0.05)


@pytest.mark.parametrize(
    ("strength", "explained", "worthwhile"),
    [
        ([1.0, 0.9, 0.8], 0.9, True),
        ([0.5, 0.1, 0.0], 0.3, True),
        ([0.0, 0.4, 1.0], 0.3, False),
        ([0.3, 0.3, 0.3], 0.1, False),
        ([0.0, 0.0, 0.0], 0.0, False),
    ],
)
def test_little_detail_or_detail_wrong_at_the_rim_is_not_worthwhile(
    strength, explained, worthwhile
):
    assert Trust(np.array(strength), explained, 1.0).worthwhile is worthwhile


def test_strength_is_interpolated_between_depths():
    trust = Trust(np.array([1.0, 0.6, 0.2]), 0.5, 0.5)
    values = trust.at(np.array([0.0, 1.0, 2.0, 3.0, 100.0]))
    np.testing.assert_allclose(values[[0, 1, 3, 4]], [1.0, 1.0, 0.6, 0.2])
    assert 0.6 < values[2] < 1.0


def test_depth_is_the_distance_from_what_is_known(hole):
    depth = depth_of(hole)
    np.testing.assert_array_equal(depth[~hole.unknown], 0.0)
    known, hidden = (hole.positions[mask] for mask in (~hole.unknown, hole.unknown))
    away = np.linalg.norm(hidden[:, None] - known, axis=2).min(axis=1)
    np.testing.assert_allclose(depth[hole.unknown], away)
