"""Vertices from normals by the usual iteration."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.stages.stage6b_update_iterative import iterative_update
from sample_meshes.shapes import make_shape


@pytest.fixture(scope="module")
def damaged():
    """Torus with a disc pushed in along the normals: truth, start, faces, normals, movable."""
    truth, faces = make_shape("torus", "bumps", count=2000, seed=1)
    normals = vertex_normals(truth, faces)
    distance = np.linalg.norm(truth - truth[500], axis=1)
    movable = distance < 6.0
    dent = np.where(movable, np.cos(np.minimum(distance / 6.0, 1.0) * np.pi / 2), 0.0)
    start = np.where(movable[:, None], truth - 0.8 * dent[:, None] * normals, truth)
    return truth, start, faces, normals, movable


def offset(positions, damaged):
    truth, _, _, normals, movable = damaged
    along = ((positions - truth) * normals).sum(axis=1)[movable]
    return np.sqrt(np.mean(along**2))


def test_exact_normals_bring_the_positions_back(damaged):
    _, start, faces, normals, movable = damaged
    errors = [offset(start, damaged)]
    iterative_update(
        start,
        faces,
        normals,
        movable,
        niter=400,
        callback=lambda x: errors.append(offset(x, damaged)),
    )
    assert errors[20] < 0.7 * errors[0]
    assert errors[100] < 0.4 * errors[0]
    assert errors[400] < 0.25 * errors[0]


def test_what_is_known_stays_bit_for_bit(damaged):
    _, start, faces, normals, movable = damaged
    before = start.copy()
    result = iterative_update(start, faces, normals, movable)
    np.testing.assert_array_equal(result[~movable], start[~movable])
    np.testing.assert_array_equal(start, before)
    assert (result[movable] != start[movable]).any(axis=1).all()


def test_it_moves_with_the_mesh(damaged):
    _, start, faces, normals, movable = damaged
    turn, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    expected = iterative_update(start, faces, normals, movable) @ turn.T * 3.0 + 1.0
    result = iterative_update(start @ turn.T * 3.0 + 1.0, faces, normals @ turn.T, movable)
    np.testing.assert_allclose(result, expected, atol=1e-11)


def test_the_error_of_edges_against_normals_never_rises(damaged):
    _, start, faces, normals, movable = damaged
    corners = normals[faces].sum(axis=1)
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)

    def energy(x):
        edges = np.roll(x[faces], -1, axis=1) - x[faces]
        return np.sum((edges * corners[:, None]).sum(axis=2) ** 2)

    energies = [energy(start)]
    iterative_update(start, faces, normals, movable, callback=lambda x: energies.append(energy(x)))
    assert (np.diff(energies) < 0).all()


def test_a_flat_sheet_stays_and_stops_at_once():
    x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    a = (np.arange(5)[:, None] * 6 + np.arange(5)).ravel()
    faces = np.concatenate(
        [np.stack([a, a + 1, a + 6], axis=1), np.stack([a + 1, a + 7, a + 6], axis=1)]
    )
    movable = np.zeros(36, dtype=bool)
    movable[14] = True
    steps = []
    up = np.tile([0.0, 0.0, 1.0], (36, 1))
    result = iterative_update(vertices, faces, up, movable, callback=lambda _: steps.append(1))
    np.testing.assert_array_equal(result, vertices)
    assert len(steps) == 1


def test_nothing_to_move(damaged):
    _, start, faces, normals, movable = damaged
    result = iterative_update(start, faces, normals, np.zeros_like(movable))
    np.testing.assert_array_equal(result, start)
    assert result is not start
