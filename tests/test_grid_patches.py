"""Patches on a hexagonal grid: turns, barycentric sampling, and what lies beyond the border."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.mesh.topology import boundary_vertices
from meshlab_lowrank.stages.stage2a_frames_base import BaseFrames
from meshlab_lowrank.stages.stage2b_patches import normals_in
from meshlab_lowrank.stages.stage2b_patches_grid import GridLayer, SurfaceLocator, hexagonal_grid
from sample_meshes.shapes import make_shape
from tests.builders import hole_of


@pytest.fixture(scope="module")
def torus():
    return make_shape("torus", "smooth", count=3000)


@pytest.fixture(scope="module")
def flat(sheet):
    vertices, faces = sheet(30, 30, jitter=0.2)
    return vertices, faces, SurfaceLocator(vertices, faces)


def layer_of(vertices, faces, normals, grid):
    hole = hole_of(vertices, faces, np.zeros(len(vertices), dtype=bool))
    return GridLayer(replace(hole, base_normals=normals), grid, 4.0, BaseFrames())


def turned(points, angle):
    cosine, sine = np.cos(angle), np.sin(angle)
    return points @ np.array([[cosine, sine], [-sine, cosine]])


@pytest.mark.parametrize(("radius", "spacing"), [(1.0, 1.0), (5.0, 1.0), (6.0, 0.7), (4.2, 1.3)])
def test_the_grid_fills_the_disc(radius, spacing):
    grid = hexagonal_grid(radius, spacing)
    lengths = np.hypot(*grid.offsets.T)
    assert grid.size == len(np.unique(grid.offsets.round(6), axis=0))
    np.testing.assert_array_equal(grid.offsets[0], 0.0)
    assert lengths.max() <= radius * (1.0 + 1e-6)
    pairs = cKDTree(grid.offsets).query(grid.offsets, k=2)[0][:, 1]
    np.testing.assert_allclose(pairs, spacing, rtol=1e-9)
    reach = np.linspace(-radius, radius, 60)
    inside = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
    inside = inside[np.hypot(*inside.T) < radius - spacing]
    if len(inside):  # no lattice point is left out
        assert cKDTree(grid.offsets).query(inside)[0].max() <= spacing / np.sqrt(3.0) + 1e-9


@pytest.mark.parametrize(("radius", "spacing"), [(1.0, 1.0), (5.0, 1.0), (6.0, 0.7)])
def test_turns_are_permutations_that_rotate_by_sixty_degrees(radius, spacing):
    grid = hexagonal_grid(radius, spacing)
    assert grid.turns.shape == (6, grid.size)
    for number, turn in enumerate(grid.turns):
        np.testing.assert_array_equal(np.sort(turn), np.arange(grid.size))
        expected = turned(grid.offsets, number * np.pi / 3.0)
        np.testing.assert_allclose(grid.offsets[turn], expected, atol=1e-9)


def test_weights_reproduce_points_on_the_surface(torus):
    vertices, faces = torus
    chance = np.random.default_rng(0)
    shares = chance.dirichlet(np.ones(3), size=500)
    # A point in a face near a corner of it: the nearest vertex is one of the face's own.
    shares = 0.5 * shares + 0.5 * np.eye(3)[chance.integers(0, 3, 500)]
    chosen = chance.integers(0, len(faces), 500)
    points = np.einsum("sc,scd->sd", shares, vertices[faces[chosen]])
    weights = SurfaceLocator(vertices, faces).weights(points)
    assert weights.data.min() >= 0.0
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(weights @ vertices, points, atol=0.02)


def test_weights_are_exact_in_a_plane(flat):
    vertices, _, locator = flat
    low, high = np.array([2.0, 2.0, -0.3]), np.array([26.0, 22.0, 0.3])
    points = np.random.default_rng(1).uniform(low, high, (800, 3))
    weights = locator.weights(points)
    assert weights.data.min() >= 0.0
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    below = points * [1.0, 1.0, 0.0]
    error = np.linalg.norm(weights @ vertices - below, axis=1)
    assert np.mean(error < 1e-9) > 0.98  # some lie in a face that is not at the nearest vertex
    assert error.max() < 0.3


def test_every_vertex_is_its_own_sample(torus):
    vertices, faces = torus
    weights = SurfaceLocator(vertices, faces).weights(vertices)
    np.testing.assert_allclose(weights @ vertices, vertices, atol=1e-9)


def test_points_beyond_the_border_have_no_weights(flat):
    vertices, _, locator = flat
    high = vertices.max(axis=0)
    outside = np.stack([np.full(50, high[0] + 3.0), np.linspace(2.0, 20.0, 50), np.zeros(50)], 1)
    assert (locator.weights(outside).toarray() == 0.0).all()


def test_vertices_without_faces_are_never_used(flat):
    vertices, faces, locator = flat
    stray = np.concatenate([vertices, [[10.0, 10.0, 0.01]]])
    points = np.random.default_rng(3).uniform(9.0, 11.0, (100, 3)) * [1.0, 1.0, 0.0]
    weights = SurfaceLocator(stray, faces).weights(points)
    assert weights.shape == (100, len(stray))
    np.testing.assert_array_equal(
        weights[:, : len(vertices)].toarray(), locator.weights(points).toarray()
    )


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_patches_lie_in_the_tangent_plane(flat, angle):
    vertices, faces, _ = flat
    grid = hexagonal_grid(4.0, 1.0)
    normals = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    centres = np.flatnonzero(np.abs(vertices[:, :2] - 13.0).max(axis=1) < 5.0)
    patches = layer_of(vertices, faces, normals, grid).at(centres, angle)
    assert patches.size == grid.size
    assert len(patches) == len(centres)
    found = (patches.sampler @ vertices).reshape(len(centres), grid.size, 3)
    local = (found - vertices[centres][:, None]) @ patches.frames.transpose(0, 2, 1)
    error = np.linalg.norm(local[..., :2] - grid.offsets, axis=2)
    assert np.mean(error < 1e-9) > 0.95
    assert error.max() < 0.4
    assert not boundary_vertices(faces, len(vertices))[centres].any()


def test_the_angle_turns_the_grid_about_the_normal(torus):
    vertices, faces = torus
    normals = vertex_normals(vertices, faces)
    layer = layer_of(vertices, faces, normals, hexagonal_grid(3.0, 1.0))
    centres = np.arange(0, len(vertices), 50)
    frames = layer.at(centres).frames
    np.testing.assert_allclose(
        frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (len(centres), 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(frames), 1.0)
    np.testing.assert_allclose(frames[:, 2], normals[centres], atol=1e-12)
    further = layer.at(centres, 0.7).frames
    np.testing.assert_allclose(further[:, 2], frames[:, 2])
    expected = np.cos(0.7) * frames[:, 0] + np.sin(0.7) * frames[:, 1]
    np.testing.assert_allclose(further[:, 0], expected, atol=1e-12)


def test_a_turn_of_the_mesh_turns_no_patch(torus):
    vertices, faces = torus
    q, _ = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))
    turn = q * np.sign(np.linalg.det(q))
    normals = vertex_normals(vertices, faces)
    grid, centres = hexagonal_grid(4.0, 1.0), np.arange(0, len(vertices), 60)
    known = np.ones(len(vertices), dtype=bool)

    def upright(points, directions):
        patches = layer_of(points, faces, directions, grid).at(centres)
        values, mask = normals_in(patches, directions, known)
        assert mask.all()
        return values[..., 2].mean(axis=1)  # doesn't depend on the tangents, but for the lattice

    before, after = upright(vertices, normals), upright(vertices @ turn.T, normals @ turn.T)
    np.testing.assert_allclose(before, after, atol=0.03)
