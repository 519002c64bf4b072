"""Fills have no more faces than their rim and the mesh account for, and no area is no mystery."""

from __future__ import annotations

import importlib

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.result import InpaintResult
from meshlab_lowrank.stages.stage1a_close_rim import coarsening
from tests.damaging import grid

NONE = InpaintParameters(detail="none")


def ring(edges: int) -> tuple[np.ndarray, np.ndarray]:
    """Give a flat ring, two faces wide, with two rims of as many edges."""
    angle, step = np.meshgrid(np.arange(edges), np.arange(3), indexing="ij")
    angle, radius = 2.0 * np.pi * angle.ravel() / edges, edges / (2.0 * np.pi) + step.ravel()
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=1)
    return points, grid(edges, 3, around=True, along=False)


def sphere_without_cap(subdivisions: int = 3) -> tuple[np.ndarray, np.ndarray]:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=subdivisions)
    points, faces = ms.current_mesh().vertex_matrix(), ms.current_mesh().face_matrix()
    return points, faces[points[faces][:, :, 2].mean(axis=1) < 0.8].astype(np.int64)


def filled(mesh: tuple[np.ndarray, np.ndarray], **parameters: object) -> InpaintResult:
    options = {"detail": "none", **parameters}
    return inpaint(*mesh, parameters=InpaintParameters(**options))  # type: ignore[arg-type]


def test_coarsening_solves_its_equation() -> None:
    chance = np.random.default_rng(3)
    count, rim = chance.uniform(1.0, 1e5, (2, 200))
    most = chance.uniform(10.0, 1e4, 200)
    ratio = coarsening(count, rim, most, asked=np.zeros(200, dtype=np.bool_))
    assert (ratio >= 1.0).all()
    faces = count / ratio**2 + rim / ratio
    assert np.allclose(faces[ratio > 1.0], most[ratio > 1.0])
    assert (faces[ratio == 1.0] <= most[ratio == 1.0]).all()
    assert (ratio > 1.0).any()
    assert (ratio == 1.0).any()


def test_nothing_is_coarsened_without_bound_or_where_a_length_is_asked_for() -> None:
    count, rim, most = np.array([1e5, 1e5]), np.array([10.0, 10.0]), np.array([np.inf, 10.0])
    ratio = coarsening(count, rim, most, asked=np.array([False, True]))
    assert ratio.tolist() == [1.0, 1.0]
    with pytest.raises(StageError, match="give a longer edge length"):
        coarsening(1e3 * count, rim, most, asked=np.array([False, True]))


def test_a_fill_much_larger_than_the_mesh_is_coarser_and_says_so() -> None:
    mesh = ring(300)
    result = filled(mesh)
    (hole,) = (each for each in result.holes if each.status == "filled")
    assert hole.new_faces < 6 * len(mesh[1]) < 0.18 * 300**2
    assert "times as long as those around" in hole.reason
    assert hole.folded_edges == hole.flat_faces == 0
    asked = filled(mesh, refineedgelen=1.0)
    (other,) = (each for each in asked.holes if each.status == "filled")
    assert other.new_faces > 1.5 * hole.new_faces
    assert "times as long" not in other.reason


def test_usual_fills_are_as_dense_as_their_surroundings() -> None:
    for subdivisions in (2, 3, 4):
        points, faces = sphere_without_cap(subdivisions)
        result = filled((points, faces))
        assert "times as long" not in result.holes[0].reason
        old, new = (
            np.linalg.norm(points[rows[:, 0]] - points[rows[:, 1]], axis=1).mean()
            for points, rows in (
                (result.vertices, faces),
                (result.vertices, result.faces[len(faces) :]),
            )
        )
        assert 0.8 < new / old < 1.2


@pytest.mark.parametrize("factor", [1e-3, 1e-2, 1e2, 1e3])
def test_a_stretched_mesh_gets_few_faces(factor: float) -> None:
    points, faces = sphere_without_cap()
    axes, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    result = filled((points @ (axes * [factor, 1.0, 1.0]) @ axes.T, faces))
    (hole,) = result.holes
    assert hole.status == "filled"
    assert hole.new_faces < 10 * hole.boundary_edges**2


@pytest.mark.parametrize("kept", [[1, 1, 0], [1, 0, 0]])
def test_a_hole_without_area_around_keeps_no_other_from_being_filled(kept: list[float]) -> None:
    points, faces = sphere_without_cap()
    both = np.concatenate([points, 5.0 + points * kept])
    result = filled((both, np.concatenate([faces, faces + len(points)])))
    assert [hole.status for hole in result.holes].count("filled") >= 1
    assert all(hole.reason.endswith(".") for hole in result.holes if hole.status != "filled")
    assert np.isfinite(result.vertices).all()


@pytest.mark.parametrize("factor", [1e-300, 1e-100, 1e100, 1e300])
def test_sizes_that_cannot_be_computed_with_are_refused(factor: float) -> None:
    points, faces = sphere_without_cap(2)
    with pytest.raises(meshlab_lowrank.InvalidMeshError, match="compute_matrix_from_scaling"):
        inpaint(points * factor, faces, parameters=NONE)
    with pytest.raises(meshlab_lowrank.InvalidMeshError, match="compute_matrix_from_scaling"):
        meshlab_lowrank.measure_holes(points * factor, faces)


@pytest.mark.parametrize("exponent", [-60, -20, 20, 100])
def test_other_sizes_make_no_difference(exponent: int) -> None:
    points, faces = sphere_without_cap(2)
    usual = inpaint(points, faces, parameters=NONE)
    other = inpaint(points * 2.0**exponent, faces, parameters=NONE)
    assert np.array_equal(other.faces, usual.faces)
    assert np.array_equal(other.vertices, usual.vertices * 2.0**exponent)
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(points * 2.0**exponent, faces))
    ms.meshing_inpaint_lowrank(detail="none")
    assert np.array_equal(ms.current_mesh().face_matrix(), usual.faces)
    assert np.array_equal(ms.current_mesh().vertex_matrix(), other.vertices)


def test_a_single_vertex_can_be_moved() -> None:
    """MeshLab's transfer of attributes hangs where all sources lie at one point."""
    points, faces = sphere_without_cap(2)
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(points, faces))
    ring_around = int(np.argmin(points[:, 2]))
    ms.compute_selection_by_condition_per_face(
        condselect=" || ".join(f"vi{i} == {ring_around}" for i in range(3))
    )
    report = ms.apply_coord_inpaint_lowrank(detail="none")
    assert report["moved_vertices"] == 1
    moved = np.flatnonzero((ms.current_mesh().vertex_matrix() != points).any(axis=1))
    assert moved.tolist() == [ring_around]


def test_many_fills_that_cross_are_counted_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look at what crosses costs a look at the mesh."""
    module = importlib.import_module("meshlab_lowrank.fill_crossings")
    calls = []
    plain = module.crossing_pairs

    def counted(*arguments: object) -> object:
        calls.append(1)
        return plain(*arguments)

    monkeypatch.setattr(module, "crossing_pairs", counted)
    i, j = np.meshgrid(np.arange(25.0), np.arange(25.0), indexing="ij")
    chance = np.random.default_rng(0)
    points = np.stack([i.ravel(), j.ravel(), chance.uniform(-0.1, 0.1, i.size)], axis=1)
    faces = grid(25, 25, around=False, along=False)
    holes = faces[chance.random(len(faces)) < 0.94]
    crossed = points + 0.8 * chance.standard_normal(points.shape)
    result = filled((crossed, holes))
    notes = [hole.reason for hole in result.holes if "cross" in hole.reason]
    assert len(notes) > 20
    assert len(calls) < 20  # one for each way of closing
