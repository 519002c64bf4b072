"""The cut-out region of a hole or a selection."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import edge_lengths
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_region, cut_selection
from sample_meshes.holes import punch
from sample_meshes.shapes import make_shape

REACH = 6.0


@pytest.fixture(scope="module")
def holed():
    """Torus with a hole: vertices, faces, loop."""
    cut = punch(*make_shape("torus", "bumps", count=3000, seed=1), 700, 4.0)
    (loop,) = boundary_loops(cut.vertices, cut.faces)
    return cut.vertices, cut.faces, loop


def cut_out(mesh, reach=REACH):
    vertices, faces, loop = mesh
    return cut_region(vertices, faces, loop.vertices, loop.faces, reach=reach)


def test_it_is_a_part_of_the_mesh(holed):
    vertices, faces, loop = holed
    region = cut_out(holed)
    np.testing.assert_array_equal(region.vertex_ids[region.faces], faces[region.face_ids])
    np.testing.assert_array_equal(region.vertex_ids[region.loop], loop.vertices)
    np.testing.assert_array_equal(np.unique(region.faces), np.arange(len(region.vertices)))
    assert (np.diff(region.vertex_ids) > 0).all()
    assert (np.diff(region.face_ids) > 0).all()
    assert region.known_vertices.all()
    assert region.known_faces.all()
    found = region.to_global(region.vertices)
    np.testing.assert_allclose(found, vertices[region.vertex_ids], atol=1e-7 * region.scale)


def test_its_unit_is_the_mean_edge_length_at_the_hole(holed):
    vertices, faces, loop = holed
    region = cut_out(holed)
    assert region.scale == pytest.approx(edge_lengths(vertices, faces[loop.faces]).mean())
    rim = region.vertices[region.loop]
    np.testing.assert_allclose(rim.min(axis=0), -rim.max(axis=0), atol=1e-6)


@pytest.mark.parametrize("reach", [0.1, 3.0, 6.0, 1000.0])
def test_it_holds_what_is_within_reach(holed, reach):
    vertices, faces, loop = holed
    region = cut_out(holed, reach)
    away = cKDTree(vertices[loop.vertices]).query(vertices)[0] / region.scale
    within = (away < reach - 1e-6)[faces].all(axis=1)
    beyond = (away > reach + 1e-6)[faces].any(axis=1)
    beyond[loop.faces] = False
    assert np.isin(loop.faces, region.face_ids).all()
    assert not beyond[region.face_ids].any()
    if reach > 1.0:
        assert np.mean(np.isin(np.flatnonzero(within), region.face_ids)) > 0.98  # but islands
    if reach == 1000.0:
        assert len(region.faces) == len(faces)


def test_other_sheets_nearby_are_left_out(sheet):
    points, faces = sheet(24, 22)
    gone = np.linalg.norm(points - points.mean(axis=0), axis=1) < 3.0
    left = faces[~gone[faces].any(axis=1)]
    both = np.concatenate([points, points + np.array([0.0, 0.0, 0.5])])
    mesh = np.concatenate([left, faces + len(points)])
    loop = next(loop for loop in boundary_loops(both, mesh) if not loop.is_rim)
    region = cut_region(both, mesh, loop.vertices, loop.faces, reach=REACH)
    assert region.vertex_ids.max() < len(points)
    alone = cut_region(points, left, loop.vertices, loop.faces, reach=REACH)
    np.testing.assert_array_equal(region.vertices, alone.vertices)
    np.testing.assert_array_equal(region.faces, alone.faces)


@pytest.mark.parametrize(
    ("scale", "offset"), [(2.0**20, 0.0), (2.0**-20, 0.0), (1e6, 0.0), (1e-6, 0.0), (1.0, 1e7)]
)
def test_units_and_place_make_no_difference(holed, scale, offset):
    vertices, faces, loop = holed
    expected = cut_out(holed)
    region = cut_region(vertices * scale + offset, faces, loop.vertices, loop.faces, reach=REACH)
    np.testing.assert_array_equal(region.faces, expected.faces)
    np.testing.assert_array_equal(region.vertex_ids, expected.vertex_ids)
    np.testing.assert_allclose(region.vertices, expected.vertices, atol=1e-7)
    if offset == 0.0:
        assert np.mean(region.vertices == expected.vertices) > 0.99


def test_far_from_the_origin_only_the_digits_of_the_input_are_lost(holed):
    vertices, faces, loop = holed
    far = vertices + 1e7
    there = cut_region(far, faces, loop.vertices, loop.faces, reach=REACH)
    back = cut_region(far - 1e7, faces, loop.vertices, loop.faces, reach=REACH)
    np.testing.assert_array_equal(there.vertices, back.vertices)


@pytest.fixture(scope="module")
def whole():
    return make_shape("torus", "bumps", count=3000, seed=1)


def near(vertices, centre, radius):
    return np.linalg.norm(vertices - vertices[centre], axis=1) < radius


def test_a_selected_patch_is_what_is_not_known(whole):
    vertices, faces = whole
    selected = near(vertices, 700, 4.0)
    (region,) = cut_selection(vertices, faces, selected, reach=REACH)
    ids = region.vertex_ids
    np.testing.assert_array_equal(region.known_vertices, ~selected[ids])
    np.testing.assert_array_equal(ids[region.faces], faces[region.face_ids])
    np.testing.assert_array_equal(region.known_faces, ~selected[faces[region.face_ids]].any(axis=1))
    assert np.isin(np.flatnonzero(selected), ids).all()
    at_patch = faces[selected[faces].any(axis=1)]
    rim = np.setdiff1d(at_patch, np.flatnonzero(selected))
    np.testing.assert_array_equal(ids[region.loop], rim)
    away = cKDTree(vertices[np.unique(at_patch)]).query(vertices)[0] / region.scale
    assert away[ids].max() < REACH + 1e-6


def test_each_patch_has_a_region_without_the_others(whole):
    vertices, faces = whole
    place = vertices[700]
    other = int(np.argmin(np.abs(np.linalg.norm(vertices - place, axis=1) - 9.0)))
    one, two = near(vertices, 700, 3.0), near(vertices, other, 3.0)
    regions = cut_selection(vertices, faces, one | two, reach=REACH)
    assert len(regions) == 2
    patches = [region.vertex_ids[~region.known_vertices] for region in regions]
    assert patches[0].min() < patches[1].min()
    found = sorted(patch.tolist() for patch in patches)
    assert found == sorted(np.flatnonzero(mask).tolist() for mask in (one, two))
    for region, patch in zip(regions, patches, strict=True):
        assert not np.isin(region.vertex_ids, np.setdiff1d(np.concatenate(patches), patch)).any()
        np.testing.assert_array_equal(region.vertex_ids[region.faces], faces[region.face_ids])


def test_a_scratch_one_vertex_wide_is_one_patch(sheet):
    points, faces = sheet(20, 20)
    scratch = np.abs(points[:, 1] - points[205, 1]) < 0.3
    scratch &= np.abs(points[:, 0] - 10.0) < 5.0
    assert scratch.sum() > 8
    assert not scratch[faces].all(axis=1).any()
    (region,) = cut_selection(points, faces, scratch, reach=REACH)
    assert (~region.known_vertices).sum() == scratch.sum()


def test_vertices_without_faces_are_ignored(whole):
    vertices, faces = whole
    more = np.concatenate([vertices, [[0.0, 0.0, 0.0]]])
    selected = np.zeros(len(more), dtype=bool)
    selected[-1] = True
    assert cut_selection(more, faces, selected, reach=REACH) == []


def test_everything_selected_is_one_region_without_anything_known(whole):
    vertices, faces = whole
    everything = np.ones(len(vertices), dtype=bool)
    (region,) = cut_selection(vertices, faces, everything, reach=REACH)
    assert not region.known_vertices.any()
    assert len(region.loop) == 0
