"""The whole auto preset on small meshes."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.geometry import face_normals, normalized, vertex_normals
from meshlab_lowrank.mesh.topology import border_of
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.restoring import restore_detail
from sample_meshes.shapes import make_shape

NONE = InpaintParameters(detail="none")


def waves(x, y):
    """Egg box of hexagonal cells 7 apart."""
    k = 2.0 * np.pi / 7.0
    across = k / np.sqrt(3.0)
    return 0.3 * (
        np.cos(2.0 * across * x) + np.cos(across * x + k * y) + np.cos(across * x - k * y)
    )


def egg_box(sheet, size, holes):
    points, faces = sheet(*size)
    points = points - points.mean(axis=0)
    points[:, 2] = waves(*points[:, :2].T)
    gone = np.zeros(len(points), dtype=bool)
    for x, y, radius in holes:
        gone |= np.hypot(points[:, 0] - x, points[:, 1] - y) < radius
    return points, faces[~gone[faces].any(axis=1)]


def offset(result):
    """Root mean square height of new vertices above the egg box."""
    new = result.vertices[result.new_vertices]
    return float(np.sqrt(np.mean((new[:, 2] - waves(*new[:, :2].T)) ** 2)))


@pytest.fixture(scope="module")
def egg(sheet):
    return egg_box(sheet, (44, 38), [(0.0, 0.0, 4.0)])


@pytest.fixture(scope="module")
def filled(egg):
    return inpaint(*egg)


def assert_known_part_is_kept(vertices, faces, result):
    assert result.vertices[: len(vertices)].tobytes() == vertices.tobytes()
    assert result.faces[: len(faces)].tobytes() == faces.tobytes()
    assert result.vertices.dtype == np.float64
    np.testing.assert_array_equal(
        result.new_vertices, np.arange(len(result.vertices)) >= len(vertices)
    )
    np.testing.assert_array_equal(result.new_faces, np.arange(len(result.faces)) >= len(faces))
    assert np.isfinite(result.vertices).all()
    np.testing.assert_array_equal(result.trust[: len(vertices)], 1.0)
    assert ((result.trust >= 0.0) & (result.trust <= 1.0)).all()


def assert_filled(faces, result):
    """Manifold and oriented, and every loop but the skipped ones is closed."""
    border = border_of(result.faces, len(result.vertices))
    assert border.non_manifold == 0
    assert border.inconsistent == 0
    left = sum(hole.boundary_edges for hole in result.holes if hole.status != "filled")
    assert len(border.half_edges) == left
    assert len(border_of(faces, len(result.vertices)).half_edges) == sum(
        hole.boundary_edges for hole in result.holes
    )
    assert sum(hole.new_faces for hole in result.holes) == result.new_faces.sum()
    assert sum(hole.new_vertices for hole in result.holes) == result.new_vertices.sum()


def test_the_pattern_comes_back_on_an_egg_box(egg, filled):
    plain = inpaint(*egg, parameters=NONE)
    assert offset(filled) < 0.25 * offset(plain)
    (hole,) = (hole for hole in filled.holes if hole.status == "filled")
    assert hole.reason == ""
    assert hole.trust > 0.7
    np.testing.assert_allclose(filled.trust[filled.new_vertices], hole.trust, atol=0.1)
    assert filled.error[filled.new_vertices].max() < 0.5 * plain.error[plain.new_vertices].max()


def test_the_known_part_is_kept_and_the_hole_closed(egg, filled):
    assert_known_part_is_kept(*egg, filled)
    assert_filled(egg[1], filled)
    assert [hole.status for hole in filled.holes] == ["skipped", "filled"]


def test_no_face_is_flipped_or_without_area(filled):
    new = filled.faces[filled.new_faces]
    corners = filled.vertices[new]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert areas.min() > 0.05
    assert face_normals(filled.vertices, new)[:, 2].min() > 0.1


def test_the_input_is_left_alone(egg):
    vertices, faces = egg[0].copy(), egg[1].copy()
    vertices.setflags(write=False)
    faces.setflags(write=False)
    inpaint(vertices, faces, parameters=InpaintParameters(iterations=1))
    np.testing.assert_array_equal(vertices, egg[0])


def test_the_same_seed_gives_the_same_bytes(egg, filled):
    again = inpaint(*egg)
    assert again.vertices.tobytes() == filled.vertices.tobytes()
    assert again.faces.tobytes() == filled.faces.tobytes()
    assert again.holes == filled.holes


SCRIPT = """
import hashlib, os, sys
import numpy as np
cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
if cores and sys.argv[2] == "one":
    os.sched_setaffinity(0, cores[:1])
from meshlab_lowrank.inpainting import inpaint
mesh = np.load(sys.argv[1])
result = inpaint(mesh["vertices"], mesh["faces"])
print(hashlib.sha256(result.vertices.tobytes() + result.faces.tobytes()).hexdigest())
"""


def test_the_number_of_threads_changes_no_byte(egg, tmp_path):
    np.savez(tmp_path / "egg.npz", vertices=egg[0], faces=egg[1])
    hashes = []
    for threads, cores in (("1", "one"), ("5", "all")):
        environment = {
            **os.environ,
            "OMP_NUM_THREADS": threads,
            "OPENBLAS_NUM_THREADS": threads,
            "MESHLAB_LOWRANK_THREADS": threads,
            "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
        }
        run = subprocess.run(  # noqa: S603
            [sys.executable, "-c", SCRIPT, str(tmp_path / "egg.npz"), cores],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        hashes.append(run.stdout.strip())
    assert len(hashes[0]) == 64
    assert len(set(hashes)) == 1


@pytest.mark.parametrize("scale", [1e6, 1e-6])
def test_units_make_no_difference(egg, filled, scale):
    vertices, faces = egg
    result = inpaint(vertices * scale, faces)
    np.testing.assert_array_equal(result.faces, filled.faces)
    np.testing.assert_allclose(result.vertices / scale, filled.vertices, atol=1e-6)
    expected = [(hole.status, hole.reason) for hole in filled.holes]
    assert [(hole.status, hole.reason) for hole in result.holes] == expected


def test_the_place_makes_no_difference(egg):
    vertices, faces = egg
    exact = np.rint(vertices * 2.0**20) / 2.0**20  # so that it can be moved without rounding
    place = np.array([1e7, -3e6, 0.0])
    moved = exact + place
    assert np.array_equal(moved - place, exact)
    here, there = inpaint(exact, faces), inpaint(moved, faces)
    np.testing.assert_array_equal(there.faces, here.faces)
    rounding = 2.0**-28  # of coordinates so far out
    np.testing.assert_allclose(there.vertices - place, here.vertices, atol=rounding)
    assert [(hole.status, hole.reason) for hole in there.holes] == [
        (hole.status, hole.reason) for hole in here.holes
    ]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_turned_mesh_is_filled_as_well(egg, seed):
    vertices, faces = egg
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    turn = q * np.sign(np.linalg.det(q))
    turned = inpaint(vertices @ turn.T, faces)
    plain = inpaint(vertices, faces, parameters=NONE)
    assert offset(replace(turned, vertices=turned.vertices @ turn)) < 0.25 * offset(plain)


def test_two_near_holes(sheet):
    mesh = egg_box(sheet, (44, 44), [(-4.6, 0.0, 3.2), (4.6, 0.0, 3.2)])
    result = inpaint(*mesh)
    assert [hole.status for hole in result.holes] == ["skipped", "filled", "filled"]
    assert_known_part_is_kept(*mesh, result)
    assert_filled(mesh[1], result)
    assert offset(result) < 0.4 * offset(inpaint(*mesh, parameters=NONE))


def test_full_detail_follows_the_pattern_too(egg):
    full = inpaint(*egg, parameters=InpaintParameters(detail="full"))
    assert_known_part_is_kept(*egg, full)
    new = full.vertices[full.new_vertices]
    assert np.std(new[:, 2]) == pytest.approx(np.std(waves(*new[:, :2].T)), rel=0.25)


@pytest.mark.parametrize("detail", ["calibrated", "full", "none"])
def test_a_single_missing_face_is_put_back(sheet, detail):
    points, faces = egg_box(sheet, (16, 16), [])
    gone = np.argmin(np.linalg.norm(points[faces].mean(axis=1)[:, :2], axis=1))
    result = inpaint(
        points, np.delete(faces, gone, axis=0), parameters=InpaintParameters(detail=detail)
    )
    assert [hole.status for hole in result.holes] == ["skipped", "filled"]
    assert not result.new_vertices.any()
    (face,) = result.faces[result.new_faces].tolist()
    start = face.index(faces[gone, 0])
    assert face[start:] + face[:start] == faces[gone].tolist()


@pytest.mark.parametrize("detail", ["calibrated", "full"])
@pytest.mark.parametrize("size", [(10, 10), (14, 12)])
def test_surroundings_too_small_for_a_patch(sheet, size, detail):
    mesh = egg_box(sheet, size, [(0.0, 0.0, 2.5)])
    result = inpaint(*mesh, parameters=InpaintParameters(detail=detail))
    hole = next(hole for hole in result.holes if hole.status == "filled")
    assert hole.reason == "The surroundings are too small for a patch, so the fill is smooth."
    assert hole.trust == 0.0
    assert_filled(mesh[1], result)
    smooth = inpaint(*mesh, parameters=NONE)
    assert result.vertices.tobytes() == smooth.vertices.tobytes()


@pytest.mark.parametrize("detail", ["calibrated", "full"])
@pytest.mark.parametrize("around", [10, 80])
def test_a_ring_of_faces_has_no_known_normal(around, detail):
    angle = np.repeat(np.arange(around) * 2.0 * np.pi / around, 2)
    radius = around / (2.0 * np.pi)
    points = np.stack(
        [radius * np.cos(angle), radius * np.sin(angle), np.tile([0.0, 1.0], around)], axis=1
    )
    a = 2 * np.arange(around)
    b = np.roll(a, -1)
    faces = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    parameters = InpaintParameters(detail=detail, closerim=True, continuity="smooth")
    result = inpaint(points, faces, parameters=parameters)
    assert [hole.status for hole in result.holes] == ["filled", "filled"]
    why = "too narrow" if (around, detail) == (10, "calibrated") else "too small"
    assert all(why in hole.reason for hole in result.holes)
    assert_filled(faces, result)


def test_nothing_to_fill_changes_nothing(egg):
    for mesh, options in (
        (make_shape("torus", "bumps", count=1000), {}),
        (egg, {"maxholesize": 5}),
    ):
        result = inpaint(*mesh, parameters=InpaintParameters(**options))
        assert result.vertices.tobytes() == mesh[0].tobytes()
        assert result.faces.tobytes() == mesh[1].tobytes()
        assert not result.new_vertices.any()
        assert all(hole.status == "skipped" and hole.reason for hole in result.holes)


def test_only_holes_at_selected_faces_are_filled(egg):
    vertices, faces = egg
    with pytest.raises(InvalidParameterError, match="selected is True, but that leaves nothing"):
        inpaint(*egg, selected_faces=np.zeros(len(faces), dtype=bool), parameters=NONE)
    at_hole = (np.hypot(*vertices[:, :2].T) < 6.0)[faces].any(axis=1)
    result = inpaint(*egg, selected_faces=at_hole, parameters=NONE)
    assert [hole.status for hole in result.holes] == ["skipped", "filled"]


@pytest.fixture(scope="module")
def flattened(sheet):
    """An egg box with a flattened disc: truth, vertices, faces, selected."""
    truth, faces = egg_box(sheet, (44, 38), [])
    selected = np.hypot(*truth[:, :2].T) < 4.0
    return truth, np.where(selected[:, None], truth * [1.0, 1.0, 0.0], truth), faces, selected


def test_restoring_moves_only_what_is_selected(flattened):
    truth, vertices, faces, selected = flattened
    result = restore_detail(vertices, faces, selected)
    assert result.faces.tobytes() == faces.tobytes()
    assert result.vertices[~selected].tobytes() == vertices[~selected].tobytes()
    assert (result.vertices[selected] != vertices[selected]).any(axis=1).all()
    np.testing.assert_array_equal(result.new_vertices, selected)
    np.testing.assert_array_equal(result.new_faces, selected[faces].any(axis=1))
    np.testing.assert_array_equal(result.trust[~selected], 1.0)
    (record,) = result.holes
    assert record.status == "filled"
    assert record.new_vertices == selected.sum()
    before = np.std((vertices - truth)[selected, 2])
    assert offset(result) < 0.3 * before


def test_restoring_does_not_look_at_what_is_selected(flattened):
    truth, vertices, faces, selected = flattened
    parameters = InpaintParameters(iterations=1)
    one = restore_detail(vertices, faces, selected, parameters=parameters)
    lifted = vertices + 0.3 * np.outer(selected, [0.0, 0.0, 1.0])
    two = restore_detail(lifted, faces, selected, parameters=parameters)
    change = (two.vertices - one.vertices)[selected, 2]
    assert np.sqrt(np.mean(change**2)) < 0.1  # the fairing weighs by the given triangles
    assert offset(two) < 0.3 * np.std(truth[selected, 2])


def test_two_selected_patches_have_a_record_each(flattened):
    truth, _, faces, _ = flattened
    selected = np.hypot(np.abs(truth[:, 0]) - 8.0, truth[:, 1]) < 2.5
    result = restore_detail(truth, faces, selected, parameters=NONE)
    assert [record.status for record in result.holes] == ["filled", "filled"]
    assert sum(record.new_vertices for record in result.holes) == selected.sum()
    assert result.vertices[~selected].tobytes() == truth[~selected].tobytes()
    normals = normalized(vertex_normals(result.vertices, faces))
    assert normals[selected, 2].min() > 0.3
