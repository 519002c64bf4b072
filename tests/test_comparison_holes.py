"""Punched holes, and finding again what a filler put into a hole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.comparison.cases import punched_jobs, real_job
from meshlab_lowrank.comparison.punching import Outline, Puncher, in_rounds
from meshlab_lowrank.comparison.sources import without_unused
from meshlab_lowrank.mesh.geometry import edge_lengths, face_vectors
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops

SAMPLES = Path(__file__).parent.parent / "sample_meshes"


@pytest.fixture(scope="module")
def holed():
    return load("dimples_holes.ply")


@pytest.fixture(scope="module")
def whole():
    return load("dimples.ply")


@pytest.fixture(scope="module")
def job(holed, whole):
    return real_job(*holed, boundary_loops(*holed), whole)


def load(name):
    ms = pymeshlab.MeshSet(verbose=False)
    ms.load_new_mesh(str(SAMPLES / name))
    mesh = ms.current_mesh()
    return without_unused(mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64))


def area(vertices, faces):
    return float(np.linalg.norm(face_vectors(vertices, faces), axis=1).sum())


def closed_by_meshlab(job, **options):
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(job.vertices, job.faces))
    ms.meshing_close_holes(maxholesize=1000, selected=False, newfaceselected=False, **options)
    mesh = ms.current_mesh()
    return mesh.vertex_matrix(), np.asarray(mesh.face_matrix(), dtype=np.int64)


def test_truth_is_what_is_missing(holed, whole, job):
    parts = [case.truth for case in job.cases]
    missing = area(*whole) - area(*holed)
    removed = sum(area(part.vertices, part.faces[part.part]) for part in parts)
    assert removed == pytest.approx(missing, rel=1e-9)
    assert sum(part.part.sum() for part in parts) == len(whole[1]) - len(holed[1])


def test_new_faces_are_found_in_any_order(job):
    vertices, faces = closed_by_meshlab(job, refinehole=False)
    rng = np.random.default_rng(0)
    shuffle, relabel = rng.permutation(len(faces)), rng.permutation(len(vertices))
    moved = np.empty_like(vertices)
    moved[relabel] = vertices
    rolled = np.roll(relabel[faces][shuffle], 1, axis=1)
    plain, mixed = job.known.locate(vertices, faces), job.known.locate(moved, rolled)
    assert plain.kept
    assert mixed.kept
    assert plain.closed == mixed.closed == (True, True, True)
    np.testing.assert_array_equal(plain.loop[shuffle], mixed.loop)
    for number, case in enumerate(job.cases):
        assert (plain.loop == case.loop.id).sum() == len(case.loop.vertices) - 2, number


def test_open_holes_are_open(job, holed):
    assert job.known.locate(*holed).closed == (False, False, False)
    vertices, faces = closed_by_meshlab(job, refinehole=False)
    lost = np.flatnonzero(job.known.locate(vertices, faces).loop == 1)[0]
    torn = job.known.locate(vertices, np.delete(faces, lost, axis=0))
    assert torn.closed == (True, False, True)


def test_fills_put_in_inside_out_are_turned(job):
    vertices, faces = closed_by_meshlab(job, refinehole=False)
    new = job.known.locate(vertices, faces).loop >= 0
    reversed_ = np.where(new[:, None], faces[:, ::-1], faces)
    found = job.known.locate(vertices, reversed_)
    np.testing.assert_array_equal(found.turned, new)
    np.testing.assert_array_equal(found.faces[new], faces[new])
    assert not job.known.locate(vertices, faces).turned.any()


def test_a_resampled_surface_is_split_at_the_boundary(job, whole):
    """A remeshed truth keeps no face; its part in each hole still has the hole's area."""
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(*whole))
    length = float(edge_lengths(*whole).mean())
    ms.meshing_isotropic_explicit_remeshing(
        iterations=3, targetlen=pymeshlab.PureValue(0.5 * length)
    )
    mesh = ms.current_mesh()
    found = job.known.locate(mesh.vertex_matrix(), np.asarray(mesh.face_matrix(), dtype=np.int64))
    assert not found.kept
    for case in job.cases:
        own = found.faces[found.loop == case.loop.id]
        truth = area(case.truth.vertices, case.truth.faces[case.truth.part])
        assert area(found.vertices, own) == pytest.approx(truth, rel=0.08)


def test_outlines_keep_their_size():
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    loop = np.stack([3 * np.cos(angle), 0.1 * np.sin(9 * angle), 3 * np.sin(angle)], axis=1)
    outline = Outline.of_loop(loop)
    assert outline.radius == pytest.approx(3.0, abs=0.05)
    assert outline.scaled(0.5).radius == pytest.approx(outline.radius / 2)


def test_an_outline_contains_its_inside():
    star = Outline(
        np.array(
            [[0, 2], [0.4, 0.4], [2, 0], [0.4, -0.4], [0, -2], [-0.4, -0.4], [-2, 0], [-0.4, 0.4]]
        )
    )
    points = np.array([[0, 0], [0, 1.9], [1, 1], [1.9, 0], [-1, 0.5], [0.3, 0.3]])
    np.testing.assert_array_equal(star.contains(points), [True, True, False, True, False, True])


def test_punched_holes_are_like_the_real_one(holed, job):
    vertices, faces = holed
    length = float(edge_lengths(*holed).mean())
    for case in job.cases:
        outline = Outline.of_loop(vertices[case.loop.vertices])
        real = area(case.truth.vertices, case.truth.faces[case.truth.part])
        holes = Puncher(vertices, faces, length, seed=1).punch(outline, 3)
        assert len(holes) == 3
        rim = vertices[np.concatenate([other.loop.vertices for other in job.cases])]
        for hole in holes:
            assert area(vertices, faces[hole.faces]) == pytest.approx(real * hole.size**2, rel=0.2)
            corners = vertices[faces[hole.faces]].reshape(-1, 3)
            gaps = np.linalg.norm(corners[:, None] - rim[None], axis=2)
            assert gaps.min() > length


def test_punched_jobs_leave_clean_loops(holed):
    vertices, faces = holed
    outlines = [(0, Outline.of_loop(vertices[boundary_loops(*holed)[0].vertices]))]
    jobs = punched_jobs(vertices, faces, outlines, 3, 0)
    assert sorted(case.place for job in jobs for case in job.cases) == [1, 2, 3]
    for job in jobs:
        assert len(boundary_loops(job.vertices, job.faces)) == 3 + len(job.cases)
        assert len(np.unique(job.faces)) == len(job.vertices)
        for case in job.cases:
            assert not case.loop.reason
            removed = case.truth.faces[case.truth.part]
            rim = job.vertices[case.loop.vertices]
            assert np.isin(rim, case.truth.vertices[removed]).all()
            assert job.selected[case.loop.faces].all()


def test_places_follow_the_seed(holed):
    outline = Outline.disc(0.5 * np.ptp(holed[0]) / 12)
    length = float(edge_lengths(*holed).mean())
    first, again, other = (Puncher(*holed, length, seed).punch(outline, 2) for seed in (3, 3, 4))
    for one, two in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.faces, two.faces)
    assert not np.array_equal(first[0].faces, other[0].faces)


def test_outlines_shrink_to_find_room(holed):
    vertices, faces = holed
    length = float(edge_lengths(vertices, faces).mean())
    radius = next(
        r for r in np.arange(10, 60, 5.0) if not _fits(vertices, faces, length, r * length)
    )
    holes = Puncher(vertices, faces, length, 0).punch(Outline.disc(radius * length), 1)
    assert holes[0].size < 1.0
    assert Puncher(vertices, faces, length, 0).punch(Outline.disc(1e3 * length), 1) == []


def _fits(vertices, faces, length, radius):
    holes = Puncher(vertices, faces, length, 0).punch(Outline.disc(radius), 1)
    return bool(holes) and holes[0].size == 1.0


def test_rounds_hold_holes_that_lie_apart(holed):
    vertices, faces = holed
    length = float(edge_lengths(vertices, faces).mean())
    outline = Outline.disc(4 * length)
    holes = Puncher(vertices, faces, length, 0).punch(outline, 8)
    rounds = in_rounds(holes, [outline.radius] * len(holes))
    assert sorted(number for members in rounds for number in members) == list(range(8))
    for members in rounds:
        centres = np.array([holes[number].centre for number in members])
        gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2)
        assert gaps[~np.eye(len(members), dtype=bool)].min(initial=np.inf) > 4 * outline.radius
