"""What comes of one hole: detail where the evidence, and the fill itself, speak for it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.solving import solve_hole
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage1b_fair_harmonic import fair_region
from meshlab_lowrank.stages.stage1c_level_even import EvenLevel
from meshlab_lowrank.stages.stage7_finish_as_it_came import AsItCame
from meshlab_lowrank.stages.stage8_edges_as_closed import EdgesAsClosed
from meshlab_lowrank.tuning.conflict import UNRECOVERED
from meshlab_lowrank.tuning.trust import Trust
from meshlab_lowrank.tuning.tune import NO_REPEAT, Tuned, Unquestioning
from tests.builders import region_of

WAVES = 2.0 * np.pi / 8.0


@dataclass(frozen=True)
class Witness(Unquestioning):
    """Evidence that notes the conflict it is told, and believes below a limit."""

    heard: list
    limit: float = np.inf
    promising: bool = True
    hopeless: bool = False
    error: float = 0.0

    def trust(self, conflict):
        self.heard.append(conflict)
        believed = conflict < self.limit
        return Trust(np.full(3, 0.5 * believed), 0.5 * believed)

    def __call__(self, hole, *_):
        return Tuned(replace(hole, wavelength=8.0), self)


@pytest.fixture(scope="module")
def region(sheet):
    points, faces = sheet(46, 40)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    points[:, 2] = 0.4 * (np.cos(WAVES * x) + np.cos(WAVES * y))
    unknown = np.hypot(x, y) < 5.0
    return fair_region(region_of(points, faces, unknown)), points


def solved(region, detail="calibrated", **settings):
    witness = Witness([], **settings)
    pipeline = replace(AUTO, tune=witness, passes=2)
    found = solve_hole(region[0], pipeline, detail=detail, report=lambda *_: None)
    return found, witness.heard


def test_the_conflict_of_the_fill_decides(region):
    found, heard = solved(region)
    assert 0.0 < heard[0] < 0.05  # of the whole; then of its places
    assert 0.0 < min(heard) < max(heard) < 0.05
    assert found.trust == 0.5
    refused, _ = solved(region, limit=0.0)
    assert refused.trust == 0.0
    assert refused.reason == NO_REPEAT
    np.testing.assert_array_equal(refused.positions, region[0].vertices)


def test_detail_is_scaled_by_its_strength(region):
    unknown = ~region[0].known_vertices
    smooth = region[0].vertices[unknown]
    half, _ = solved(region)
    moved = half.positions[unknown] - smooth
    missing = region[1][unknown] - smooth
    assert 0.35 < (moved * missing).sum() / (missing**2).sum() < 0.65


def test_nothing_is_recovered_without_promise(region):
    found, heard = solved(region, promising=False)
    assert heard == [UNRECOVERED]
    assert found.reason == NO_REPEAT


@dataclass(frozen=True)
class NotedRelief(Stage):
    """Lifts the fill, and notes the holes that it is given."""

    seen: list

    def __call__(self, hole):
        self.seen.append(hole)
        lift = 0.25 * hole.unknown[:, None] * hole.base_normals
        return replace(hole, positions=hole.positions + lift)

    def calmed(self, hole):
        self.seen.append(hole)
        return replace(hole, positions=hole.positions + 1.0 * hole.unknown[:, None])


def test_relief_is_copied_on_the_triangles_of_the_mesh_whatever_the_level(region):
    seen = []
    pipeline = replace(
        AUTO,
        tune=Witness([], promising=False, limit=0.0),
        level=EvenLevel(uneven=0.0),
        relief=NotedRelief(seen),
        finish=AsItCame(),
        edges=EdgesAsClosed(),
    )
    level = pipeline.level(region[0], 1.0, rim_normals=False)
    assert not level.is_mesh
    found = solve_hole(region[0], pipeline, detail="full", report=lambda *_: None)
    (hole,) = seen  # and it isn't calmed: it was made as crisp as it is to be
    np.testing.assert_array_equal(hole.faces, region[0].faces)
    moved = np.linalg.norm(found.positions - region[0].vertices, axis=1)
    np.testing.assert_allclose(moved, 0.25 * ~region[0].known_vertices, atol=1e-12)
    assert found.trust == 0.0


def test_what_was_recovered_is_calmed_on_the_mesh_with_full_detail_only(region):
    seen = []
    pipeline = replace(AUTO, passes=2, level=EvenLevel(uneven=0.0), relief=NotedRelief(seen))
    for detail in ("calibrated", "full"):
        given = replace(pipeline, tune=Witness([]))
        solve_hole(region[0], given, detail=detail, report=lambda *_: None)
        assert len(seen) == (detail == "full")
    np.testing.assert_array_equal(seen[0].faces, region[0].faces)
    assert np.abs(seen[0].positions - region[0].vertices).max() > 0.1


def relief(x, y):
    """Waves in one half, and in the other a sum of waves of many lengths and directions."""
    chance = np.random.default_rng(1)
    noise = np.zeros(len(x))
    for _ in range(60):
        length, angle, phase = chance.uniform(5.0, 25.0), *chance.uniform(0.0, 2.0 * np.pi, 2)
        noise += np.cos(2 * np.pi / length * (np.cos(angle) * x + np.sin(angle) * y) + phase)
    return np.where(y < 0.0, 0.5 * (np.cos(WAVES * x) + np.cos(WAVES * y)), 0.08 * noise)


def test_each_hole_is_judged_by_relief_like_that_at_its_rim(sheet):
    points, faces = sheet(104, 50)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    points[:, 2] = relief(x, y)
    gone = np.hypot(x, y + 22.0) < 5.0
    gone |= np.hypot(x, y - 22.0) < 5.0
    errors = []
    for detail in ("calibrated", "none"):
        result = inpaint(points, faces[~gone[faces].any(axis=1)], detail=detail)
        x, y, z = result.vertices[result.new_vertices].T
        squares = (z - relief(x, y)) ** 2
        errors.append([np.sqrt(squares[half].mean()) for half in (y < 0.0, y > 0.0)])
        trust = result.trust[result.new_vertices]
        if detail == "calibrated":
            assert trust[y < 0.0].min() > max(0.5, trust[y > 0.0].max())
    (waves, noise), (flat_waves, flat_noise) = errors
    assert waves < 0.3 * flat_waves
    assert noise <= 1.15 * flat_noise


@dataclass(frozen=True)
class Turned(Stage):
    """Edges that can't be overlooked: faces begin with another corner."""

    def __call__(self, positions, faces, new):  # noqa: ARG002
        return np.where(new[:, None], np.roll(faces, 1, axis=1), faces)


def test_edges_of_a_fill_may_change_and_those_of_the_mesh_not(region):
    patch, _ = region
    pipeline = replace(AUTO, tune=Witness([]), passes=1, edges=Turned())

    def faces_of(ids):
        given = replace(patch, face_ids=ids)
        return solve_hole(given, pipeline, detail="calibrated", report=lambda *_: None).faces

    np.testing.assert_array_equal(faces_of(patch.face_ids), patch.faces)
    found = faces_of(np.where(patch.known_faces, patch.face_ids, -1))
    turned = np.roll(patch.faces, 1, axis=1)
    np.testing.assert_array_equal(found[~patch.known_faces], turned[~patch.known_faces])
    np.testing.assert_array_equal(found[patch.known_faces], patch.faces[patch.known_faces])
