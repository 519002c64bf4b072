"""Fairing: nearness to known smooth surfaces, invariances, and what may not move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.mesh.energies import harmonic_energy
from meshlab_lowrank.mesh.geometry import corner_angles, face_normals
from meshlab_lowrank.mesh.topology import edges_of
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_region
from meshlab_lowrank.stages.stage1a_close_meshlab import close_region
from meshlab_lowrank.stages.stage1b_fair_harmonic import fair_region
from sample_meshes.holes import punch
from sample_meshes.shapes import make_shape


def closed_region(vertices, faces, place, radius):
    """The region of a disc cut out at a place, closed."""
    hole = punch(vertices, faces, np.asarray(place, dtype=np.float64), radius)
    loops = boundary_loops(hole.vertices, hole.faces)
    loop = next(loop for loop in loops if not loop.is_rim)
    return close_region(
        cut_region(hole.vertices, hole.faces, loop.vertices, loop.faces, reach=10.0)
    )


def flattened(region):
    """The region with its new vertices pulled to the mean plane of the loop, like a sheet."""
    rim = region.vertices[region.loop]
    centre = rim.mean(axis=0)
    normal = np.linalg.svd(rim - centre)[2][2]
    vertices = region.vertices.copy()
    new = ~region.known_vertices
    vertices[new] -= ((vertices[new] - centre) @ normal)[:, None] * normal
    return replace(region, vertices=vertices)


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


@pytest.fixture(scope="module")
def sphere():
    """A sphere about the origin with exact vertices, and its radius."""
    vertices, faces = make_shape("sphere", "smooth", count=6000)
    vertices = vertices - vertices.mean(axis=0)
    radius = np.linalg.norm(vertices, axis=1).mean()
    return radius * vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces, radius


@pytest.fixture(scope="module")
def cap(sphere):
    """The region of a missing cap of 60 degrees opening, closed."""
    vertices, faces, radius = sphere
    return closed_region(vertices, faces, (0, 0, radius), np.radians(30.0) * radius)


@pytest.fixture(scope="module")
def textured():
    vertices, faces = make_shape("torus", "bumps", count=6000, seed=1)
    return closed_region(vertices, faces, vertices[100], 8.0)


def distance_to_sphere(region, radius):
    """Distance of the new vertices from the sphere, in local units."""
    new = region.to_global(region.vertices[~region.known_vertices])
    return (np.linalg.norm(new, axis=1) - radius) / region.scale


def largest_fold(region):
    """Least cosine between the normals of two neighbouring faces of which one is new."""
    edges = edges_of(region.faces)
    order = np.argsort(edges.face_edges.ravel(), kind="stable") // 3
    first = (np.cumsum(edges.face_count) - edges.face_count)[edges.face_count == 2]
    pairs = order[first[:, None] + [0, 1]]
    pairs = pairs[~region.known_faces[pairs].all(axis=1)]
    normals = face_normals(region.vertices, region.faces)[pairs]
    return np.sum(normals[:, 0] * normals[:, 1], axis=1).min()


@pytest.mark.parametrize(("opening", "tolerance"), [(20, 0.005), (60, 0.03), (90, 0.1)])
def test_dome_over_a_missing_cap_is_near_the_sphere(sphere, opening, tolerance):
    vertices, faces, radius = sphere
    angle = np.radians(opening / 2)
    region = closed_region(vertices, faces, (0, radius, 0), angle * radius)
    height = radius / region.scale * (1.0 - np.cos(angle))
    error = distance_to_sphere(fair_region(region), radius)
    assert np.sqrt(np.mean(error**2)) < tolerance * height


@pytest.mark.parametrize("order", [2, 3])
def test_either_energy_finds_the_dome_from_a_flat_sheet(sphere, cap, order):
    sheet = flattened(cap)
    before = np.abs(distance_to_sphere(sheet, sphere[2])).max()
    after = np.abs(distance_to_sphere(fair_region(sheet, order=order), sphere[2])).max()
    assert before > 2.0
    assert after < 0.1 * before


def test_fill_of_a_torus_is_near_the_torus():
    vertices, faces = make_shape("torus", "smooth", count=6000)
    vertices = vertices - vertices.mean(axis=0)
    radii = np.hypot(vertices[:, 0], vertices[:, 1])
    ring, radius = 0.5 * (radii.max() + radii.min()), 0.5 * (radii.max() - radii.min())

    def outward(points):
        """From the centre line of the tube to points."""
        axis = points * [1.0, 1.0, 0.0]
        return points - ring * axis / np.linalg.norm(axis, axis=1, keepdims=True)

    away = outward(vertices)
    vertices += (radius / np.linalg.norm(away, axis=1, keepdims=True) - 1.0) * away
    for place in ((ring + radius, 0, 0), (0, ring - radius, 0), (0, -ring, radius)):
        fair = fair_region(closed_region(vertices, faces, place, 6.0))
        new = fair.to_global(fair.vertices[~fair.known_vertices])
        error = (np.linalg.norm(outward(new), axis=1) - radius) / fair.scale
        assert np.sqrt(np.mean(error**2)) < 0.06


def test_known_vertices_and_faces_stay(cap):
    fair = fair_region(cap)
    known = cap.known_vertices
    np.testing.assert_array_equal(fair.vertices[known], cap.vertices[known])
    np.testing.assert_array_equal(fair.faces, cap.faces)
    assert (fair.vertices[~known] != cap.vertices[~known]).any()


def test_nothing_to_move(sphere):
    vertices, faces, _ = sphere
    loop = boundary_loops(vertices, faces[1:])[0]
    region = close_region(cut_region(vertices, faces[1:], loop.vertices, loop.faces, reach=5.0))
    np.testing.assert_array_equal(fair_region(region).vertices, region.vertices)


def test_plane_stays_a_plane():
    vertices, faces = make_shape("sphere", "smooth", count=2000)
    flat = vertices * np.array([1.0, 1.0, 0.0])
    region = closed_region(flat, faces[face_normals(flat, faces)[:, 2] > 0.0], (0, 0, 0), 4.0)
    fair = fair_region(region)
    assert (
        np.abs(fair.vertices[~fair.known_vertices][:, 2] - region.vertices[region.loop[0], 2]).max()
        < 1e-4
    )


def test_fairing_again_changes_little(cap, textured):
    for region in (cap, textured):
        once = fair_region(region)
        twice = fair_region(once)
        assert np.abs(twice.vertices - once.vertices).max() < 0.1


def test_result_turns_with_the_region(textured):
    turn = rotation(2)
    turned = fair_region(replace(textured, vertices=textured.vertices @ turn.T))
    expected = fair_region(textured).vertices @ turn.T
    np.testing.assert_allclose(turned.vertices, expected, atol=1e-6)


def test_result_does_not_depend_on_the_numbering(textured):
    chance = np.random.default_rng(0)
    number = chance.permutation(len(textured.vertices))
    vertices, known = np.empty_like(textured.vertices), np.empty_like(textured.known_vertices)
    vertices[number], known[number] = textured.vertices, textured.known_vertices
    shuffled = replace(
        textured, vertices=vertices, known_vertices=known, faces=number[textured.faces]
    )
    result = fair_region(shuffled).vertices[number]
    np.testing.assert_allclose(result, fair_region(textured).vertices, atol=1e-6)


def test_triangles_stay_good_and_nothing_folds(cap, textured):
    for region in (cap, textured):
        fair = fair_region(region)
        before, after = (
            corner_angles(r.vertices, r.faces[~r.known_faces]).min() for r in (region, fair)
        )
        assert after > 0.7 * before
        assert largest_fold(fair) > 0.5


def test_smooth_surroundings_take_the_higher_order_and_rough_ones_do_not(sphere, textured):
    vertices, faces, radius = sphere
    smooth = closed_region(vertices, faces, (radius, 0, 0), np.radians(45.0) * radius)
    for region, order in ((smooth, 3), (textured, 2)):
        chosen = fair_region(region).vertices
        np.testing.assert_array_equal(chosen, fair_region(region, order=order).vertices)
        assert np.abs(chosen - fair_region(region, order=5 - order).vertices).max() > 1e-3


def test_energy_is_symmetric_positive_and_blind_to_planes(textured):
    vertices, faces = textured.vertices, textured.faces
    for order in (2, 3):
        energy = harmonic_energy(vertices, faces, order)
        assert abs(energy - energy.T).max() <= 1e-12 * abs(energy).max()
        values = np.random.default_rng(0).normal(size=len(vertices))
        assert values @ (energy @ values) > 0.0
        flat = harmonic_energy(vertices * [1.0, 1.0, 0.0], faces, order)
        np.testing.assert_allclose(energy @ np.ones(len(vertices)), 0.0, atol=1e-6)
        assert flat.shape == energy.shape
