"""Iterative diffusion, and the paper's stages together on one hole."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.hole import start_state
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.ring_solver import recover_detail
from meshlab_lowrank.stages.stage2_patches import normals_in
from meshlab_lowrank.stages.stage2_patches_rings import ring_patches
from meshlab_lowrank.stages.stage3_similar_npc import global_matrix
from meshlab_lowrank.stages.stage4_complete_svt import svt_complete
from meshlab_lowrank.stages.stage4_diffuse_rounds import average_at_vertices, iterative_diffusion
from sample_meshes.shapes import make_shape

SP = 40


@pytest.fixture(scope="module")
def hole():
    """Torus, its normals, which vertices are known, and patches around and in the hole."""
    vertices, faces = make_shape("torus", "bumps", count=2000, seed=1)
    distance = np.linalg.norm(vertices - vertices[500], axis=1)
    patches = ring_patches(vertices, faces, np.flatnonzero(distance < 11.0), SP)
    return vertices, faces, vertex_normals(vertices, faces), distance >= 6.5, patches


def angles(a, b):
    return np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1.0, 1.0)))


def test_all_is_recovered_and_what_is_known_stays(hole):
    _, _, normals, known, patches = hole
    start, present = normals_in(patches, normals, known)
    assert (~present).all(axis=1).any()  # patches wholly inside the hole
    missing = []
    values, mask = iterative_diffusion(
        patches, normals, known, k=8, complete=svt_complete, callback=missing.append
    )
    assert mask.all()
    np.testing.assert_array_equal(values[present], start[present])
    assert values.any(axis=2).all()
    assert len(missing) > 1
    assert missing[0] == (~present).sum()
    assert (np.diff(missing) < 0).all()


def test_perfect_completion_gives_perfect_normals(hole):
    """Slots, frames, write-back and averaging lose nothing."""
    _, _, normals, known, patches = hole
    truth, _ = normals_in(patches, normals, np.ones_like(known))
    columns = global_matrix(truth)

    def complete(groups, observed):
        result = np.zeros_like(groups)
        for group, seen, completed in zip(groups, observed, result, strict=True):
            fits = np.where(seen[:, :1], np.abs(columns - group[:, :1]), 0.0).max(axis=0)
            completed[:, 0] = columns[:, fits.argmin()]
        return result

    values, mask = iterative_diffusion(patches, normals, known, k=8, complete=complete)
    assert mask.all()
    np.testing.assert_allclose(values, truth, atol=1e-12)
    recovered = average_at_vertices(patches, values, mask)
    np.testing.assert_allclose(recovered[~known], normals[~known], atol=1e-12)


def test_recovered_columns_keep_what_their_own_group_said(hole):
    _, _, normals, known, patches = hole
    _, present = normals_in(patches, normals, known)
    first = present.mean(axis=1) >= 0.5  # the first batch; the others copy its averages
    values, mask = iterative_diffusion(
        patches, normals, known, k=SP, complete=lambda groups, _: np.full_like(groups, 0.2)
    )
    assert mask.all()
    np.testing.assert_array_equal(values[first][~present[first]], 0.2)
    assert (values[~first][~present[~first]] != 0.2).any()


def test_it_ends_when_nothing_can_be_recovered(hole):
    _, _, normals, known, patches = hole
    start, present = normals_in(patches, normals, known)
    values, mask = iterative_diffusion(
        patches, normals, known, k=8, complete=lambda groups, _: np.zeros_like(groups)
    )
    np.testing.assert_array_equal(mask, present)
    np.testing.assert_array_equal(values, start)
    _, mask = iterative_diffusion(
        patches, normals, np.zeros_like(known), k=8, complete=svt_complete
    )
    assert not mask.any()


def test_threads_do_not_change_a_byte(hole):
    _, _, normals, known, patches = hole
    alone, _ = iterative_diffusion(patches, normals, known, k=8, complete=svt_complete)
    with ThreadPoolExecutor(3) as executor:
        threaded, _ = iterative_diffusion(
            patches, normals, known, k=8, complete=svt_complete, executor=executor
        )
    np.testing.assert_array_equal(threaded, alone)


def test_average_undoes_the_frames(hole):
    _, _, normals, known, patches = hole
    values, mask = normals_in(patches, normals, known)
    back = average_at_vertices(patches, values, mask)
    reached = back.any(axis=1)
    assert not reached[~known].any()
    np.testing.assert_allclose(back[reached], normals[reached], atol=1e-12)


@pytest.fixture(scope="module")
def state(hole):
    """The hole with its bumps flattened away."""
    vertices, faces, _, known, _ = hole
    smooth = vertices.copy()
    for _ in range(60):
        total = np.zeros_like(smooth)
        np.add.at(total, faces, smooth[np.roll(faces, -1, axis=1)])
        mean = total / np.bincount(faces.ravel())[:, None]
        smooth[~known] = mean[~known]
    return start_state(smooth, faces, ~known)


PARAMETERS = InpaintParameters.paper(patchsize=SP, ringnumber=4, similarpatches=8)


def test_the_stages_move_the_hole_and_nothing_else(state):
    told = []
    result = recover_detail(state, PARAMETERS, report=lambda *step: told.append(step))
    known = ~state.unknown
    np.testing.assert_array_equal(result.positions[known], state.positions[known])
    assert (result.positions[~known] != state.positions[~known]).any(axis=1).all()
    np.testing.assert_allclose(np.linalg.norm(result.normals, axis=1), 1.0, atol=1e-12)
    assert np.linalg.norm(result.positions - state.positions, axis=1).max() < 2.0
    parts = [part for _, part in told]
    assert parts == sorted(parts)
    assert 0.0 <= parts[0] < parts[-1] < 1.0


def test_each_pass_begins_with_the_shape_of_the_last(state):
    once = recover_detail(state, PARAMETERS)
    twice = recover_detail(once, PARAMETERS)
    both = recover_detail(state, PARAMETERS.changed(iterations=2))
    np.testing.assert_array_equal(both.positions, twice.positions)


def test_a_turned_mesh_gets_the_turned_fill(state):
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # exact in floats
    turned = start_state(state.positions @ turn.T, state.faces, state.unknown)
    expected = recover_detail(state, PARAMETERS).positions @ turn.T
    np.testing.assert_allclose(recover_detail(turned, PARAMETERS).positions, expected, atol=1e-6)


def test_a_cylinder_is_continued():
    """Detail in one direction only, without noise: every recovered normal is nearly right."""
    rows, columns = 40, 48
    angle = 2 * np.pi * (np.arange(columns) + 0.5 * (np.arange(rows)[:, None] % 2)) / columns
    radius = columns / (2 * np.pi)
    height = np.broadcast_to(np.sqrt(0.75) * np.arange(rows)[:, None], angle.shape)
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    even = np.stack([np.stack([a, b, c], -1), np.stack([b, d, c], -1)], axis=2)
    odd = np.stack([np.stack([a, b, d], -1), np.stack([a, d, c], -1)], axis=2)
    faces = np.where((i % 2 == 0)[..., None, None], even, odd).reshape(-1, 3)
    vertices = vertices.reshape(-1, 3)
    unknown = np.linalg.norm(vertices - vertices[20 * columns], axis=1) < 4.0
    result = recover_detail(start_state(vertices, faces, unknown), PARAMETERS)
    truth = vertices * [1.0, 1.0, 0.0] / radius
    assert angles(result.normals[unknown], truth[unknown]).mean() < 15.0
    assert np.linalg.norm(result.positions - vertices, axis=1).max() < 0.5


def test_the_papers_constants_and_names():
    parameters = InpaintParameters.paper()
    assert (parameters.tau, parameters.delta, parameters.gamma) == (0.9, 0.1, 0.01)
    assert (parameters.sp, parameters.r, parameters.s_iter, parameters.m) == (100, 8, 1, 5)
    assert InpaintParameters(preset="paper").k == parameters.k > 0
    assert parameters.changed(patchsize=20).sp == 20


@pytest.mark.parametrize(
    ("name", "value"),
    [("delta", 2.0), ("tau", 0.0), ("mu", -1.0), ("beta", "1"), ("truncation", -1)],
)
def test_bad_constants_are_named(name, value):
    with pytest.raises(InvalidParameterError, match=name):
        InpaintParameters.paper(**{name: value})
