"""Holes with ragged rims: in a flat sheet no face of the fill turns over or covers another."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.sheets import ragged_hole
from meshlab_lowrank.closing import smooth_fills
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill_shape import shapes_of
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.geometry import face_vectors
from meshlab_lowrank.mesh.polygons import is_simple, sides_of, triangulated
from meshlab_lowrank.mesh.topology import border_of
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_rings
from meshlab_lowrank.stages.stage1a_close_chart import ChartClosing, close_in_chart

NONE = InpaintParameters(detail="none")


def area(outline):
    x, y = outline.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def regular(corners):
    angle = 2.0 * np.pi * np.arange(corners) / corners
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def star(seed, corners=40):
    """A simple polygon with deep notches."""
    chance = np.random.default_rng(seed)
    angle = np.sort(chance.uniform(0.0, 2.0 * np.pi, corners))
    radius = chance.uniform(2.0, 9.0, corners)
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("seed", range(20))
def test_a_polygon_is_covered_once_by_triangles_that_keep_its_sides(seed):
    outline = star(seed)
    around = np.arange(len(outline))
    assert is_simple(outline, sides_of([around]))
    points, faces = triangulated(outline, [around], 1.0)
    space = np.column_stack([points, np.zeros(len(points))])
    areas = face_vectors(space, faces)[:, 2]
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(area(outline))
    assert np.array_equal(points[: len(outline)], outline)
    border = border_of(faces, len(points)).half_edges
    assert sorted(faces.ravel()[border]) == list(range(len(outline)))


def test_what_crosses_itself_is_not_simple():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    around, crossed = np.arange(4), np.array([0, 2, 1, 3])
    assert is_simple(square, sides_of([around]))
    assert not is_simple(square, sides_of([crossed]))
    touching = np.concatenate([square, [[0.5, 0.0]]])
    assert not is_simple(touching, sides_of([np.arange(5)]))
    assert triangulated(square, [crossed], 0.3) is None


def test_a_polygon_with_holes_is_covered_but_for_these():
    outer = 9.0 * regular(40)
    holes = [2.0 * regular(12)[::-1] + (4.0, 0.0), 3.0 * regular(16)[::-1] - (4.0, 0.0)]
    corners = np.concatenate([outer, *holes])
    outlines = np.split(np.arange(len(corners)), [40, 52])
    points, faces = triangulated(corners, outlines, 0.8)
    space = np.column_stack([points, np.zeros(len(points))])
    areas = face_vectors(space, faces)[:, 2]
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(sum(area(corners[each]) for each in outlines))
    border = border_of(faces, len(points)).half_edges
    assert sorted(faces.ravel()[border]) == list(range(len(corners)))


def test_a_hole_of_a_polygon_may_touch_its_outline():
    square = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4], [1, 2], [2, 1]])
    points, faces = triangulated(square, [np.arange(4), np.array([0, 4, 5])], 10.0)
    assert len(points) == 6
    space = np.column_stack([points, np.zeros(6)])
    assert face_vectors(space, faces)[:, 2].sum() == pytest.approx(16.0 - 1.5)


@pytest.mark.parametrize("seed", range(60))
def test_a_hole_in_a_flat_sheet_is_filled_flat(seed):
    vertices, faces, missing = ragged_hole(seed)
    if [loop.is_rim for loop in boundary_loops(vertices, faces)] != [True, False]:
        pytest.skip("more than one hole, or the sheet falls apart")
    result = inpaint(vertices, faces, parameters=NONE)
    (hole,) = (hole for hole in result.holes if hole.status == "filled")
    areas = face_vectors(result.vertices, result.faces[result.new_faces])
    assert areas[:, 2].min() > 0.0
    expected = np.abs(face_vectors(vertices, missing)[:, 2]).sum()
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(expected, rel=1e-5)
    assert (hole.folded_edges, hole.flat_faces) == (0, 0)


def region_of(seed):
    vertices, faces, _ = ragged_hole(seed)
    loop = next(loop for loop in boundary_loops(vertices, faces) if not loop.is_rim)
    (region,) = cut_rings(vertices, faces, [loop.vertices], [loop.faces], rings=9)
    return region


def test_without_another_way_some_fills_fold():
    """What the other closing is for: with the first alone, some of these holes fold."""
    regions = [region_of(seed) for seed in (8, 18, 30)]
    alone = AUTO.fair(AUTO.close(regions, edge_lengths=[None] * 3))
    assert max(shape.folded_edges for shape in shapes_of([each.region for each in alone])) > 0
    mended = smooth_fills(regions, [None] * 3, AUTO, lambda _: None)
    assert not any(shape.folded_edges for shape in shapes_of([each.region for each in mended]))
    assert any("in the plane of its rim" in each.note for each in mended)


def test_a_loop_that_is_no_polygon_from_above_is_left_to_the_first_way():
    region = region_of(8)
    vertices = region.vertices.copy()
    turned = region.loop[:4]
    vertices[turned] = vertices[np.roll(turned, 1)]
    twisted = type(region)(**{**vars(region), "vertices": vertices})
    with pytest.raises(StageError, match="no simple polygon"):
        close_in_chart(twisted)
    (error,) = ChartClosing()([twisted], edge_lengths=[None])
    assert isinstance(error, StageError)


def test_a_chart_does_not_depend_on_the_turn():
    region = region_of(18)
    q, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    turn = q * np.sign(np.linalg.det(q))
    turned = type(region)(**{**vars(region), "vertices": region.vertices @ turn.T})
    before, after = close_in_chart(region), close_in_chart(turned)
    for closed, upright in ((before, [0.0, 0.0, 1.0]), (after, turn @ [0.0, 0.0, 1.0])):
        new = closed.faces[~closed.known_faces]
        assert (face_vectors(closed.vertices, new) @ upright).min() > 0.0
