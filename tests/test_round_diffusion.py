"""Diffusion in rounds, and the paper's stages together on one hole."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.pipeline import recover
from meshlab_lowrank.presets import PAPER, pipeline_of
from meshlab_lowrank.stages.stage2b_patches import normals_in
from meshlab_lowrank.stages.stage2b_patches_rings import RingPatches
from meshlab_lowrank.stages.stage3_similar import PatchLibrary, Sources
from meshlab_lowrank.stages.stage3_similar_normal_patch_covariance import NormalPatchCovariance
from meshlab_lowrank.stages.stage4a_complete import Completed
from meshlab_lowrank.stages.stage4a_complete_svt import SingularValueThresholding
from meshlab_lowrank.stages.stage4b_diffuse import Omega
from meshlab_lowrank.stages.stage4b_diffuse_rounds import RoundDiffusion
from meshlab_lowrank.stages.stage5_refine_nothing import NoRefinement
from meshlab_lowrank.stages.stage6a_average_at_vertices import AverageAtVertices
from sample_meshes.shapes import make_shape
from tests.builders import hole_of

SP = 40
AVERAGE = AverageAtVertices(corrections=0)
NOTHING = Sources(PatchLibrary(np.zeros((0, 3 * SP), dtype=np.float32), np.zeros((0, 3))))


@pytest.fixture(scope="module")
def torus():
    return make_shape("torus", "bumps", count=2000, seed=1)


@pytest.fixture(scope="module")
def case(torus):
    """Hole in a torus that lies on the truth, its true normals, and patches around and in it."""
    vertices, faces = torus
    distance = np.linalg.norm(vertices - vertices[500], axis=1)
    hole = hole_of(vertices, faces, distance < 6.5, rim_normals=True)
    normals = vertex_normals(vertices, faces)
    hole = replace(hole, normals=np.where(hole.measured[:, None], normals, 0.0))
    patches = RingPatches(sp=SP).layer(hole).at(np.flatnonzero(distance < 11.0))
    return hole, normals, patches


def rounds(hole, patches, complete, *, executor=None, k=8):
    """Values and votes that the rounds end with, None if they recover nothing."""
    found = RoundDiffusion()(
        hole,
        patches,
        NOTHING,
        RingPatches(sp=SP).layer(hole),
        similar=NormalPatchCovariance(k=k),
        complete=complete,
        gather=AVERAGE,
        first=True,
        executor=executor,
    )
    return None if found is None else (found.omega.values, found.omega.votes > 0)


def angles(a, b):
    return np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1.0, 1.0)))


def test_all_is_recovered_and_what_is_known_stays(case):
    hole, normals, patches = case
    start, present = normals_in(patches, normals, hole.measured)
    assert (~present).all(axis=1).any()  # patches wholly inside the hole
    values, mask = rounds(hole, patches, SingularValueThresholding())
    assert mask.all()
    np.testing.assert_array_equal(values[present], start[present])
    assert values.any(axis=2).all()


def test_perfect_completion_gives_perfect_normals(case):
    """Slots, frames, write-back and averaging lose nothing."""
    hole, normals, patches = case
    truth, _ = normals_in(patches, normals, np.ones_like(hole.measured))

    def complete(values, weights, _groups):
        fits = np.abs(truth[None] - values[:, None]).max(axis=3) * (weights[:, None] > 0)
        return Completed(truth[fits.max(axis=2).argmin(axis=1)], np.zeros(len(values)))

    values, mask = rounds(hole, patches, complete)
    assert mask.all()
    np.testing.assert_allclose(values, truth, atol=1e-12)
    recovered, _ = AVERAGE.normals(Omega(patches, values, mask.astype(float)))
    np.testing.assert_allclose(recovered[hole.unknown], normals[hole.unknown], atol=1e-12)


def test_recovered_columns_keep_what_their_own_group_said(case):
    hole, normals, patches = case
    _, present = normals_in(patches, normals, hole.measured)
    first = present.mean(axis=1) >= 0.5  # the first batch; the others copy its averages
    values, mask = rounds(
        hole,
        patches,
        lambda values, *_: Completed(np.full_like(values, 0.2), np.zeros(len(values))),
        k=SP,
    )
    assert mask.all()
    np.testing.assert_array_equal(values[first][~present[first]], 0.2)
    assert (values[~first][~present[~first]] != 0.2).any()


def test_it_ends_when_nothing_can_be_recovered(case):
    hole, _, patches = case
    nothing = lambda values, *_: Completed(np.zeros_like(values), np.zeros(len(values)))  # noqa: E731
    assert rounds(hole, patches, nothing) is None
    lost = replace(hole, measured=np.zeros_like(hole.measured))
    assert rounds(lost, patches, SingularValueThresholding()) is None


def test_threads_do_not_change_a_byte(case):
    hole, _, patches = case
    alone, _ = rounds(hole, patches, SingularValueThresholding())
    with ThreadPoolExecutor(3) as executor:
        threaded, _ = rounds(hole, patches, SingularValueThresholding(), executor=executor)
    np.testing.assert_array_equal(threaded, alone)


def test_average_undoes_the_frames(case):
    hole, normals, patches = case
    values, mask = normals_in(patches, normals, hole.measured)
    back, votes = AVERAGE.normals(Omega(patches, values, mask.astype(float)))
    reached = votes > 0
    np.testing.assert_array_equal(reached, back.any(axis=1))
    assert not reached[hole.unknown].any()
    np.testing.assert_allclose(back[reached], normals[reached], atol=1e-12)


@pytest.fixture(scope="module")
def hole(torus, case):
    """The hole with its bumps flattened away."""
    vertices, faces = torus
    known = ~case[0].unknown
    smooth = vertices.copy()
    for _ in range(60):
        total = np.zeros_like(smooth)
        np.add.at(total, faces, smooth[np.roll(faces, -1, axis=1)])
        mean = total / np.bincount(faces.ravel())[:, None]
        smooth[~known] = mean[~known]
    return hole_of(smooth, faces, ~known, rim_normals=True)


PARAMETERS = InpaintParameters.paper(patchsize=SP, ringnumber=4, similarpatches=8)
PIPELINE = pipeline_of(PARAMETERS)


def test_the_stages_move_the_hole_and_nothing_else(hole):
    result = recover(hole, PIPELINE)
    known = ~hole.unknown
    np.testing.assert_array_equal(result.positions[known], hole.positions[known])
    assert (result.positions[~known] != hole.positions[~known]).any(axis=1).all()
    np.testing.assert_allclose(np.linalg.norm(result.normals, axis=1), 1.0, atol=1e-12)
    assert np.linalg.norm(result.positions - hole.positions, axis=1).max() < 2.0


def test_each_pass_begins_with_the_shape_of_the_last(hole):
    once = recover(hole, PIPELINE)
    twice = recover(once, PIPELINE)
    both = recover(hole, pipeline_of(PARAMETERS.changed(iterations=2)))
    np.testing.assert_array_equal(both.positions, twice.positions)


def test_a_turned_mesh_gets_the_turned_fill(hole):
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # exact in floats
    turned = hole_of(hole.positions @ turn.T, hole.faces, hole.unknown, rim_normals=True)
    expected = recover(hole, PIPELINE).positions @ turn.T
    np.testing.assert_allclose(recover(turned, PIPELINE).positions, expected, atol=1e-6)


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
    result = recover(hole_of(vertices, faces, unknown, rim_normals=True), PIPELINE)
    truth = vertices * [1.0, 1.0, 0.0] / radius
    assert angles(result.normals[unknown], truth[unknown]).mean() < 15.0
    assert np.linalg.norm(result.positions - vertices, axis=1).max() < 0.5


def test_the_papers_constants_and_names():
    parameters = InpaintParameters.paper()
    assert (parameters.tau, parameters.delta, parameters.gamma) == (0.9, 0.1, 0.01)
    assert (parameters.patchsize, parameters.ringnumber, parameters.iterations) == (100, 8, 1)
    assert parameters.truncation == 5
    assert parameters.changed(patchsize=20).patchsize == 20


def test_the_preset_is_what_its_parameters_say():
    assert pipeline_of(InpaintParameters.paper()) == PAPER


def test_the_refinement_is_part_of_the_preset(hole):
    refined = recover(hole, PIPELINE)
    plain = recover(hole, replace(PIPELINE, refine=NoRefinement()))
    assert np.abs(refined.positions - plain.positions).max() > 1e-3


@pytest.mark.parametrize(
    ("name", "value"),
    [("delta", 2.0), ("tau", 0.0), ("mu", -1.0), ("beta", "1"), ("truncation", -1)],
)
def test_bad_constants_are_named(name, value):
    with pytest.raises(InvalidParameterError, match=name):
        InpaintParameters.paper(**{name: value})
