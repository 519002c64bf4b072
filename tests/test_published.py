"""Published hole fillers: what defines each, and what all of them keep."""

from __future__ import annotations

import numpy as np
import pytest

import meshlab_lowrank
from meshlab_lowrank.comparison import comparing
from meshlab_lowrank.comparison.fillers import FILLERS, usual_fillers
from meshlab_lowrank.comparison.published import awang, brunton, pernot
from meshlab_lowrank.comparison.published.awang_front import (
    ONE_TRIANGLE,
    TWO_TRIANGLES,
    advanced,
)
from meshlab_lowrank.comparison.published.holes import rim_normals
from meshlab_lowrank.comparison.published.rim_unfolding import unfolded
from meshlab_lowrank.mesh.geometry import face_vectors
from meshlab_lowrank.mesh.polygons import depth_inside, sides_of, triangulated
from meshlab_lowrank.mesh.topology import border_of
from meshlab_lowrank.stages.stage0_region import cut_region
from tests.published import area, circle, filled, holes_of, punched

PUBLISHED = ["paper-bspline", "bspline", "zou", "awang", "brunton", "pernot"]
PLACED = ["bspline", "awang", "brunton", "pernot"]  # that add vertices


@pytest.fixture(scope="module")
def plane(sheet):
    points, faces = sheet(22, 20, seed=3)
    return punched(points - points.mean(axis=0), faces)


def sphere(points, faces, size, radius):
    """Part of a sphere of some size with a hole."""
    flat = (points - points.mean(axis=0))[:, :2]
    away = np.linalg.norm(flat, axis=1, keepdims=True)
    place = flat / np.maximum(away, 1e-12) * np.sin(away / size)
    vertices = size * np.concatenate([place, np.cos(away / size)], axis=1)
    return punched(vertices, faces[(away[faces, 0] < 1.45 * size).all(axis=1)], radius=radius)


@pytest.fixture(scope="module")
def ball(sheet):
    return sphere(*sheet(22, 20, seed=3), 12.0, 4.0)


@pytest.fixture(scope="module")
def bumps(sheet):
    points, faces = sheet(26, 24, seed=5)
    points = points - points.mean(axis=0)
    points[:, 2] += 0.6 * np.sin(points[:, 0]) * np.cos(0.8 * points[:, 1])
    return punched(points, faces)


def region_of(vertices, faces):
    (loop,) = holes_of(vertices, faces)
    return cut_region(vertices, faces, loop.vertices, loop.faces, reach=0.0, rings=6)


@pytest.mark.parametrize("name", ["zou", *PLACED])
def test_the_hole_is_closed_and_what_is_known_stays(name, bumps):
    vertices, faces = bumps
    found, triangles = filled(name, vertices, faces)
    np.testing.assert_array_equal(found[: len(vertices)], vertices)
    np.testing.assert_array_equal(triangles[: len(faces)], faces)
    border = border_of(triangles, len(found))
    assert border.non_manifold == border.inconsistent == 0
    assert len(holes_of(found, triangles)) == 0
    assert (len(found) > len(vertices)) == (name != "zou")
    again = filled(name, vertices, faces)
    np.testing.assert_array_equal(found, again[0])
    np.testing.assert_array_equal(triangles, again[1])


@pytest.mark.parametrize("name", ["zou", "awang", "brunton", "pernot", "bspline"])
def test_size_and_place_in_space_change_nothing(name, bumps):
    vertices, faces = bumps
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    found, triangles = filled(name, vertices, faces)
    moved, other = filled(name, 0.01 * vertices @ turn.T + 3.0, faces)
    fill = found[triangles[len(faces) :]].mean(axis=1)
    back = 100.0 * (moved - 3.0) @ turn
    fill_back = back[other[len(faces) :]].mean(axis=1)
    new = len(triangles) - len(faces)
    if name in {"pernot", "bspline"}:  # MeshLab closes them, not quite alike
        assert abs(len(other) - len(triangles)) < 0.1 * new
        apart = np.linalg.norm(fill[:, None] - fill_back, axis=2)
        assert apart.min(axis=1).max() < 0.8
        assert abs(area(found, triangles) - area(back, other)) < 0.01 * area(found, triangles)
    else:
        np.testing.assert_array_equal(other, triangles)
        np.testing.assert_allclose(back, found, atol=1e-5)


@pytest.mark.parametrize("name", PLACED)
def test_a_plane_stays_one(name, plane):
    found, _ = filled(name, *plane)
    assert np.abs(found[:, 2]).max() < 1e-6
    assert np.linalg.norm(found[len(plane[0]) :, :2], axis=1).max() < 5.0


def test_published_ones_run_only_where_they_are_named():
    assert not set(PUBLISHED) & set(usual_fillers())
    assert set(FILLERS) == {*PUBLISHED, *usual_fillers()}


def test_a_comparison_takes_the_usual_ones(plane, monkeypatch):
    monkeypatch.setattr(comparing, "usual_fillers", lambda: ["close"])
    assert list(meshlab_lowrank.compare(plane, places=0).fillers) == ["close"]


# Awang and others


@pytest.mark.parametrize("lobes", [0.0, 0.35])
def test_fronts_add_layers_inwards_by_their_angles(lobes):
    angle = 2.0 * np.pi * np.arange(60) / 60
    radius = 9.5 * (1.0 + lobes * np.sin(3.0 * angle))
    outline = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    front = advanced(outline)
    points, faces = np.array(front.points), np.array(front.triangles)
    flat = np.column_stack([points, np.zeros(len(points))])
    up = face_vectors(flat, faces)[:, 2]
    assert (up > 0.0).all()
    around = np.concatenate([flat[:60], flat[:1]])
    enclosed = 0.5 * np.cross(around[:-1], around[1:])[:, 2].sum()
    assert up.sum() == pytest.approx(enclosed, rel=1e-12)
    np.testing.assert_array_equal(points[:60], outline)

    depth = depth_inside(points[60:], outline, sides_of([np.arange(60)]))
    assert (depth > 0.4).all()
    layers = np.array(front.layers)[60:]
    means = [depth[layers == each].mean() for each in range(1, layers.max() + 1)]
    assert layers.max() >= 5
    assert (np.diff(means[:5]) > 0.4).all()
    for step in front.steps:
        if step.triangles == 0:
            continue  # parts of the front were joined
        wanted = 1 if step.angle <= ONE_TRIANGLE else 2 if step.angle <= TWO_TRIANGLES else 3
        assert (step.triangles, step.points) == (wanted, wanted - 1)
    assert {step.triangles for step in front.steps} >= {1, 2, 3}
    np.testing.assert_allclose(np.degrees([ONE_TRIANGLE, TWO_TRIANGLES]), [75.0, 135.0])


def test_a_corner_is_not_cut_off_over_a_vertex_within():
    front = advanced(np.array([[0.0, 0.0], [1.0, 4.0], [0.0, 3.7], [-1.0, 4.0]]))
    assert sorted(map(sorted, front.triangles)) == [[0, 1, 2], [0, 2, 3]]


def test_carried_normals_bend_the_fill(ball):
    region = awang.fill(region_of(*ball))
    new = region.to_global(region.vertices)[~region.known_vertices]
    away = np.linalg.norm(new, axis=1)
    rise = 12.0 - np.sqrt(12.0**2 - 4.0**2)
    assert np.abs(away - 12.0).max() < 0.25 * rise  # a flat fill misses it by the whole


# Brunton and others


def test_a_flat_convex_rim_unfolds_to_itself():
    rim = circle(24) * [3.0, 1.5, 1.0] + [0.0, 0.0, 2.0]
    flat = unfolded(rim, np.tile([0.0, 0.0, 1.0], (24, 1)))
    apart = np.linalg.norm(flat[:, None] - flat, axis=2)
    np.testing.assert_allclose(apart, np.linalg.norm(rim[:, None] - rim, axis=2), atol=1e-8)


def test_a_flat_rim_with_dents_unfolds_to_itself():
    angle = 2.0 * np.pi * np.arange(40) / 40
    rim = circle(40) * (1.0 + 0.4 * np.cos(4.0 * angle))[:, None]
    flat = unfolded(rim, np.tile([0.0, 0.0, 1.0], (40, 1)))
    apart = np.linalg.norm(flat[:, None] - flat, axis=2)
    np.testing.assert_allclose(apart, np.linalg.norm(rim[:, None] - rim, axis=2), atol=1e-8)


def test_lengths_are_kept_and_nothing_crosses(bumps):
    region = region_of(*bumps)
    rim = region.vertices[region.loop]
    flat = unfolded(rim, rim_normals(region))
    for points in (flat, rim):
        assert points.shape[0] == len(rim)
    np.testing.assert_allclose(
        np.linalg.norm(np.roll(flat, -1, axis=0) - flat, axis=1),
        np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1),
        rtol=1e-7,
    )
    points, faces = triangulated(flat, [np.arange(len(flat))], 1.0)
    assert (face_vectors(np.column_stack([points, 0.0 * points[:, 0]]), faces)[:, 2] > 0.0).all()


def test_a_rim_is_opened_up_until_it_does_not_cross_itself():
    """Its turns alone would lay it out in loops across one another."""
    along = 2.0 * np.pi * (np.arange(80) + 0.5) / 80
    ahead = along + 2.0 * np.sin(2.0 * along)
    rim = np.cumsum(np.stack([np.cos(ahead), np.sin(ahead), 0.0 * along], axis=1), axis=0)
    rim[:, 2] = 3.0 * np.cos(along)
    flat = unfolded(rim, np.tile([0.0, 0.0, 1.0], (80, 1)))
    assert triangulated(flat, [np.arange(80)], 1.0) is not None


def test_the_embedding_has_the_least_energy(bumps):
    region = region_of(*bumps)
    rim = region.vertices[region.loop]
    k = len(rim)
    flat, faces = triangulated(unfolded(rim, rim_normals(region)), [np.arange(k)], 1.0)
    outer = brunton.outer_corners(region)
    energy = brunton.bending_energy(flat, faces, rim, outer)
    found = brunton.embedded(flat, faces, rim, outer)
    values = np.concatenate([found, outer])
    gradient = (energy @ values)[k : len(flat)]
    assert np.abs(gradient).max() < 1e-8 * np.abs(energy @ np.concatenate([rim, values[k:]])).max()
    chance = np.random.default_rng(0)
    for _ in range(5):
        moved = values.copy()
        moved[k : len(flat)] += 0.1 * chance.normal(size=(len(flat) - k, 3))
        assert np.sum(moved * (energy @ moved)) > np.sum(values * (energy @ values))


def test_the_tangents_at_the_rim_go_on(ball):
    region = brunton.fill(region_of(*ball))
    new = region.to_global(region.vertices)[~region.known_vertices]
    rise = 12.0 - np.sqrt(12.0**2 - 4.0**2)
    assert np.abs(np.linalg.norm(new, axis=1) - 12.0).max() < 0.1 * rise


def test_flat_sheets_do_not_bend(plane):
    region = region_of(*plane)
    rim = region.vertices[region.loop]
    flat, faces = triangulated(unfolded(rim, rim_normals(region)), [np.arange(len(rim))], 1.0)
    outer = brunton.outer_corners(region)
    found = brunton.embedded(flat, faces, rim, outer)
    values = np.concatenate([found, outer])
    energy = brunton.bending_energy(flat, faces, rim, outer)
    assert np.sum(values * (energy @ values)) < 1e-10


# Pernot and others


@pytest.mark.parametrize(("size", "radius"), [(12.0, 4.0), (7.0, 5.3)])
def test_a_sphere_stays_one(sheet, size, radius):
    region = pernot.fill(region_of(*sphere(*sheet(22, 20, seed=3), size, radius)))
    new = region.to_global(region.vertices)[~region.known_vertices]
    rise = size - np.sqrt(size**2 - radius**2)
    assert np.abs(np.linalg.norm(new, axis=1) - size).max() < 1e-3 * rise


def test_where_it_starts_makes_little_difference(ball):
    region = pernot.fill(region_of(*ball))
    unknown = ~region.known_vertices
    start = region.vertices.copy()
    start[unknown] += 0.2 * np.random.default_rng(0).normal(size=(int(unknown.sum()), 3))
    again = pernot.least_variation(start, region.faces, unknown)
    away = np.linalg.norm(region.to_global(again), axis=1)
    assert np.abs(away - 12.0).max() < 0.05
    np.testing.assert_array_equal(again[~unknown], region.vertices[~unknown])
