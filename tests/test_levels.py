"""The surface of its own that a hole is worked on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial import Delaunay

from meshlab_lowrank import solving
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.hole import with_recovered
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.leveling import choose_level, finer_level
from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.geometry import edge_lengths
from meshlab_lowrank.presets import AUTO, PAPER
from meshlab_lowrank.stages.stage1c_level import carried
from meshlab_lowrank.stages.stage1c_level_even import EvenLevel, even_surface
from meshlab_lowrank.stages.stage1c_level_mesh_itself import MeshItself
from meshlab_lowrank.tuning.judging import Belief
from meshlab_lowrank.tuning.tune import Look, Tuned, Unquestioning
from tests.builders import region_of

LENGTH = 28.0  # edges a repeat


def variation(points, faces):
    lengths = edge_lengths(points, faces)
    return lengths.std() / lengths.mean()


def waves(points, length=LENGTH):
    """A height that repeats in three directions."""
    height = 0.0
    for angle in (0.0, np.pi / 3.0, 2.0 * np.pi / 3.0):
        along = points[:, :2] @ [np.cos(angle), np.sin(angle)]
        height = height + np.cos(2.0 * np.pi * along / length)
    return height


def ridges(points, length=LENGTH):
    """A height that repeats in two directions, with sharp crests and furrows."""
    height = 0.0
    for angle in (0.0, np.pi / 3.0):
        along = points[:, :2] @ [np.cos(angle), np.sin(angle)]
        height = height + 6.0 * np.abs(along / length % 1.0 - 0.5)
    return height


@pytest.fixture(scope="module")
def uneven():
    """A bent sheet whose edges vary by a coefficient of more than a half."""
    chance = np.random.default_rng(2)
    side = np.linspace(-20.0, 20.0, 41)
    border = [(x, y) for x in side for y in side if max(abs(x), abs(y)) == 20.0]
    dense = chance.uniform(-20.0, 20.0, (12_000, 2))
    kept = chance.random(len(dense)) < np.where(dense[:, 0] < 0.0, 0.9, 0.06)
    flat = np.concatenate([np.array(border), dense[kept & (np.abs(dense).max(axis=1) < 19.5)]])
    faces = Delaunay(flat).simplices.astype(np.int64)
    points = np.column_stack([flat, 0.02 * (flat**2).sum(axis=1)])
    return points, faces


def test_an_even_surface_has_edges_of_length_one_and_lies_on_the_given_one(uneven):
    points, faces = uneven
    assert variation(points, faces) > 0.5
    for scale in (1.0, 0.5):
        even, triangles = even_surface(scale * points, faces)
        assert edge_lengths(even, triangles).mean() == pytest.approx(1.0, abs=0.05)
        assert variation(even, triangles) < 0.25
        away = TriangleIndex(scale * points, faces).closest(even).distances
        assert away.max() < 0.05
        area = np.ptp(even[:, 0]) * np.ptp(even[:, 1])
        assert area == pytest.approx((40.0 * scale) ** 2, rel=0.02)


def test_what_cannot_be_meshed_evenly_is_said():
    angle = 2.0 * np.pi * np.arange(3) / 3.0
    pages = 9.0 * np.column_stack([np.cos(angle), np.sin(angle), 0.5 * np.ones(3)])
    points = np.concatenate([[[0.0, 0.0, 0.0], [0.0, 0.0, 9.0]], pages])
    with pytest.raises(StageError, match="torn"):
        even_surface(points, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]))


def test_a_level_knows_what_is_known(uneven):
    points, faces = uneven
    unknown = np.hypot(*points[:, :2].T) < 6.0
    region = region_of(points, faces, unknown)
    level = EvenLevel()(region, 1.0, rim_normals=False)
    assert not level.is_mesh
    radius = np.hypot(*(level.hole.positions * level.spacing)[:, :2].T)
    assert level.hole.unknown[radius < 4.0].all()
    assert not level.hole.unknown[radius > 12.0].any()
    coarse = EvenLevel()(region, 2.0, rim_normals=False)
    assert coarse.spacing == pytest.approx(2.0 * level.spacing)
    assert len(coarse.hole.positions) == pytest.approx(len(level.hole.positions) / 4.0, rel=0.15)


def test_an_even_mesh_is_its_own_level(sheet):
    points, faces = sheet(30, 30)
    region = region_of(points, faces, np.hypot(*(points - points.mean(axis=0))[:, :2].T) < 4.0)
    level = EvenLevel()(region, 1.0, rim_normals=False)
    assert level.is_mesh
    np.testing.assert_array_equal(level.hole.positions, region.vertices)
    assert not EvenLevel(uneven=0.0)(region, 1.0, rim_normals=False).is_mesh
    assert MeshItself()(region, 4.0, rim_normals=False).is_mesh


def test_what_moved_on_a_level_moves_on_the_mesh(uneven):
    points, faces = uneven
    unknown = np.hypot(*points[:, :2].T) < 6.0
    region = region_of(points, faces, unknown)
    level = EvenLevel()(region, 1.0, rim_normals=False)
    start = level.hole.positions
    np.testing.assert_array_equal(carried(region, level, start), points)

    def bump(at):
        return np.where((inside := 36.0 - (at[:, :2] ** 2).sum(axis=1)) > 0.0, 0.002 * inside**2, 0)

    lifted = start.copy()
    lifted[:, 2] += bump(start * level.spacing) / level.spacing
    found = carried(region, level, lifted)
    np.testing.assert_array_equal(found[~unknown], points[~unknown])
    missed = found[unknown, 2] - points[unknown, 2] - bump(points[unknown])
    assert np.abs(missed).max() < 0.05 * bump(np.zeros((1, 3)))[0]


@pytest.fixture(scope="module")
def fine(sheet):
    """A sheet of waves with 28 edges a repeat, a hole, and the numbers of the sheet."""
    points, faces = sheet(136, 136)
    points = points - points.mean(axis=0)
    points[:, 2] = waves(points)
    unknown = np.hypot(*points[:, :2].T) < 14.0
    return points, faces, unknown


def test_the_level_follows_the_pattern(fine):
    points, faces, unknown = fine
    flat = np.where(unknown[:, None], points * [1.0, 1.0, 0.0], points)
    region = region_of(flat, faces, unknown)
    level, look = choose_level(region, lambda _: region, AUTO)
    assert look.reason == ""
    assert 1.8 < level.spacing < 3.2
    assert choose_level(region, lambda _: region, PAPER)[0].is_mesh


@dataclass(frozen=True)
class Seen(Unquestioning):
    """Sees what is given, one look after the other."""

    looks: list

    def look(self, _):
        return self.looks.pop(0)


def test_a_level_made_for_a_pattern_is_looked_at_again(fine):
    points, faces, unknown = fine
    region = region_of(points, faces, unknown)
    nothing, coarse = Look("nothing", 0.0), Look("", 0.2, (7.2,), (0.6,))
    for last in (nothing, Look("", 0.1, (11.0,), (0.9,))):
        pipeline = replace(AUTO, tune=Seen([nothing, coarse, last]))
        level, look = choose_level(region, lambda _: region, pipeline)
        assert look is last
        assert 1.1 < level.spacing < 1.3
        assert pipeline.tune.looks == []


def test_what_would_have_shown_on_the_mesh_itself_is_not_looked_at_again(fine):
    points, faces, unknown = fine
    region = region_of(points, faces, unknown)
    nothing, coarse, last = Look("nothing", 0.0), Look("", 0.2, (5.0,), (0.4,)), Look("", 0.1)
    pipeline = replace(AUTO, tune=Seen([nothing, coarse, last]))
    level, look = choose_level(region, lambda _: region, pipeline)
    assert level.is_mesh
    assert look is nothing
    assert pipeline.tune.looks == [last]


def test_a_maximum_beyond_the_repeat_does_not_make_a_level_coarser(fine):
    points, faces, unknown = fine
    region = region_of(points, faces, unknown)
    coarse = Look("", 0.2, (14.0, 9.0), (1.17, 0.75))
    for lengths, coarser in (((12.0, 17.0), False), ((17.0, 12.0), True)):
        first = Look("", 0.1, lengths, tuple(length / 12.0 for length in lengths))
        pipeline = replace(AUTO, tune=Seen([first, coarse]))
        level, look = choose_level(region, lambda _: region, pipeline)
        assert level.is_mesh is not coarser
        assert look is (coarse if coarser else first)


@dataclass(frozen=True)
class SeenCoarsely(Unquestioning):
    """A pattern that shows on coarse surfaces only, with a maximum before its repeat."""

    finest: int

    def look(self, hole):
        seen = len(hole.positions) < self.finest
        return Look("", 1.0, fineness=(1.0, 0.5)) if seen else Look("none", 0.0)


def test_a_maximum_before_the_repeat_does_not_make_a_level_finer(fine):
    points, faces, unknown = fine
    region = region_of(points, faces, unknown)
    pipeline = replace(AUTO, tune=SeenCoarsely(len(points) // 2))
    level, look = choose_level(region, lambda _: region, pipeline)
    assert look.reason == ""
    assert level.spacing == pytest.approx(2.0, rel=0.1)


@dataclass(frozen=True)
class Short(SeenCoarsely):
    """Trusts short patches."""

    def __call__(self, hole, *_):
        return Tuned(replace(hole, wavelength=14.0, shortening=0.7), Belief())


def test_patches_are_as_long_on_the_finer_surface(fine, monkeypatch):
    points, faces, unknown = fine
    region = region_of(points, faces, unknown)
    lengths = []

    def noting(hole, *_, **__):
        edge = edge_lengths(hole.positions, hole.faces).mean()
        lengths.append(hole.wavelength * hole.shortening / (edge * len(hole.positions) ** 0.5))
        return with_recovered(hole, hole.normals, hole.unknown)

    monkeypatch.setattr(solving, "recover", noting)
    pipeline = replace(AUTO, tune=Short(len(points) // 2))
    said = {"report": lambda *_: None, "widen": lambda _: region}
    solving.solve_hole(region, pipeline, detail="calibrated", **said)
    assert len(lengths) == 2
    assert lengths[1] == pytest.approx(lengths[0], rel=0.1)


def test_patterns_of_many_edges_come_back(fine):
    """Also sharp ones, which the edges of a coarse level cut."""
    points, faces, unknown = fine
    points = points.copy()
    points[:, 2] = ridges(points)
    mesh = points, faces[~unknown[faces].any(axis=1)]
    wrong = {}
    for name, settings in {
        "level": {},
        "once": {"pipeline": replace(AUTO, finer=False)},
        "mesh": {"pipeline": replace(AUTO, level=MeshItself())},
        "smooth": {"detail": "none"},
    }.items():
        result = inpaint(*mesh, maxholesize=1000, **settings)
        new = result.vertices[result.new_vertices]
        wrong[name] = np.sqrt(((new[:, 2] - ridges(new)) ** 2).mean())
    assert wrong["level"] < 0.1 * wrong["smooth"]
    assert wrong["level"] < 0.5 * wrong["mesh"]
    assert wrong["level"] < 0.6 * wrong["once"]


def test_the_finer_level_is_half_as_coarse_and_not_finer_than_the_mesh(fine):
    points, faces, unknown = fine
    region = region_of(points, faces, unknown)
    widths = []

    def widen(width):
        widths.append(width)
        return region

    coarse = EvenLevel()(region, 3.0, rim_normals=False)
    finer = finer_level(coarse, widen, AUTO)
    assert finer.spacing == pytest.approx(0.5 * coarse.spacing, rel=0.03)
    assert widths == [coarse.spacing]
    own = finer_level(EvenLevel()(region, 2.0, rim_normals=False), widen, AUTO)
    np.testing.assert_array_equal(own.hole.positions, points)
    assert not own.is_mesh
    level = EvenLevel()(region, 1.3, rim_normals=False)
    for each in (level, MeshItself()(region, 1.0, rim_normals=False)):
        assert finer_level(each, widen, AUTO) is None
    assert finer_level(coarse, None, AUTO) is None
    assert finer_level(coarse, widen, PAPER) is None


def test_a_slope_at_the_rim_of_a_level_stays_there(uneven):
    points, faces = uneven
    unknown = np.hypot(*points[:, :2].T) < 8.0
    region = region_of(points, faces, unknown)
    level = EvenLevel()(region, 1.0, rim_normals=False)
    lifted = level.hole.positions.copy()
    away = np.hypot(*(lifted * level.spacing)[:, :2].T)
    lifted[:, 2] += 0.2 * np.maximum(10.0 - away, 0.0) * (away > 5.0)  # of its blurred edges
    moved = carried(region, level, lifted)[:, 2] - points[:, 2]
    assert np.abs(moved[np.hypot(*points[:, :2].T) < 3.0]).max() < 0.05
