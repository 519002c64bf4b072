"""Fake holes: where they lie."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.hole import depth_of
from meshlab_lowrank.mesh.geometry import cotangent_laplacian
from meshlab_lowrank.mesh.topology import boundary_vertices, vertex_adjacency, vertex_rings
from meshlab_lowrank.tuning.fake_holes import make_fake_holes
from meshlab_lowrank.tuning.likeness import unlikeness
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
    return [np.flatnonzero(fake.parts == i) for i in range(fake.parts.max())]


def rim(fake):
    return fake.parts == fake.parts.max()


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
    assert not hole.unknown[inside].any()
    assert not fake.hole.measured[inside].any()
    np.testing.assert_array_equal(fake.truth, hole.positions)
    rest = ~fake.hole.unknown
    assert fake.hole.positions[rest].tobytes() == hole.positions[rest].tobytes()
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
    one, other = (make_fake_holes(hole, seed, alike=False).parts for seed in (0, 1))
    assert (one != other).any()


def test_where_there_is_no_room_there_are_none(sheet):
    points, faces = sheet(16, 14)
    unknown = np.linalg.norm(points - points.mean(axis=0), axis=1) < 3.0
    cramped = hole_of(points, faces, unknown)
    assert make_fake_holes(cramped, 0, rim=False) is None
    assert make_fake_holes(cramped, 0).parts.max() == 0


def test_the_last_part_is_the_rim_all_round(hole, fake):
    rings = vertex_rings(
        vertex_adjacency(hole.faces, len(hole.positions)), np.flatnonzero(hole.unknown), 9
    )
    np.testing.assert_array_equal(rim(fake), (rings >= 1) & (rings <= 4))
    without = make_fake_holes(hole, 0, rim=False)
    rest = without.parts < 0
    assert without.hole.positions[rest].tobytes() == hole.positions[rest].tobytes()


def test_a_missing_rim_is_foretold_from_beyond_it(sheet):
    points, faces = sheet(50, 44)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    points[:, 2] = 0.01 * (x**2 - y**2)
    away = np.hypot(x, y)
    points[away < 5.0, 2] += 3.0  # a fill that is wrong spoils nothing
    fake = make_fake_holes(hole_of(points, faces, away < 5.0), 0)
    near = rim(fake)
    assert np.abs(fake.hole.positions[near, 2] - points[near, 2]).max() < 0.1
    np.testing.assert_array_equal(fake.truth, points)


@pytest.fixture(scope="module")
def halves(sheet):
    """Waves on the left, where the hole is; on the right others, of another kind."""

    def surface(x, y):
        rough = 0.8 * np.cos(1.9 * x) * np.cos(1.9 * y)
        return np.where(x < 4.0, 0.4 * (np.cos(0.7 * x) + np.cos(0.7 * y)), rough)

    points, faces = sheet(90, 60)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    unknown = np.hypot(x + 20.0, y) < 6.0
    points[:, 2] = np.where(unknown, 0.0, surface(x, y))
    return hole_of(points, faces, unknown)


def test_discs_lie_where_the_relief_is_like_that_around_the_hole(halves):
    alike, anywhere = (make_fake_holes(halves, 0, alike=alike) for alike in (True, False))

    def beyond(fake):
        return [fake.truth[disc, 0].mean() > 4.0 for disc in discs(fake)]

    assert len(beyond(alike)) >= 3
    assert not any(beyond(alike)[:3])
    assert any(beyond(anywhere)[:3])


def test_unlikeness_knows_amplitude_and_spectrum(sheet):
    points, faces = sheet(46, 90)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    third = (np.digitize(x, [-15.0, 15.0])).astype(int)
    length, amplitude = np.array([0.7, 0.7, 1.9])[third], np.array([0.4, 0.1, 0.15])[third]
    points[:, 2] = amplitude * (np.cos(length * x) + np.cos(length * y))
    hole = hole_of(points, faces, np.hypot(x + 30.0, y) < 4.0)
    around = (np.hypot(x + 30.0, y) < 9.0) & ~hole.unknown
    places = [np.argmin(np.hypot(x - at, y)) for at in (-24.0, 0.0, 30.0)]
    same, lower, shorter = unlikeness(hole, np.array(places), 6.0, around)
    assert same < 0.5
    assert lower > 1.0
    assert shorter > 1.0


def test_depth_is_the_distance_from_what_is_known(hole):
    depth = depth_of(hole)
    np.testing.assert_array_equal(depth[~hole.unknown], 0.0)
    known, hidden = (hole.positions[mask] for mask in (~hole.unknown, hole.unknown))
    away = np.linalg.norm(hidden[:, None] - known, axis=2).min(axis=1)
    np.testing.assert_allclose(depth[hole.unknown], away)
