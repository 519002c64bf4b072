"""The repeat length of waves of known length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.tuning.repeat_length import lengths_from, repeat_lengths
from sample_meshes.shapes import make_shape
from tests.builders import hole_of


@pytest.fixture(scope="module")
def flat(sheet):
    vertices, faces = sheet(76, 66)
    return vertices - vertices.mean(axis=0), faces


def egg_box(flat, height):
    points, faces = flat
    truth = np.column_stack([points[:, :2], height(*points[:, :2].T)])
    unknown = np.hypot(*points[:, :2].T) < 6.0
    return hole_of(np.where(unknown[:, None], points, truth), faces, unknown)


def nearest(lengths, wavelength):
    return min(abs(length / wavelength - 1.0) for length in lengths)


def square(wavelength, amplitude=0.4):
    k = 2.0 * np.pi / wavelength
    return lambda x, y: amplitude * (np.cos(k * x) + np.cos(k * y))


def hexagonal(wavelength, amplitude=0.3):
    k = 2.0 * np.pi / (wavelength * np.sqrt(0.75))
    a, b = 0.5 * k, np.sqrt(0.75) * k
    return lambda x, y: amplitude * (np.cos(k * x) + np.cos(a * x + b * y) + np.cos(a * x - b * y))


@pytest.mark.parametrize("wavelength", [7.0, 9.0, 11.0, 14.0])
@pytest.mark.parametrize(("waves", "tolerance"), [(hexagonal, 0.2), (square, 0.3)])
def test_egg_boxes(flat, waves, tolerance, wavelength):
    # The mean over all directions of a square pattern peaks between its side and its diagonal.
    assert nearest(repeat_lengths(egg_box(flat, waves(wavelength)), 0), wavelength) < tolerance


def test_the_height_of_the_waves_makes_no_difference(flat):
    low, high = (repeat_lengths(egg_box(flat, hexagonal(9.0, a)), 0) for a in (0.02, 0.4))
    np.testing.assert_allclose(low, high, rtol=0.15)


@pytest.mark.parametrize("wavelength", [8.0, 11.0])
def test_bumps_on_a_tube(wavelength):
    # Not a torus: its outside stretches the pattern by a half.
    vertices, faces = make_shape("capsule", "bumps", count=10000, wavelength=wavelength, seed=1)
    hole = hole_of(vertices, faces, np.linalg.norm(vertices - vertices[900], axis=1) < 5.0)
    assert nearest(repeat_lengths(hole, 0), wavelength) < 0.2


def test_what_lies_inside_is_never_read(flat):
    hole = egg_box(flat, square(9.0))
    spoiled = np.where(hole.measured[:, None], hole.normals, [[1.0, 0.0, 0.0]])
    assert repeat_lengths(replace(hole, normals=spoiled), 0) == repeat_lengths(hole, 0)


def test_the_seed_decides_alone(flat):
    hole = egg_box(flat, square(9.0))
    assert repeat_lengths(hole, 3) == repeat_lengths(hole, 3)


@pytest.mark.parametrize("size", [(76, 66), (14, 14)])
def test_without_detail_or_room_it_still_gives_a_length(sheet, size):
    points, faces = sheet(*size)
    middle = np.linalg.norm(points - points.mean(axis=0), axis=1)
    lengths = repeat_lengths(hole_of(points, faces, middle < 2.5), 0)
    assert 1 <= len(lengths) <= 2
    assert all(2.0 < length < 60.0 for length in lengths)


@pytest.mark.parametrize("wavelength", [9.0, 14.0])
def test_the_first_minimum_lies_at_half_the_length(flat, wavelength):
    # The other candidate, the next maximum, may be merged with it; it comes second otherwise.
    first = repeat_lengths(egg_box(flat, hexagonal(wavelength)), 0)[0]
    assert first == pytest.approx(wavelength, rel=0.25)


@pytest.mark.parametrize(("minimum", "maximum"), [(4, 13), (6, 18), (9, 14)])
def test_twice_the_first_minimum_and_the_next_maximum_are_tried(minimum, maximum):
    profile = np.interp(np.arange(25), [0, minimum, maximum, 24], [1.0, -0.5, 0.4, 0.0])
    assert lengths_from(profile) == (2.0 * minimum, maximum)


def test_two_lengths_that_are_nearly_the_same_are_one():
    profile = np.interp(np.arange(25), [0, 5, 11, 24], [1.0, -0.5, 0.4, 0.0])
    assert lengths_from(profile) == (10.5,)


def test_lengths_are_those_that_can_be_tried():
    profile = np.interp(np.arange(25), [0, 2, 23, 24], [1.0, -0.5, 0.4, 0.0])
    assert lengths_from(profile) == (5.0, 22.0)
