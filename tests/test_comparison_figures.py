"""Figures of the comparison against known offsets and an independent computation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay

from meshlab_lowrank.comparison.crossings import count_crossing_faces
from meshlab_lowrank.comparison.figures import (
    SurfacePart,
    degenerate_faces,
    error_figures,
    flipped_faces,
    mean_dihedral_angle,
    rim_angle,
    shape_figures,
)
from meshlab_lowrank.comparison.roughness import detail_energy
from meshlab_lowrank.mesh.distance import TriangleIndex, closest_on_triangles
from meshlab_lowrank.mesh.triangle_sampling import sample_surface


def sheet(height=lambda _x, _y: 0.0, *, half=20, seed=0, jitter=0.25):
    """A square sheet of unit edges with jittered vertices and the disc in its middle."""
    grid = np.arange(-half, half + 1.0)
    x, y = (a.ravel() for a in np.meshgrid(grid, grid))
    inner = (np.abs(x) < half) & (np.abs(y) < half)
    moves = np.random.default_rng(seed).uniform(-jitter, jitter, (2, len(x))) * inner
    x, y = x + moves[0], y + moves[1]
    faces = Delaunay(np.stack([x, y], 1)).simplices.astype(np.int64)
    a, b, c = (np.stack([x, y], 1)[faces[:, i]] for i in range(3))
    turned = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces[turned] = faces[turned][:, ::-1]
    vertices = np.stack([x, y, np.broadcast_to(height(x, y), x.shape)], axis=1)
    return vertices, faces


def disc(vertices, faces, radius=8.0):
    return SurfacePart(
        vertices, faces, np.linalg.norm(vertices[faces].mean(1)[:, :2], axis=1) < radius
    )


def sphere(radius, subdivisions=4):
    """An icosphere, all of it."""
    golden = (1 + 5**0.5) / 2
    corners = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    corners += [(c, a, b) for a, b, c in corners] + [(b, c, a) for a, b, c in corners]
    vertices = np.array(corners, dtype=float)
    for _ in range(subdivisions):
        hull = ConvexHull(vertices).simplices
        edges = np.unique(np.sort(hull[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
        vertices = np.concatenate([vertices, vertices[edges].sum(axis=1)])
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    faces = ConvexHull(vertices).simplices.astype(np.int64)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = np.einsum("md,md->m", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return SurfacePart(
        radius * vertices / np.linalg.norm(vertices, axis=1)[:, None], faces, inward | True
    )


def waves(amplitude, wavelength=10.0):
    def height(x, y):
        return amplitude * np.cos(2 * np.pi * x / wavelength) * np.cos(2 * np.pi * y / wavelength)

    return height


def test_closest_points_match_brute_force():
    rng = np.random.default_rng(1)
    vertices = rng.normal(size=(60, 3)) * [5.0, 1.0, 0.1]  # long and thin triangles
    faces = rng.permuted(np.tile(np.arange(60), (80, 1)), axis=1)[:, :3]
    points = rng.normal(size=(200, 3)) * 6
    found = TriangleIndex(vertices, faces).closest(points)
    pairs = np.repeat(points, 80, axis=0), np.tile(vertices[faces], (200, 1, 1))
    brute = closest_on_triangles(*pairs)[0].reshape(200, 80).min(axis=1)
    np.testing.assert_allclose(found.distances, brute, rtol=0, atol=1e-12)
    places = np.einsum("pc,pcd->pd", found.barycentric, vertices[faces][found.faces])
    np.testing.assert_allclose(np.linalg.norm(places - points, axis=1), brute, atol=1e-9)


def test_distance_to_a_triangle_is_a_minimum_over_its_points():
    rng = np.random.default_rng(2)
    corners, points = rng.normal(size=(50, 3, 3)), 2 * rng.normal(size=(50, 3))
    distances, barycentric = closest_on_triangles(points, corners)
    assert barycentric.min() >= 0
    np.testing.assert_allclose(barycentric.sum(axis=1), 1.0)
    others = rng.dirichlet(np.ones(3), size=2000)
    places = np.einsum("sc,pcd->psd", others, corners)
    sampled = np.linalg.norm(places - points[:, None], axis=2).min(axis=1)
    assert (distances <= sampled + 1e-12).all()
    assert (sampled - distances).max() < 0.2


def test_samples_are_even():
    vertices, faces = sheet(half=10)
    samples = sample_surface(vertices, faces, 0.25)
    counts, _, _ = np.histogram2d(*samples.points[:, :2].T, bins=10, range=[[-10, 10]] * 2)
    assert len(samples.points) == 6400
    assert np.abs(counts / 64 - 1).max() < 0.2
    np.testing.assert_allclose(samples.points.mean(axis=0), 0.0, atol=0.02)


@pytest.mark.parametrize("offset", [0.1, 1.0, 5.0])
def test_offset_planes_are_their_offset_apart(offset):
    truth = disc(*sheet())
    moved = SurfacePart(truth.vertices + np.array([0, 0, offset]), truth.faces, truth.part)
    figures = error_figures(moved, truth, 1.0)
    assert figures.rms == pytest.approx(offset, rel=1e-12)
    assert figures.maximum == pytest.approx(offset, rel=1e-12)
    assert figures.normal_error == pytest.approx(0.0, abs=1e-9)


def test_concentric_spheres_are_their_radii_apart():
    inner, outer = sphere(10.0), sphere(10.5)
    figures = error_figures(outer, inner, 1.2)
    assert figures.rms == pytest.approx(0.5, rel=0.01)
    assert figures.maximum == pytest.approx(0.5, rel=0.03)
    assert figures.normal_error < 1.0


def test_the_truth_in_another_order_scores_nothing():
    truth = disc(*sheet(waves(1.0)))
    rng = np.random.default_rng(3)
    shuffle, relabel = rng.permutation(len(truth.faces)), rng.permutation(len(truth.vertices))
    vertices = np.empty_like(truth.vertices)
    vertices[relabel] = truth.vertices
    same = SurfacePart(vertices, relabel[truth.faces][shuffle], truth.part[shuffle])
    figures = error_figures(same, truth, 1.0)
    assert figures.maximum < 1e-12
    assert figures.normal_error < 1e-6
    assert figures.roughness == pytest.approx(1.0, abs=0.05)


def test_a_tilt_shows_as_normal_error():
    truth = disc(*sheet())
    angle = np.radians(10.0)
    turn = np.array(
        [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    )
    tilted = SurfacePart(truth.vertices @ turn.T, truth.faces, truth.part)
    assert error_figures(tilted, truth, 1.0).normal_error == pytest.approx(10.0, rel=1e-6)


@pytest.mark.parametrize("share", [0.5, 1.2])
def test_roughness_is_the_square_of_the_amplitude(share):
    truth = disc(*sheet(waves(0.8), half=26), radius=12.0)
    other = disc(*sheet(waves(0.8 * share), half=26, seed=5), radius=12.0)
    assert error_figures(other, truth, 1.0).roughness == pytest.approx(share**2, rel=0.1)


def test_roughness_does_not_depend_on_phase_nor_on_triangles():
    truth = disc(*sheet(waves(0.8), half=35), radius=15.0)
    shifted = disc(*sheet(lambda x, y: waves(0.8)(x + 5, y), half=35, seed=9), radius=15.0)
    figures = error_figures(shifted, truth, 1.0)
    assert figures.roughness == pytest.approx(1.0, abs=0.08)
    assert figures.rms > 0.3


def test_dihedral_ratio_is_one_for_the_same_relief_in_another_phase():
    truth = disc(*sheet(waves(0.8), half=35), radius=15.0)
    shifted = disc(*sheet(lambda x, y: waves(0.8)(x + 5, y), half=35, seed=9), radius=15.0)
    figures = error_figures(shifted, truth, 1.0)
    assert figures.dihedral == pytest.approx(1.0, abs=0.08)
    assert figures.looks_right is True


def test_crumpled_and_smooth_do_not_look_right():
    truth = disc(*sheet(waves(0.8), half=26), radius=12.0)
    noise = np.random.default_rng(2).normal(0.0, 0.15, len(truth.vertices))
    crumpled = disc(*sheet(waves(0.8), half=26), radius=12.0)
    crumpled.vertices[:, 2] += noise
    figures = error_figures(crumpled, truth, 1.0)
    assert 0.7 <= figures.roughness <= 1.25
    assert figures.dihedral > 1.2
    assert figures.looks_right is False
    flat = error_figures(disc(*sheet(half=26), radius=12.0), truth, 1.0)
    assert flat.dihedral == pytest.approx(0.0, abs=1e-6)
    assert flat.looks_right is False


def test_mean_dihedral_angle_of_a_roof_is_that_of_its_ridge():
    ridge = np.array([[0.0, 0, 0], [0, 1, 0]])
    slope = np.radians(15.0)
    eaves = np.array([[np.cos(slope), 0.5, -np.sin(slope)], [-np.cos(slope), 0.5, -np.sin(slope)]])
    roof = SurfacePart(
        np.concatenate([ridge, eaves]), np.array([[0, 2, 1], [0, 1, 3]]), np.ones(2, dtype=bool)
    )
    assert mean_dihedral_angle(roof) == pytest.approx(30.0)
    alone = SurfacePart(roof.vertices, roof.faces, np.array([True, False]))
    assert np.isnan(mean_dihedral_angle(alone))


def test_a_sphere_has_no_detail():
    ball = sphere(30.0)
    top = ball.vertices[ball.faces].mean(axis=1)[:, 2] > 25
    energy = detail_energy(SurfacePart(ball.vertices, ball.faces, top), 1.5)
    assert np.sqrt(energy.inside) < 0.03 * 1.5
    assert np.sqrt(energy.around) < 0.03 * 1.5


def test_roughness_is_not_a_number_without_detail():
    flat = disc(*sheet())
    assert np.isnan(error_figures(flat, flat, 1.0).roughness)
    assert np.isnan(shape_figures(flat, 1.0).roughness)
    assert np.isnan(error_figures(flat, flat, 1.0).dihedral)
    assert error_figures(flat, flat, 1.0).looks_right is None


def test_an_empty_fill_has_no_figures():
    truth = disc(*sheet())
    empty = SurfacePart(truth.vertices, truth.faces, np.zeros(len(truth.faces), dtype=bool))
    assert np.isnan(list(error_figures(empty, truth, 1.0).as_dict().values())).all()
    assert shape_figures(empty, 1.0).self_crossing == 0


def test_a_clean_fill_counts_nothing_wrong():
    figures = shape_figures(disc(*sheet(waves(0.5), half=30)), 1.0)
    assert (figures.flipped, figures.degenerate, figures.self_crossing) == (0, 0, 0)
    assert figures.roughness == pytest.approx(1.0, abs=0.15)
    assert figures.rim_angle < 60


def test_a_fold_is_flipped():
    fill = disc(*sheet())
    vertices = fill.vertices.copy()
    centre = np.argmin(np.linalg.norm(vertices, axis=1))
    vertices[centre] += [1.6, 0.1, 0.05]
    folded = SurfacePart(vertices, fill.faces, fill.part)
    assert shape_figures(folded, 1.0).flipped >= 1
    assert not flipped_faces(fill.vertices, fill.faces).any()


def test_a_triangle_through_a_sheet_crosses_it():
    fill = disc(*sheet())
    spike = [[0.1, 0.2, -3], [0.2, 0.1, -3], [0.15, 0.3, 3]]
    vertices = np.concatenate([fill.vertices, spike])
    faces = np.concatenate([fill.faces, [len(fill.vertices) + np.arange(3)]])
    triangle = np.arange(len(faces)) == len(fill.faces)
    assert count_crossing_faces(vertices, faces, triangle) == 1
    assert 1 <= count_crossing_faces(vertices, faces, ~triangle) <= 6
    assert count_crossing_faces(fill.vertices, fill.faces, fill.part) == 0


def test_a_collapsed_edge_is_degenerate():
    vertices, faces = sheet(half=3, jitter=0.0)
    assert not degenerate_faces(vertices, faces).any()
    vertices[faces[0, 0]] = vertices[faces[0, 1]]
    assert degenerate_faces(vertices, faces).sum() == 2


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 150.0])
def test_rim_angle_of_a_hinge(angle):
    turn = np.radians(angle)
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, -1, 0], [0, np.cos(turn), np.sin(turn)]])
    faces = np.array([[0, 2, 1], [0, 1, 3]])
    hinge = SurfacePart(vertices, faces, np.array([False, True]))
    assert rim_angle(hinge) == pytest.approx(angle, abs=1e-9)


def test_rim_angle_without_a_rim():
    assert np.isnan(rim_angle(sphere(1.0, 0)))
