"""Heights from normals by Gauss-Newton."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.mesh.geometry import face_normals, normalized, vertex_normals
from meshlab_lowrank.mesh.topology import vertex_adjacency
from meshlab_lowrank.stages.stage6b_update_direct import (
    FACE_WEIGHT,
    _fit,
    _linearised,
    direct_update,
)
from meshlab_lowrank.stages.stage7_finish_without_flaws import without_folds
from sample_meshes.shapes import make_shape


@pytest.fixture(scope="module")
def torus():
    """Bumpy torus with a disc that is to be recovered: truth, faces, directions, movable."""
    truth, faces = make_shape("torus", "bumps", count=2000, seed=1)
    adjacency = vertex_adjacency(faces, len(truth))
    directions = vertex_normals(truth, faces)
    for _ in range(6):
        directions = normalized(adjacency @ directions)
    movable = np.linalg.norm(truth - truth[500], axis=1) < 6.0
    return truth, faces, directions, movable


@pytest.fixture(scope="module")
def displaced(torus):
    """The disc moved up and down by waves along the directions."""
    truth, _, directions, movable = torus
    height = 0.5 * np.sin(truth @ [0.9, 0.4, 0.3]) + 0.3
    return truth + np.where(movable, height, 0.0)[:, None] * directions


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_exact_normals_bring_the_heights_back(torus, displaced):
    truth, faces, directions, movable = torus
    result = direct_update(
        displaced,
        faces,
        directions=directions,
        movable=movable,
        normals=vertex_normals(truth, faces),
        trusted=np.ones(len(truth), dtype=bool),
        steps=12,
    )
    assert rms(result - truth) < 0.05 * rms(displaced - truth)


def test_each_step_brings_the_normals_nearer(torus, displaced):
    truth, faces, directions, movable = torus
    wanted = vertex_normals(truth, faces)
    errors = []
    for steps in range(5):
        result = direct_update(
            displaced,
            faces,
            directions=directions,
            movable=movable,
            normals=wanted,
            trusted=np.ones(len(truth), dtype=bool),
            steps=steps,
        )
        errors.append(rms(vertex_normals(result, faces) - wanted))
    assert (np.diff(errors) < 0).all()


def test_only_movable_vertices_move_and_only_along_their_directions(torus, displaced):
    truth, faces, directions, movable = torus
    before = displaced.copy()
    result = direct_update(
        displaced,
        faces,
        directions=directions,
        movable=movable,
        normals=vertex_normals(truth, faces),
        trusted=np.ones(len(truth), dtype=bool),
    )
    np.testing.assert_array_equal(displaced, before)
    assert result[~movable].tobytes() == displaced[~movable].tobytes()
    move = result - displaced
    np.testing.assert_allclose(np.cross(move, directions), 0.0, atol=1e-12)
    assert (np.abs(move[movable]).max(axis=1) > 0).all()


def test_normals_that_are_not_trusted_or_far_away_are_not_read(torus, displaced):
    truth, faces, directions, movable = torus
    wanted = vertex_normals(truth, faces)
    trusted = np.random.default_rng(0).uniform(size=len(truth)) < 0.8
    options = {"directions": directions, "movable": movable, "trusted": trusted}
    expected = direct_update(displaced, faces, normals=wanted, **options)
    far = np.linalg.norm(truth - truth[500], axis=1) > 9.0
    spoiled = np.where((far | ~trusted)[:, None], [[1.0, 0.0, 0.0]], wanted)
    np.testing.assert_array_equal(
        direct_update(displaced, faces, normals=spoiled, **options), expected
    )


@pytest.mark.parametrize(("face_weight", "most"), [(0.0, 1e-12), (None, 0.1)])
def test_a_surface_with_the_right_normals_stays(torus, face_weight, most):
    truth, faces, directions, movable = torus
    result = direct_update(
        truth,
        faces,
        directions=directions,
        movable=movable,
        normals=vertex_normals(truth, faces),
        trusted=np.ones(len(truth), dtype=bool),
        **({} if face_weight is None else {"face_weight": face_weight}),
    )
    assert rms(result - truth) <= most


def test_a_flat_sheet_that_was_roughened_is_flat_again(sheet):
    points, faces = sheet(20, 20)
    movable = np.linalg.norm(points - points.mean(axis=0), axis=1) < 6.0
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    noise = np.random.default_rng(0).normal(0.0, 0.2, len(points)) * movable
    result = direct_update(
        points + noise[:, None] * up,
        faces,
        directions=up,
        movable=movable,
        normals=up,
        trusted=np.ones(len(points), dtype=bool),
    )
    assert rms(result[movable, 2]) < 0.05 * rms(noise[movable])


def test_it_moves_with_the_mesh(torus, displaced):
    truth, faces, directions, movable = torus
    q, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn = q * np.sign(np.linalg.det(q))
    wanted = vertex_normals(truth, faces)
    trusted = np.ones(len(truth), dtype=bool)
    expected = direct_update(
        displaced, faces, directions=directions, movable=movable, normals=wanted, trusted=trusted
    )
    moved = direct_update(
        displaced @ turn.T + 2.0,
        faces,
        directions=directions @ turn.T,
        movable=movable,
        normals=wanted @ turn.T,
        trusted=trusted,
    )
    np.testing.assert_allclose(moved, expected @ turn.T + 2.0, atol=1e-8)


def test_the_jacobian_is_that_of_finite_differences(torus, displaced):
    truth, faces, directions, movable = torus
    wanted = vertex_normals(truth, faces)
    free = np.flatnonzero(movable)[::3]
    seen = np.linalg.norm(truth - truth[500], axis=1) < 7.0
    column = np.full(len(truth), -1)
    column[free] = np.arange(len(free))
    near = faces[seen[faces].any(axis=1)]
    fit = _fit(near, seen, movable, wanted, FACE_WEIGHT)

    def residual(heights):
        positions = displaced.copy()
        positions[free] += heights[:, None] * directions[free]
        return _linearised(positions, near, directions, column, fit)

    at = np.zeros(len(free))
    found, jacobian = residual(at)
    assert len(fit.weights) > seen.sum()  # faces are fitted too
    assert found.shape == (2 * len(fit.weights),)
    assert jacobian.shape == (2 * len(fit.weights), len(free))
    step = 1e-6
    for index in range(0, len(free), 4):
        at[index] = step
        ahead = residual(at)[0]
        at[index] = -step
        behind = residual(at)[0]
        at[index] = 0.0
        expected = (ahead - behind) / (2.0 * step)
        np.testing.assert_allclose(jacobian[:, [index]].toarray()[:, 0], expected, atol=1e-7)


def test_folds_are_taken_back() -> None:
    axis = np.arange(7.0)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    start = np.stack([x.ravel(), y.ravel(), np.zeros(49)], axis=1)
    corner = (np.arange(6)[:, None] * 7 + np.arange(6)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + 7, corner + 8], axis=1),
            np.stack([corner, corner + 8, corner + 1], axis=1),
        ]
    )
    up = np.tile([0.0, 0.0, 1.0], (49, 1))
    moved = start.copy()
    moved[24] += [3.0, 0.0, 0.5]  # past its neighbours
    mended = without_folds(start, moved, faces, up)
    assert (face_normals(moved, faces)[:, 2] < 0).any()
    assert (face_normals(mended, faces)[:, 2] > 0).all()
    assert np.array_equal(mended[:24], start[:24])
    assert np.array_equal(without_folds(start, start, faces, up), start)
