"""Detail that is right in one half of a hole and in conflict with the rim in the other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from meshlab_lowrank import solving
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.mesh.windows import window_means
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.stages.stage1b_fair_harmonic import fair_region
from meshlab_lowrank.stages.stage1c_level_even import EvenLevel
from meshlab_lowrank.tuning import local_trust
from meshlab_lowrank.tuning.conflict import conflict, conflicts
from meshlab_lowrank.tuning.local_trust import local_strength
from meshlab_lowrank.tuning.trust import Trust
from meshlab_lowrank.tuning.tune import Tuned, Unquestioning
from tests.builders import hole_of, region_of

WAVES = 2.0 * np.pi / 8.0


@dataclass(frozen=True)
class Believer(Unquestioning):
    """Evidence for detail with a conflict below a limit."""

    limit: float = 0.2
    promising: bool = True
    hopeless: bool = False
    error: float = 0.0

    def trust(self, told):
        believed = 1.0 * (told < self.limit)
        return Trust(np.full(3, believed), believed, np.full(3, 1.0 - believed), np.zeros(3))

    def __call__(self, hole, *_):
        return Tuned(replace(hole, wavelength=8.0), self)


@pytest.fixture(scope="module")
def halves(sheet):
    """An egg box with a wide hole, in one half of which the normals fit and in the other don't.

    Where they don't, the fill and the normals asked for are nearly flat, so that they hardly count
    in the whole.
    """
    points, faces = sheet(60, 52)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    unknown = np.hypot(x, y) < 16.0
    right = x > 0.0
    height = 0.5 * (np.cos(WAVES * x) + np.cos(WAVES * y)) * np.where(right, 1.0, 0.1)
    lifted = np.column_stack([x, y, height])
    flat = np.column_stack([x, y, np.where(unknown & ~right, 0.0, height)])
    hole = hole_of(
        np.where(unknown[:, None], np.column_stack([x, y, 0.0 * x]), lifted), faces, unknown
    )
    weights = np.where(hole.measured, 1.0, 0.3)
    upright = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return replace(
        hole,
        positions=flat,
        normals=vertex_normals(lifted, faces),
        base_normals=upright,
        weights=weights,
    )


def test_strong_detail_hides_the_conflict_of_weak_detail_but_not_in_place(halves):
    assert conflict(halves, halves.unknown) < 0.1
    found = conflicts(halves, halves.unknown, 6.0)
    x = halves.positions[halves.unknown, 0]
    assert found[x > 6.0].max() < 0.05
    assert found[x < -6.0].min() > 0.2
    silent = replace(halves, weights=halves.measured.astype(float))
    np.testing.assert_array_equal(conflicts(silent, silent.unknown, 6.0), 1.0)


def test_each_place_is_judged_by_the_conflict_around_it(halves):
    strength = local_strength(Believer(), halves)
    x = halves.positions[halves.unknown, 0]
    assert strength[x > 14.0].min() > 0.95
    assert strength[x < -14.0].max() < 0.05
    assert strength.min() >= 0.0


def test_windows_average_what_lies_within_them():
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    found = window_means(points, np.array([[1.0, 0.0], [3.0, 2.0], [7.0, 5.0]]), 2.0)
    np.testing.assert_allclose(found, [[2.0, 1.0], [2.0, 1.0], [7.0, 5.0]])


@pytest.mark.parametrize("level", [AUTO.level, EvenLevel(uneven=0.0)])
def test_detail_is_put_on_where_it_is_believed(sheet, monkeypatch, level):
    points, faces = sheet(46, 40)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    points[:, 2] = 0.4 * (np.cos(WAVES * x) + np.cos(WAVES * y))
    unknown = np.hypot(x, y) < 6.0
    region = fair_region(region_of(points, faces, unknown))

    def right_half(_, hole):
        return 1.0 * (hole.positions[hole.unknown, 0] > 0.0)

    monkeypatch.setattr(local_trust, "local_strength", right_half)
    pipeline = replace(AUTO, tune=Believer(limit=np.inf), passes=2, level=level)
    found = solving.solve_hole(region, pipeline, detail="calibrated", report=lambda *_: None)
    moved = np.linalg.norm(found.positions - region.vertices, axis=1)
    assert moved[unknown & (x > 1.5)].max() > 0.3
    assert moved[unknown & (x < -1.5)].max() < 0.05
    clear = np.abs(x[unknown]) > 1.5
    np.testing.assert_array_equal((found.trusts > 0.5)[clear], (x[unknown] > 0.0)[clear])
