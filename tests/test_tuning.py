"""Tuning by fake holes: which length is chosen, and what is believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.hole import with_missing
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.stages.stage1e_base_low_pass import LowPassBase
from meshlab_lowrank.stages.stage2b_patches_grid import GridPatches
from meshlab_lowrank.tuning import tune_by_fake_holes
from meshlab_lowrank.tuning.fake_holes import make_fake_holes
from meshlab_lowrank.tuning.tune import UNSEEN, Look
from meshlab_lowrank.tuning.tune_by_fake_holes import FakeHoleTuning
from tests.builders import hole_of


@pytest.fixture(scope="module")
def hole(sheet):
    points, faces = sheet(70, 60)
    x, y = (points - points.mean(axis=0))[:, :2].T
    unknown = np.hypot(x, y) < 7.0
    height = np.where(unknown, 0.0, 0.4 * (np.cos(0.7 * x) + np.cos(0.7 * y)))
    return hole_of(np.column_stack([x, y, height]), faces, unknown)


@pytest.fixture(scope="module")
def beside_other(sheet):
    """A hole in waves 7 edges long, which end in taller ones of twice the length."""
    points, faces = sheet(110, 96)
    x, y = (points - points.mean(axis=0))[:, :2].T
    away = np.hypot(x, y)
    near, far = (np.cos(k * x) + np.cos(k * y) for k in (2.0 * np.pi / 7.0, np.pi / 7.0))
    height = np.where(away < 24.0, 0.25 * near, 1.5 * far)
    unknown = away < 7.0
    points = np.column_stack([x, y, np.where(unknown, 0.0, height)])
    return hole_of(points, faces, unknown)


def test_a_pattern_is_looked_for_near_the_hole(beside_other):
    length = 12.0 * np.array(FakeHoleTuning().look(beside_other).fineness)
    assert length.max() < 9.0
    length = 12.0 * np.array(FakeHoleTuning(near=np.inf).look(beside_other).fineness)
    assert length.max() > 10.0
    for near, least, most in ((15.0, 5.0, 9.0), (np.inf, 9.0, 22.0)):
        found, asked = tuned(beside_other, lambda _: 0.5, near=near, shorten_from=99.0)
        assert least < found.hole.wavelength < most
        assert least < max(asked) < most


def test_a_repeat_longer_than_what_is_near_is_looked_for_in_all(sheet):
    points, faces = sheet(110, 96)
    x, y = (points - points.mean(axis=0))[:, :2].T
    unknown = np.hypot(x, y) < 7.0
    height = np.where(unknown, 0.0, np.cos(0.35 * x) + np.cos(0.35 * y))
    hole = hole_of(np.column_stack([x, y, height]), faces, unknown)
    all_around = FakeHoleTuning(near=np.inf)
    assert FakeHoleTuning(near=6.0).look(hole) == all_around.look(hole)
    for tune in (FakeHoleTuning(near=6.0, shorten_from=99.0), replace(all_around, shorten_from=99)):
        attempt = Attempt(hole, lambda _: 0.5)
        tune(hole, UNSEEN, attempt, lambda _: None)
        assert min(attempt.asked) > 12.0


def test_all_around_is_only_searched_if_it_alternates_too(hole, monkeypatch):
    searched = []

    def lengths(of, _):
        searched.append(int(of.measured.sum()))
        return (20.0,)

    monkeypatch.setattr(tune_by_fake_holes, "repeat_lengths", lengths)
    everywhere = hole.measured.sum()
    for around, number in ((0.0, 1), (0.2, 2)):
        searched.clear()
        monkeypatch.setattr(
            tune_by_fake_holes,
            "repetition",
            lambda of, _, around=around: around if of.measured.sum() == everywhere else 0.2,
        )
        look = FakeHoleTuning().look(hole)
        assert bool(look.reason) == (around == 0.0)
        assert len(searched) == number
        assert searched[0] < everywhere


def test_what_is_measured_far_off_tells_where_nothing_near_is(beside_other):
    away = np.linalg.norm(beside_other.positions, axis=1)
    spoiled = replace(beside_other, measured=beside_other.measured & (away > 30.0))
    assert FakeHoleTuning().look(spoiled) == FakeHoleTuning(near=np.inf).look(spoiled)


class Attempt:
    """Recovers the part of the detail that the length is worth; notes what it was asked."""

    def __init__(self, hole, worth):
        self.truth, self.worth, self.asked = hole.positions, worth, []

    def __call__(self, fake, around):
        assert (fake.wavelength, fake.shortening) == (around.wavelength, around.shortening)
        length = fake.wavelength * fake.shortening
        self.asked.append(length)
        part = self.worth(length)
        if part is None:
            return None
        moved = fake.positions + part * (self.truth - fake.positions)
        inside = (fake.parts >= 0)[:, None]
        positions = np.where(inside, moved, fake.positions)
        return replace(
            fake,
            positions=positions,
            normals=vertex_normals(positions, fake.faces),
            weights=np.ones(len(positions)),
        )


def tuned(hole, worth, **settings):
    attempt = Attempt(hole, worth)
    return FakeHoleTuning(**settings)(hole, UNSEEN, attempt, lambda _: None), attempt.asked


def test_the_length_that_recovers_most_is_chosen(hole):
    found, asked = tuned(hole, lambda length: 1.0 if length == 9.0 else 0.3, lengths=(7.0, 9.0))
    assert found.hole.wavelength == 9.0
    assert found.evidence.trust(0.01).explained > 0.8
    assert found.evidence.trust(1.0).explained < 0.3
    assert asked == [7.0, 9.0]


def test_lengths_that_were_seen_are_not_sought_again(hole):
    attempt = Attempt(hole, lambda _: 0.9)
    look = Look("", 0.3, lengths=(9.5, 6.5))
    FakeHoleTuning()(hole, look, attempt, lambda _: None)
    assert attempt.asked == [9.5, 6.5]


def test_nothing_more_is_tried_where_detail_is_opposed_to_the_truth(hole):
    for worth, expected in ((-1.0, [7.0]), (0.0, [7.0, 9.0]), (0.3, [7.0, 9.0])):
        found, asked = tuned(hole, lambda _, part=worth: part, lengths=(7.0, 9.0))
        assert asked == expected
        assert found.evidence.hopeless == (worth < 0.0)
        assert found.hole.wavelength == 7.0
    _, asked = tuned(hole, lambda length: 0.9 if length == 7.0 else -1.0, lengths=(7.0, 9.0, 6.0))
    assert asked == [7.0, 9.0, 6.0]


def test_shorter_patches_are_tried_where_the_length_is_long(hole):
    found, asked = tuned(hole, lambda length: 1.0 if length < 9.0 else 0.6, lengths=(12.0,))
    assert asked == pytest.approx([12.0, 8.4])
    assert (found.hole.wavelength, found.hole.shortening) == (12.0, 0.7)
    assert GridPatches().radius(found.hole) == pytest.approx(0.6 * 8.4)
    found, _ = tuned(
        hole, lambda length: 1.0 if length < 9.0 else 0.6, lengths=(12.0,), apart=False
    )
    assert (found.hole.wavelength, found.hole.shortening) == (pytest.approx(8.4), 1.0)
    _, asked = tuned(hole, lambda _: 1.0, lengths=(9.0,))
    assert asked == [9.0]
    _, asked = tuned(hole, lambda _: 1.0, lengths=(12.0, 8.5))
    assert asked == [12.0, 8.5]


def test_short_patches_keep_the_base_of_the_whole_length(hole):
    short = replace(hole, wavelength=12.0, shortening=0.7)
    whole, halved = (replace(hole, wavelength=length) for length in (12.0, 8.4))
    found, same, other = (LowPassBase()(each, first=True).base for each in (short, whole, halved))
    np.testing.assert_array_equal(found, same)
    assert np.abs(found - other).max() > 0.02
    again = with_missing(short, short.positions, np.full(len(short.positions), -1))
    assert (again.wavelength, again.shortening) == (12.0, 0.7)


def test_where_whole_patches_find_no_room_half_the_length_is_tried(hole):
    found, asked = tuned(hole, lambda length: None if length > 9.0 else 0.9, lengths=(16.0,))
    assert asked == [16.0, 8.0]
    assert found.hole.wavelength == 8.0
    found, asked = tuned(hole, lambda _: None, lengths=(9.0,))
    assert asked == [9.0]
    assert found.evidence is None


@pytest.mark.parametrize("believing", [True, False])
def test_who_believes_takes_all_detail_as_right(hole, believing):
    found, _ = tuned(hole, lambda _: 0.0, lengths=(8.0,), believing=believing)
    trust = found.evidence.trust(1.0)
    assert (trust.explained == 1.0) == believing
    assert (trust.strength == 1.0).all() == believing
    assert found.evidence.promising == believing
    nothing, _ = tuned(hole, lambda _: None, lengths=(8.0,), believing=believing)
    assert nothing.evidence is None


def test_what_fake_holes_are_made_of_can_be_left_out(hole):
    for rim in (True, False):
        found, _ = tuned(hole, lambda _: 1.0, lengths=(9.0,), rim=rim)
        fake = make_fake_holes(hole, 0, rim=rim)
        assert len(found.evidence.parts) == fake.parts.max() + 1
    deaf, _ = tuned(hole, lambda _: 1.0, lengths=(9.0,), asking=False)
    assert deaf.evidence.trust(0.01).explained == deaf.evidence.trust(9.0).explained
