"""Grid solver: parts of the missing surface recovered on their own, and amplitudes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.grid_solver import (
    GridSettings,
    amplified,
    library_around,
    recover_detail,
    with_base,
)
from meshlab_lowrank.hole import start_state
from meshlab_lowrank.mesh.geometry import normalized

SETTINGS = GridSettings(wavelength=8.0, refits=1, passes=2)


@pytest.fixture(scope="module")
def two_holes(sheet):
    """Egg box with two holes that are filled flat, and the heights that are missing."""
    flat, faces = sheet(60, 42)
    flat = flat - flat.mean(axis=0)
    k = 2.0 * np.pi / SETTINGS.wavelength
    height = 0.4 * (np.cos(k * flat[:, 0]) + np.cos(k * flat[:, 1]))
    parts = np.full(len(flat), -1)
    for number, x in enumerate((-12.0, 12.0)):
        parts[np.hypot(flat[:, 0] - x, flat[:, 1]) < 5.0] = number
    points = np.column_stack([flat[:, :2], np.where(parts < 0, height, 0.0)])
    return start_state(points, faces, parts >= 0), parts, height


def test_a_part_finds_its_detail_in_the_rest(two_holes):
    state, parts, height = two_holes
    library = library_around(state, SETTINGS)
    solved = recover_detail(state, SETTINGS, library=library, parts=parts)
    for number in range(2):
        inside = parts == number
        error = solved.positions[inside, 2] - height[inside]
        assert np.sqrt(np.mean(error**2)) < 0.4 * height[inside].std()


def test_a_part_never_sees_patches_of_its_own_place(sheet):
    # Ripples round one centre: the middle looks like no other place.
    flat, faces = sheet(60, 42)
    flat = flat - flat.mean(axis=0)
    radius = np.hypot(flat[:, 0], flat[:, 1])
    height = 0.5 * np.cos(2.0 * np.pi * radius / SETTINGS.wavelength)
    points = np.column_stack([flat[:, :2], height])
    inside = radius < 5.0
    # Another hole, for the library to keep off.
    other = np.hypot(flat[:, 0] - 22.0, flat[:, 1]) < 2.0
    library = library_around(start_state(points, faces, other), SETTINGS)
    holed = start_state(np.where(inside[:, None], flat, points), faces, inside | other)
    errors = []
    for parts in (None, np.where(inside, 0, -1)):
        solved = recover_detail(holed, SETTINGS, library=library, parts=parts)
        errors.append(np.sqrt(np.mean((solved.positions[inside, 2] - height[inside]) ** 2)))
    assert errors[0] < 0.5 * errors[1]


def test_what_belongs_to_no_part_stays(two_holes):
    state, parts, _ = two_holes
    library = library_around(state, SETTINGS)
    first = recover_detail(state, SETTINGS, library=library, parts=np.where(parts == 0, 0, -1))
    assert not first.weights[(parts == 1) & (first.base[:, 0] > 11.0)].any()


def test_too_few_patches_that_are_allowed_leave_the_state_as_it_was(two_holes):
    state, parts, _ = two_holes
    library = library_around(state, SETTINGS)
    few = replace(library, rows=library.rows[:20], places=library.places[:20])
    assert recover_detail(state, SETTINGS, library=few, parts=parts) is state


def test_weak_normals_lean_further_and_strong_ones_stay(two_holes):
    state, _, _ = two_holes
    state = with_base(state, SETTINGS, state.measured)
    hidden = ~state.measured

    def amplify(slope):
        tilted = normalized(state.base_normals + np.array([slope, 0.0, 0.0]))
        normals = np.where(hidden[:, None], tilted, state.normals)
        given = replace(state, normals=normals, weights=np.ones(len(normals)))
        found = amplified(given).normals
        np.testing.assert_array_equal(found[~hidden], normals[~hidden])
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
        return np.cross(state.base_normals, normals)[hidden], np.cross(state.base_normals, found)[
            hidden
        ]

    before, after = amplify(0.05)
    assert (np.linalg.norm(after, axis=1) > 1.2 * np.linalg.norm(before, axis=1)).all()
    np.testing.assert_allclose(np.cross(before, after), 0.0, atol=1e-12)
    np.testing.assert_allclose(*amplify(2.0), atol=1e-12)
