"""Boundary loops, what is measured of them, and which are outer rims."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.sheets import sheet
from meshlab_lowrank.hole_table import measure_holes
from meshlab_lowrank.mesh.boundary_walk import rim_centre
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from sample_meshes.holes import disc
from sample_meshes.shapes import make_shape

COLUMNS = [
    "id",
    "boundary_edges",
    "perimeter",
    "diameter",
    "area",
    "planarity",
    "centre",
    "normal",
    "component",
    "vertex",
    "is_rim",
    "is_pinched",
    "shape",
    "fillable",
    "reason",
]


def tube(sides, rings, place):
    """A grid closed in one direction, its faces counter-clockwise seen along u x w.

    place maps u in [0, 1) around and w in [0, 1] along to points.
    """
    u, w = np.divmod(np.arange(sides * (rings + 1)), rings + 1)
    a = (np.arange(sides)[:, None] * (rings + 1) + np.arange(rings)).ravel()
    b = (a + rings + 1) % len(u)
    faces = np.concatenate([np.stack([a, b, b + 1], axis=1), np.stack([a, b + 1, a + 1], axis=1)])
    return np.stack(place(u / sides, w / rings), axis=1), faces


def cylinder(length, sides=48, rings=12):
    def place(u, w):
        return np.cos(2 * np.pi * u), np.sin(2 * np.pi * u), length * w

    return tube(sides, rings, place)


def annulus(inner, sides=48, rings=8):
    def place(u, w):
        radius = inner + (1.0 - inner) * w
        return radius * np.cos(2 * np.pi * u), -radius * np.sin(2 * np.pi * u), 0.0 * u

    return tube(sides, rings, place)


def grid(side, noise=0.0):
    """A square sheet of side x side cells, seen from above."""
    row, column = np.divmod(np.arange((side + 1) ** 2), side + 1)
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    b = a + side + 1
    faces = np.concatenate([np.stack([a, b, b + 1], axis=1), np.stack([a, b + 1, a + 1], axis=1)])
    vertices = np.stack([row, column, 0 * row], axis=1).astype(np.float64)
    return vertices + noise * np.random.default_rng(0).normal(size=vertices.shape), faces


def without(faces, *gone):
    """Faces that use none of the vertices."""
    return faces[~np.isin(faces, gone).any(axis=1)]


@pytest.fixture(scope="module")
def sphere():
    return make_shape("sphere", "smooth", count=2000)


@pytest.fixture(scope="module")
def damaged(sphere):
    """A sphere with three holes, and the sizes of these in edges."""
    vertices, faces = sphere
    holes = [
        disc(vertices, faces, np.array(place, dtype=np.float64) * 50.0, radius)
        for place, radius in (((0, 0, 1), 5.0), ((1, 0, 0), 3.0), ((0, -1, 0), 1.5))
    ]
    return vertices, faces[~np.any(holes, axis=0)]


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_closed_meshes_have_no_loops(sphere):
    assert boundary_loops(*sphere) == ()
    table = measure_holes(*sphere)
    assert list(table) == COLUMNS
    assert all(column == [] for column in table.values())


def test_a_missing_face_is_a_loop_of_three_edges(sphere):
    vertices, faces = sphere
    (loop,) = boundary_loops(vertices, faces[1:])
    assert set(loop.vertices) == set(faces[0])
    sides = np.linalg.norm(vertices[np.roll(loop.vertices, -1)] - vertices[loop.vertices], axis=1)
    assert loop.perimeter == pytest.approx(sides.sum())
    assert loop.diameter == pytest.approx(sides.max())
    assert loop.planarity == pytest.approx(0.0, abs=1e-6)
    normal = np.cross(*(vertices[faces[0, 1:]] - vertices[faces[0, 0]]))
    assert loop.area == pytest.approx(0.5 * np.linalg.norm(normal))
    assert not loop.is_rim
    assert not loop.reason


def test_every_boundary_edge_is_in_one_loop_in_the_order_of_a_fill(damaged):
    vertices, faces = damaged
    directed = {tuple(edge) for edge in faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()}
    open_edges = {(b, a) for a, b in directed if (b, a) not in directed}
    walked = []
    for loop in boundary_loops(vertices, faces):
        edges = list(zip(loop.vertices, np.roll(loop.vertices, -1), strict=True))
        for (a, b), face in zip(edges, loop.faces, strict=True):
            assert {a, b} <= set(faces[face])
        walked += edges
    assert len(walked) == len(set(walked))
    assert set(walked) == open_edges


def test_order_is_longest_first_and_starts_at_the_smallest_vertex(damaged):
    loops = boundary_loops(*damaged)
    assert [loop.id for loop in loops] == [0, 1, 2]
    sizes = [len(loop.vertices) for loop in loops]
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == 3
    for loop in loops:
        assert loop.vertices[0] == loop.vertices.min()


def test_table_repeats_the_loops(damaged):
    table, loops = measure_holes(*damaged), boundary_loops(*damaged)
    assert list(table) == COLUMNS
    assert table["boundary_edges"] == [len(loop.vertices) for loop in loops]
    assert table["perimeter"] == [loop.perimeter for loop in loops]
    assert table["fillable"] == [True] * 3
    assert table["component"] == [0] * 3
    assert table["vertex"] == [loop.vertices.min() for loop in loops]


def test_the_centre_does_not_lean_to_where_vertices_are_dense():
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    dense = np.insert(
        corners, 1, np.column_stack([np.linspace(0.1, 3.9, 39), np.zeros(39)]), axis=0
    )
    np.testing.assert_allclose(rim_centre(dense), [2.0, 2.0])
    np.testing.assert_allclose(rim_centre(np.ones((3, 3))), [1.0, 1.0, 1.0])


def test_a_slit_looks_where_its_surroundings_do(sheet):
    vertices, faces = sheet(7, 7, jitter=0.0)
    doubled = 24  # in the middle, apart by less than tells a direction
    above = faces[(vertices[faces].mean(axis=1)[:, 1] > vertices[doubled, 1])]
    below = faces[(vertices[faces].mean(axis=1)[:, 1] < vertices[doubled, 1])]
    above = np.where(above == doubled, len(vertices), above)
    slit = np.vstack([vertices, vertices[doubled] + [0.0, 1e-6, 1e-6]])
    table = measure_holes(slit, np.vstack([above, below]))
    hole = table["is_rim"].index(False)
    assert table["boundary_edges"][hole] == 4
    np.testing.assert_allclose(table["normal"][hole], [0.0, 0.0, 1.0], atol=1e-4)


def test_measures_turn_and_scale_with_the_mesh(damaged):
    vertices, faces = damaged
    moved = 7.0 * vertices @ rotation(1).T + np.array([100.0, -50.0, 3.0])
    for before, after in zip(
        boundary_loops(vertices, faces), boundary_loops(moved, faces), strict=True
    ):
        np.testing.assert_array_equal(before.vertices, after.vertices)
        assert after.perimeter == pytest.approx(7.0 * before.perimeter)
        assert after.diameter == pytest.approx(7.0 * before.diameter)
        assert after.area == pytest.approx(49.0 * before.area)
        assert after.planarity == pytest.approx(before.planarity, rel=1e-6)
        assert after.turning == pytest.approx(before.turning, rel=1e-6)
        assert after.is_rim == before.is_rim


def test_loops_do_not_depend_on_the_numbering(damaged):
    vertices, faces = damaged
    chance = np.random.default_rng(0)
    number = chance.permutation(len(vertices))
    shuffled = np.empty_like(vertices)
    shuffled[number] = vertices
    turned = np.array([np.roll(face, chance.integers(3)) for face in number[faces]])
    before = {frozenset(number[loop.vertices]) for loop in boundary_loops(vertices, faces)}
    after = boundary_loops(shuffled, chance.permutation(turned))
    assert {frozenset(loop.vertices) for loop in after} == before


@pytest.mark.parametrize(("length", "rims"), [(0.5, 2), (5.0, 0), (20.0, 0)])
def test_ends_of_a_tube_are_holes_and_those_of_a_band_are_rims(length, rims):
    loops = boundary_loops(*cylinder(length))
    assert len(loops) == 2
    assert sum(loop.is_rim for loop in loops) == rims
    for loop in loops:
        assert len(loop.vertices) == 48
        assert loop.diameter == pytest.approx(2.0)
        polygon = 24.0 * np.sin(2.0 * np.pi / 48)
        assert loop.area == pytest.approx(polygon)
        assert loop.planarity == pytest.approx(0.0, abs=1e-6)


def test_turning_of_a_long_tube_and_of_a_plane():
    assert boundary_loops(*cylinder(30.0))[0].turning == pytest.approx(0.0, abs=0.2)
    turnings = sorted(loop.turning for loop in boundary_loops(*annulus(0.4)))
    np.testing.assert_allclose(turnings, [-2.0 * np.pi, 2.0 * np.pi])


@pytest.mark.parametrize("inner", [0.1, 0.4, 0.7, 0.9])
def test_inside_of_an_annulus_is_a_hole_and_outside_a_rim(inner):
    loops = sorted(boundary_loops(*annulus(inner)), key=lambda loop: loop.perimeter)
    assert [loop.is_rim for loop in loops] == [False, True]


@pytest.mark.parametrize(
    ("cap", "rim"), [(15, False), (45, False), (70, False), (100, True), (150, True)]
)
def test_a_sphere_is_open_when_more_than_half_of_it_is_gone(sphere, cap, rim):
    vertices, faces = sphere
    centre = vertices.mean(axis=0)
    upward = (vertices - centre)[:, 2] / np.linalg.norm(vertices - centre, axis=1)
    gone = np.flatnonzero(upward > np.cos(np.radians(cap)))
    loop = boundary_loops(vertices, without(faces, *gone))[0]
    assert loop.is_rim is rim


def test_rim_of_a_noisy_sheet_is_told_from_its_hole():
    vertices, faces = grid(60, noise=0.3)
    middle = np.hypot(*(vertices[:, :2] - 30.0).T)
    gone = np.flatnonzero((middle < 8.0) | (middle > 27.0))
    loops = [
        loop for loop in boundary_loops(vertices, without(faces, *gone)) if len(loop.vertices) > 20
    ]
    assert [loop.is_rim for loop in loops] == [True, False]


def test_holes_that_touch_at_a_vertex_are_split_there():
    vertices, faces = grid(8)
    first, second = 2 * 9 + 2, 4 * 9 + 4  # the holes around them share vertex 3 * 9 + 3
    loops = boundary_loops(vertices, without(faces, first, second))
    assert [len(loop.vertices) for loop in loops] == [32, 6, 6]
    assert [loop.pinched for loop in loops] == [False, True, True]
    assert [loop.is_rim for loop in loops] == [True, False, False]
    shared = set(loops[1].vertices) & set(loops[2].vertices)
    assert shared == {3 * 9 + 3}
    for loop in loops:
        assert len(set(loop.vertices)) == len(loop.vertices)


def test_a_hole_that_touches_the_rim_is_told_from_it():
    vertices, faces = grid(8)
    assert np.count_nonzero(faces[3] < 9) == 1  # one corner on the rim
    loops = boundary_loops(vertices, np.delete(faces, 3, axis=0))
    assert [len(loop.vertices) for loop in loops] == [32, 3]
    assert [loop.is_rim for loop in loops] == [True, False]
    assert [loop.pinched for loop in loops] == [True, True]


def test_sheets_that_touch_at_a_vertex_keep_their_rims_apart():
    vertices, faces = grid(4)
    other = faces + len(vertices)
    other[other == len(vertices)] = len(vertices) - 1  # its first corner is the other's last
    both = np.concatenate([vertices, vertices + 4.0])
    loops = boundary_loops(both, np.concatenate([faces, other]))
    assert [len(loop.vertices) for loop in loops] == [16, 16]
    assert [loop.is_rim for loop in loops] == [True, True]
    assert [loop.pinched for loop in loops] == [True, True]
    assert sorted(loop.component for loop in loops) == [0, 1]


def test_components_are_numbered_without_unused_vertices():
    vertices, faces = grid(3)
    many = np.concatenate([vertices[:5], vertices, vertices[:2], vertices + 10.0])
    loops = boundary_loops(many, np.concatenate([faces + 5, faces + 23]))
    assert [loop.component for loop in loops] == [0, 1]


def test_a_single_face_can_not_be_filled():
    vertices, faces = grid(3)
    alone = np.concatenate([vertices, vertices[:3] + 20.0])
    table = measure_holes(alone, np.concatenate([faces, [[16, 17, 18]]]))
    assert table["fillable"] == [True, False]
    assert table["reason"][0] == ""
    assert table["reason"][1].endswith(".")


def test_an_open_box_has_a_hole():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    square = [[0, 4, 6, 2], [0, 1, 5, 4], [4, 5, 7, 6], [6, 7, 3, 2], [2, 3, 1, 0]]
    faces = np.array([[q[i] for i in part] for q in square for part in ((0, 2, 1), (0, 3, 2))])
    (loop,) = boundary_loops(corners, faces)
    assert (len(loop.vertices), loop.is_rim) == (4, False)
    assert loop.area == pytest.approx(1.0)


def test_diameter_and_area_of_a_very_long_loop():
    sides = 4000
    loops = boundary_loops(*cylinder(1.0, sides=sides, rings=1))
    for loop in loops:
        assert loop.diameter == pytest.approx(2.0, rel=1e-5)
        assert loop.perimeter == pytest.approx(2.0 * sides * np.sin(np.pi / sides))


def test_rim_of_a_large_rough_sheet():
    assert [loop.is_rim for loop in boundary_loops(*sheet(70_000))] == [True]


def cells(side):
    """The middles of the faces of a grid."""
    vertices, faces = grid(side)
    return vertices[faces].mean(axis=1)[:, :2]


def block(middle, low, high):
    """The faces in a block of cells."""
    return ((middle > low) & (middle < high)).all(axis=1)


def plus(noise=0.0, seed=0):
    """A square sheet with four square holes around a square that hangs on its corners."""
    vertices, faces = grid(15, noise)
    middle = cells(15)
    gone = np.zeros(len(faces), dtype=np.bool_)
    for low in ((3, 6), (9, 6), (6, 3), (6, 9)):
        gone |= block(middle, low, np.add(low, 3))
    return vertices, faces[~gone][np.random.default_rng(seed).permutation(np.sum(~gone))]


@pytest.mark.parametrize(("noise", "seed"), [(0.0, 0), (0.15, 1), (0.15, 2)])
def test_holes_that_meet_at_vertices_are_walked_along_their_own_gaps(noise, seed):
    vertices, faces = plus(noise, seed)
    for turn in (np.eye(3), rotation(seed)):
        rim, *holes = boundary_loops(vertices @ turn.T, faces)
        assert rim.is_rim
        assert [len(loop.vertices) for loop in holes] == [12] * 4
        assert not any(loop.is_rim or loop.reason for loop in holes)
        assert all(loop.pinched for loop in holes)
        assert [loop.turning for loop in holes] == pytest.approx([-2.0 * np.pi] * 4, abs=1.5)
        assert len({loop.component for loop in (rim, *holes)}) == 1


def test_holes_that_meet_at_a_vertex_each_turn_once():
    vertices, faces = grid(12)
    middle = cells(12)
    gone = block(middle, (3, 3), (6, 6)) | block(middle, (6, 6), (9, 9))
    _, *holes = boundary_loops(vertices, faces[~gone])
    assert [len(loop.vertices) for loop in holes] == [12, 12]
    assert [loop.turning for loop in holes] == pytest.approx([-2.0 * np.pi] * 2)


def test_sheets_that_touch_at_a_vertex_keep_their_rims():
    vertices, faces = grid(6)
    other = vertices + np.array([6.0, 6.0, 0.0])
    corner = len(vertices) - 1  # (6, 6) is the first of the other
    number = np.append(np.arange(len(vertices)), np.arange(len(vertices)) + len(vertices))
    number[len(vertices)] = corner
    both = np.concatenate([faces, number[faces + len(vertices)]])
    loops = boundary_loops(np.concatenate([vertices, other]), both)
    assert [(len(loop.vertices), loop.is_rim) for loop in loops] == [(24, True), (24, True)]
    assert [loop.turning for loop in loops] == pytest.approx([2.0 * np.pi] * 2)
