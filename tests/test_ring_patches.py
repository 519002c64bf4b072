"""Patches found ring by ring, their frames and their normals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.mesh.topology import vertex_adjacency, vertex_rings
from meshlab_lowrank.stages.stage2a_frames_pca import pca_frames
from meshlab_lowrank.stages.stage2b_patches import Patches, normals_in
from meshlab_lowrank.stages.stage2b_patches_rings import (
    RingPatches,
    ring_centres,
    ring_patches,
)
from sample_meshes.shapes import make_shape

SP = 60


@pytest.fixture(scope="module")
def torus():
    return make_shape("torus", "bumps", count=2000, seed=1)


@pytest.fixture(scope="module")
def patches(torus):
    vertices, faces = torus
    return ring_patches(vertices, faces, np.arange(0, len(vertices), 7), SP)


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def members(patches):
    """Vertex of each sample, (w, sp), for patches without empty rows."""
    assert (np.diff(patches.sampler.indptr) == 1).all()
    assert (patches.sampler.data == 1.0).all()
    return patches.sampler.indices.reshape(len(patches), patches.size)


def rings_of(faces, n, centre):
    return vertex_rings(vertex_adjacency(faces, n), np.array([centre]), SP)


def lattice(rows, columns):
    """Flat sheet of right triangles in the plane z = 0, facing up."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(float)
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.stack([a, a + 1, a + columns], axis=1)
    upper = np.stack([a + 1, a + columns + 1, a + columns], axis=1)
    return vertices, np.concatenate([lower, upper])


def test_rings_come_one_after_the_other_and_only_the_last_is_cut(torus, patches):
    vertices, faces = torus
    for centre, row in zip(patches.centres, members(patches), strict=True):
        rings = rings_of(faces, len(vertices), centre)
        assert row[0] == centre
        assert len(np.unique(row)) == SP
        assert (np.diff(rings[row]) >= 0).all()
        complete = np.flatnonzero((rings >= 0) & (rings < rings[row[-1]]))
        assert np.isin(complete, row).all()


def test_rings_run_counter_clockwise_from_the_vertex_nearest_to_e1(torus, patches):
    vertices, faces = torus
    for index, row in enumerate(members(patches)):
        rings = rings_of(faces, len(vertices), row[0])
        for number in range(1, rings[row].max() + 1):
            ring = row[rings[row] == number]
            local = (vertices[ring] - vertices[row[0]]) @ patches.frames[index].T
            turn = np.arctan2(local[:, 1], local[:, 0])
            turn = np.mod(turn - turn[0], 2 * np.pi)
            assert (np.diff(turn) > 0).all()
            whole = np.flatnonzero(rings == number)
            x, y = ((vertices[whole] - vertices[row[0]]) @ patches.frames[index].T)[:, :2].T
            to_half_line = np.hypot(np.minimum(x, 0.0), y)
            assert whole[to_half_line.argmin()] == ring[0]


def test_frames_are_rotations_with_e3_outwards(torus, patches):
    vertices, faces = torus
    normals = vertex_normals(vertices, faces)
    gram = patches.frames @ patches.frames.transpose(0, 2, 1)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(3), gram.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(patches.frames), 1.0, atol=1e-12)
    assert ((patches.frames[:, 2] * normals[members(patches)].mean(axis=1)).sum(axis=1) > 0.5).all()


def test_a_rigid_motion_turns_the_frames_and_nothing_else(torus, patches):
    vertices, faces = torus
    turn = rotation(3)
    moved = ring_patches(vertices @ turn.T + [5.0, -3.0, 2.0], faces, patches.centres, SP)
    np.testing.assert_array_equal(members(moved), members(patches))
    np.testing.assert_allclose(moved.frames, patches.frames @ turn.T, atol=1e-7)
    normals = vertex_normals(vertices, faces)
    known = np.random.default_rng(0).random(len(vertices)) < 0.7
    values, mask = normals_in(patches, normals, known)
    moved_values, moved_mask = normals_in(moved, normals @ turn.T, known)
    np.testing.assert_array_equal(moved_mask, mask)
    np.testing.assert_allclose(moved_values, values, atol=1e-7)


def test_renumbering_renumbers_the_patches(torus, patches):
    vertices, faces = torus
    order = np.random.default_rng(4).permutation(len(vertices))
    number = np.argsort(order)  # new number of an old vertex
    shuffled = np.random.default_rng(5).permutation(number[faces])
    again = ring_patches(vertices[order], shuffled, number[patches.centres], SP)
    np.testing.assert_array_equal(members(again), number[members(patches)])
    np.testing.assert_allclose(again.frames, patches.frames, atol=1e-7)


def test_e1_follows_a_long_strip_and_e3_faces_up():
    vertices, faces = lattice(5, 21)
    vertices[:, 0] *= 1.3
    centre = 2 * 21 + 10
    patches = ring_patches(vertices, faces, np.array([centre]), 70)
    np.testing.assert_allclose(patches.frames[0, 2], [0, 0, 1], atol=1e-12)
    assert abs(patches.frames[0, 0, 0]) > 0.99
    row = members(patches)[0]
    assert row[1] == centre + np.sign(patches.frames[0, 0, 0])


def test_a_short_patch_ends_in_empty_rows():
    vertices, faces = lattice(3, 4)
    patches = ring_patches(vertices, faces, np.array([0, 5]), 20)
    rows = np.diff(patches.sampler.indptr).reshape(2, 20)
    np.testing.assert_array_equal(rows, np.repeat([[1] * 12 + [0] * 8], 2, axis=0))
    values, mask = normals_in(patches, vertex_normals(vertices, faces), np.ones(12, dtype=bool))
    np.testing.assert_array_equal(mask, rows == 1)
    assert not values[~mask].any()


def test_an_isolated_triangle_and_a_round_patch_get_rotations():
    flat = np.array([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(0.75), 0]])
    angle = np.arange(6) * np.pi / 3
    hexagon = np.concatenate([[[0, 0, 0]], np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)])
    fan = np.array([[0, 1 + i, 1 + (i + 1) % 6] for i in range(6)])
    for vertices, faces in ((flat, np.array([[0, 1, 2]])), (hexagon, fan)):
        frame = ring_patches(vertices, faces, np.array([0]), 7).frames[0]
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(frame[2], [0, 0, 1], atol=1e-12)


def test_centres_reach_r_rings_to_both_sides_and_all_through_the_hole():
    vertices, faces = lattice(31, 31)
    column, row = vertices[:, 0], vertices[:, 1]
    depth = np.maximum(np.abs(column - 15), np.abs(row - 15))
    inside, loop = np.flatnonzero(depth < 8), np.flatnonzero(depth == 8)
    centres = ring_centres(faces, len(vertices), loop, inside, 2)
    rings = vertex_rings(vertex_adjacency(faces, len(vertices)), loop, 2)
    np.testing.assert_array_equal(centres, np.flatnonzero((rings >= 0) | (depth < 8)))
    assert depth[centres].max() == 10


def test_a_sample_is_known_when_enough_of_its_weight_is():
    weights = sparse.csr_array([[0.5, 0.5, 0.0], [0.3, 0.7, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    patches = Patches(np.array([0]), np.eye(3)[None], weights, 4)
    normals = np.array([[np.nan] * 3, [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    values, mask = normals_in(patches, normals, np.array([False, True, True]))
    np.testing.assert_array_equal(mask, [[False, True, True, False]])
    np.testing.assert_allclose(values[0], [[0, 0, 0], [0, 0, 1], [0, 1, 0], [0, 0, 0]])


def test_e1_points_to_the_side_on_which_the_patch_reaches_further():
    # A strip along x, longer on one side; the nearest vertex lies on the other.
    along = np.array([0.0, -0.9, 1.0, 2.0, 3.0, 4.0])
    offsets = np.stack([along, 0.1 * np.array([0, 1, -1, 1, -1, 1.0]), np.zeros(6)], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (6, 1))
    for side in (1.0, -1.0):
        (frame,) = pca_frames(np.zeros(6, dtype=np.int64), side * offsets, up, 1)
        assert side * frame[0, 0] > 0.9
        np.testing.assert_allclose(frame[2], [0.0, 0.0, 1.0], atol=1e-12)
        np.testing.assert_allclose(np.cross(frame[0], frame[1]), frame[2], atol=1e-12)


def test_e1_of_an_even_patch_points_to_the_nearest_vertex():
    along = np.array([0.0, 1.0, -1.0, 2.0, -2.0])
    offsets = np.stack([along, np.zeros(5), np.zeros(5)], axis=1)
    offsets[:, 1] = [0.0, 0.1, 0.1, -0.1, -0.1]
    up = np.tile([0.0, 0.0, 1.0], (5, 1))
    for side in (1.0, -1.0):
        (frame,) = pca_frames(np.zeros(5, dtype=np.int64), offsets * [side, 1.0, 1.0], up, 1)
        assert side * frame[0, 0] > 0.9


@pytest.mark.parametrize(("angle", "flat"), [(55.0, True), (65.0, False)])
def test_e3_of_a_patch_that_leans_from_its_normals_is_their_mean(angle, flat):
    x, y = np.meshgrid([0.0, -1.0, 1.0, 2.0], [0.0, 1.0, -1.0])
    offsets = np.stack([x.ravel(), y.ravel(), np.zeros(12)], axis=1)
    lean = np.radians(angle)
    normal = np.array([np.sin(lean), 0.0, np.cos(lean)])
    (frame,) = pca_frames(np.zeros(12, dtype=np.int64), offsets, np.tile(normal, (12, 1)), 1)
    np.testing.assert_allclose(frame[2], [0.0, 0.0, 1.0] if flat else normal, atol=1e-12)
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("sp", [1, 7, 19, 37, 60, 100, 271])
def test_a_region_is_cut_as_wide_as_its_patches_reach(sp):
    # k rings around a vertex of a regular mesh hold 3 k (k + 1) others.
    k = next(k for k in range(20) if 1 + 3 * k * (k + 1) >= sp)
    assert 8 + k <= RingPatches(sp=sp, r=8).rings <= 8 + k + 2
