"""The one loop over the stages: parts recovered on their own, and what each pass leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.mesh.geometry import normalized
from meshlab_lowrank.pipeline import library_around, recover
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.stages.stage1e_base_low_pass import LowPassBase
from meshlab_lowrank.stages.stage6a_average_at_vertices import AverageAtVertices, amplified
from tests.builders import hole_of

WAVELENGTH = 8.0
PIPELINE = replace(AUTO, passes=2, diffuse=replace(AUTO.diffuse, passes=2))


@pytest.fixture(scope="module")
def two_holes(sheet):
    """Egg box with two holes that are filled flat, and the heights that are missing."""
    flat, faces = sheet(60, 42)
    flat = flat - flat.mean(axis=0)
    k = 2.0 * np.pi / WAVELENGTH
    height = 0.4 * (np.cos(k * flat[:, 0]) + np.cos(k * flat[:, 1]))
    parts = np.full(len(flat), -1)
    for number, x in enumerate((-12.0, 12.0)):
        parts[np.hypot(flat[:, 0] - x, flat[:, 1]) < 5.0] = number
    points = np.column_stack([flat[:, :2], np.where(parts < 0, height, 0.0)])
    return replace(hole_of(points, faces, parts >= 0), wavelength=WAVELENGTH), parts, height


def test_a_part_finds_its_detail_in_the_rest(two_holes):
    hole, parts, height = two_holes
    library = library_around(hole, PIPELINE)
    solved = recover(replace(hole, parts=parts), PIPELINE, library=library)
    for number in range(2):
        inside = parts == number
        error = solved.positions[inside, 2] - height[inside]
        assert np.sqrt(np.mean(error**2)) < 0.4 * height[inside].std()


def test_a_part_never_sees_patches_of_its_own_place(sheet):
    # Ripples round one centre: the middle looks like no other place.
    flat, faces = sheet(60, 42)
    flat = flat - flat.mean(axis=0)
    radius = np.hypot(flat[:, 0], flat[:, 1])
    height = 0.5 * np.cos(2.0 * np.pi * radius / WAVELENGTH)
    points = np.column_stack([flat[:, :2], height])
    inside = radius < 5.0
    # Another hole, for the library to keep off.
    other = np.hypot(flat[:, 0] - 22.0, flat[:, 1]) < 2.0
    whole = replace(hole_of(points, faces, other), wavelength=WAVELENGTH)
    library = library_around(whole, PIPELINE)
    holed = hole_of(np.where(inside[:, None], flat, points), faces, inside | other)
    errors = []
    for parts in (None, np.where(inside, 0, -1)):
        given = replace(holed, wavelength=WAVELENGTH, parts=parts)
        solved = recover(given, PIPELINE, library=library)
        errors.append(np.sqrt(np.mean((solved.positions[inside, 2] - height[inside]) ** 2)))
    assert errors[0] < 0.5 * errors[1]


def test_what_belongs_to_no_part_stays(two_holes):
    hole, parts, _ = two_holes
    first = replace(hole, parts=np.where(parts == 0, 0, -1))
    solved = recover(first, PIPELINE, library=library_around(hole, PIPELINE))
    assert not solved.weights[(parts == 1) & (solved.base[:, 0] > 11.0)].any()


def test_too_few_patches_that_are_allowed_give_none(two_holes):
    hole, parts, _ = two_holes
    library = library_around(hole, PIPELINE)
    few = replace(library, rows=library.rows[:20], places=library.places[:20])
    assert recover(replace(hole, parts=parts), PIPELINE, library=few) is None


def test_the_stages_tell_how_far_they_are(two_holes):
    told = []
    recover(two_holes[0], PIPELINE, report=lambda *step: told.append(step))
    parts = [part for _, part in told]
    assert parts == sorted(parts)
    assert parts[0] == 0.0
    assert parts[-1] < 1.0
    assert {stage for stage, _ in told} == {"patches", "diffusion", "refinement", "vertex update"}


def test_weak_normals_lean_further_and_strong_ones_stay(two_holes):
    hole = PIPELINE.base(two_holes[0], first=True)
    hidden = ~hole.measured

    def amplify(slope, exponent=0.7):
        tilted = normalized(hole.base_normals + np.array([slope, 0.0, 0.0]))
        normals = np.where(hidden[:, None], tilted, hole.normals)
        given = replace(hole, normals=normals, weights=np.ones(len(normals)))
        found = amplified(given, exponent).normals
        np.testing.assert_array_equal(found[~hidden], normals[~hidden])
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
        return np.cross(hole.base_normals, normals)[hidden], np.cross(hole.base_normals, found)[
            hidden
        ]

    before, after = amplify(0.05)
    assert (np.linalg.norm(after, axis=1) > 1.2 * np.linalg.norm(before, axis=1)).all()
    np.testing.assert_allclose(np.cross(before, after), 0.0, atol=1e-12)
    np.testing.assert_allclose(*amplify(2.0), atol=1e-12)
    less = amplify(0.05, 0.1)[1]
    assert (np.linalg.norm(less, axis=1) < np.linalg.norm(after, axis=1)).all()


def test_the_last_pass_makes_up_for_lost_lean(two_holes):
    leans = []
    for exponent in (0.0, 0.5):
        average = AverageAtVertices(corrections=2, at_last=exponent)
        found = recover(two_holes[0], replace(PIPELINE, average=average, copying=False))
        away = np.cross(found.normals, found.base_normals)[~found.measured]
        leans.append(np.sqrt(np.mean(away**2)))
    assert leans[1] > 1.01 * leans[0]


def test_the_base_is_told_whether_what_is_missing_was_recovered(two_holes):
    told = []

    class Telling(LowPassBase):
        def __call__(self, hole, *, first):
            told.append(first)
            return super().__call__(hole, first=first)

    pipeline = replace(PIPELINE, base=Telling())
    library = library_around(two_holes[0], pipeline)
    assert told == [True]
    recover(two_holes[0], pipeline, library=library)
    assert told == [True, True, False]
