"""What fake holes, and the fill itself, tell of recovered detail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.tuning.conflict import conflict
from meshlab_lowrank.tuning.fake_holes import make_fake_holes
from meshlab_lowrank.tuning.judging import FakeHoleEvidence, Part, judge
from meshlab_lowrank.tuning.trust import Trust
from tests.builders import hole_of


@pytest.fixture(scope="module")
def fake(sheet):
    """Egg box of 60 x 60 with a hole of radius 7 that is filled flat."""
    points, faces = sheet(70, 60)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    unknown = np.hypot(x, y) < 7.0
    height = np.where(unknown, 0.0, 0.4 * (np.cos(0.7 * x) + np.cos(0.7 * y)))
    return make_fake_holes(hole_of(np.column_stack([x, y, height]), faces, unknown), 0)


def at_heights(fake, detail):
    """A state whose parts have the given detail along the normals of its base, and its normals."""
    normals = fake.hole.base_normals
    true = np.einsum("ij,ij->i", fake.truth - fake.hole.positions, normals)
    height = np.where(fake.parts >= 0, detail(true), 0.0)
    positions = fake.hole.positions + height[:, None] * normals
    recovered = vertex_normals(positions, fake.hole.faces)
    weights = np.where(fake.hole.measured, 1.0, 0.3)
    return replace(fake.hole, positions=positions, normals=recovered, weights=weights)


def evidence(*parts):
    """Parts given as their conflict, agreement and slope."""
    three = np.ones(3)
    return FakeHoleEvidence(
        tuple(
            Part(each, agreement, slope * three, three, 50.0 * three, 1.0 - agreement**2, 1.0)
            for each, agreement, slope in parts
        )
    )


def test_exact_detail_is_believed(fake):
    found = judge(fake, at_heights(fake, lambda true: true))
    trust = found.trust(0.0)
    np.testing.assert_allclose(trust.strength, 1.0)
    assert trust.explained > 0.95
    assert trust.worthwhile
    assert found.promising
    assert found.error == pytest.approx(0.0, abs=1e-9)


def test_what_is_left_is_told_by_depth(fake):
    exact, none, wrong = (
        judge(fake, at_heights(fake, lambda true, factor=factor: factor * true))
        for factor in (1.0, 0.0, -1.0)
    )
    for found, left, whole in ((exact, 0.0, 0.0), (none, 0.5, 0.5), (wrong, 0.5, 2.0)):
        trust = replace(found, asking=False).trust(0.0)
        np.testing.assert_allclose(trust.left, left, atol=0.06)  # half of what trials leave
        np.testing.assert_allclose(trust.left_by_whole, whole, atol=0.15)
    depths = np.array([0.0, 6.0, 12.0, 30.0])
    trust = Trust(np.ones(3), 0.8, np.array([0.1, 0.2, 0.3]), np.array([0.2, 0.3, 1.4]))
    np.testing.assert_allclose(trust.missed(depths, whole=False), [0.1, 0.3, 0.6, 1.0])
    np.testing.assert_allclose(trust.missed(depths, whole=True), [0.2, 1.4, 1.4, 1.4])


def test_noise_is_not_believed(fake):
    chance = np.random.default_rng(0)
    found = judge(fake, at_heights(fake, chance.permutation))
    assert found.error > 1.0
    assert not found.trust(found.parts[0].conflict).worthwhile


def test_detail_too_low_to_tell_from_chance_is_not_believed(fake):
    start = fake.hole.positions
    low = replace(fake, truth=start + 0.02 * (fake.truth - start))
    found = judge(low, at_heights(low, lambda true: true))
    assert max(part.agreement for part in found.parts) < 0.1


@pytest.mark.parametrize("factor", [0.0, -1.0])
def test_no_detail_and_detail_upside_down_are_not_believed(fake, factor):
    found = judge(fake, at_heights(fake, lambda true: factor * true))
    assert max(part.agreement for part in found.parts) <= 1e-9
    assert found.error == pytest.approx((1.0 - factor) ** 2, rel=1e-6)
    assert not found.trust(found.parts[0].conflict).worthwhile


def test_detail_that_is_too_strong_is_scaled_down(fake):
    strong = judge(fake, at_heights(fake, lambda true: 4.0 * true))
    assert all((part.product / part.square < 0.3).all() for part in strong.parts)
    assert (strong.trust(strong.parts[0].conflict).strength < 0.8).all()


def test_parts_whose_conflict_is_like_that_of_the_hole_decide():
    found = evidence((0.02, 0.9, 1.0), (0.03, 0.9, 1.0), (0.6, -0.5, 0.0), (0.9, -0.5, 0.0))
    assert found.trust(0.02).worthwhile
    np.testing.assert_allclose(found.trust(0.02).strength, 1.0)
    assert not found.trust(0.7).worthwhile
    deaf = replace(found, asking=False)
    assert deaf.trust(0.02).explained == deaf.trust(0.7).explained < 0.25


def test_detail_that_was_wrong_nearby_is_not_believed_for_a_fit_alone():
    assert not evidence(*[(0.05, 0.1, 0.2)] * 6).trust(0.05).worthwhile
    assert evidence(*[(0.05, 0.8, 0.9)] * 6).trust(0.05).worthwhile


def test_more_conflict_means_less_trust():
    found = evidence((0.1, 0.6, 0.7))
    trusts = [found.trust(each).explained for each in (0.001, 0.1, 0.3, 1.0, 10.0)]
    assert trusts[0] > trusts[2] > trusts[3] > trusts[4]


def test_nothing_is_tried_where_no_likely_conflict_would_make_it_worthwhile():
    assert not evidence((0.5, -0.3, 0.0), (0.8, 0.1, 0.1)).promising
    assert evidence((0.5, -0.3, 0.0), (0.1, 0.8, 0.9)).promising


def test_parts_in_conflict_count_little_for_the_choice_of_a_length():
    assert evidence((0.01, 0.9, 1.0), (3.0, 0.0, 0.0)).error < 0.25
    assert evidence((0.01, 0.9, 1.0), (0.01, 0.0, 0.0)).error > 0.5


def test_normals_that_the_surface_has_are_no_conflict(fake):
    inside = fake.parts >= 0
    good = at_heights(fake, lambda true: true)
    assert conflict(good, inside) < 1e-9
    assert conflict(good, np.zeros_like(inside)) == 1.0
    forgotten = replace(good, weights=good.measured.astype(float))
    assert conflict(forgotten, inside) == 1.0


def test_normals_that_no_surface_within_the_rim_has_are_a_conflict(fake):
    inside = fake.parts >= 0
    good = at_heights(fake, lambda true: true)
    flat = replace(good, positions=fake.hole.positions)
    some = replace(good, positions=0.5 * (good.positions + fake.hole.positions))
    assert conflict(flat, inside) > 0.5
    assert conflict(good, inside) < conflict(some, inside) < conflict(flat, inside)


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
    assert Trust(np.array(strength), explained).worthwhile is worthwhile


def test_strength_is_interpolated_between_depths():
    trust = Trust(np.array([1.0, 0.6, 0.2]), 0.5)
    values = trust.at(np.array([0.0, 1.0, 2.0, 3.0, 100.0]))
    np.testing.assert_allclose(values[[0, 1, 3, 4]], [1.0, 1.0, 0.6, 0.2])
    assert 0.6 < values[2] < 1.0
