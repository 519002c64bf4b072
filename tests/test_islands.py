"""Pieces of measured surface inside a hole: what is filled is the gap around them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.crossings import crossing_pairs
from meshlab_lowrank.mesh.geometry import face_vectors
from meshlab_lowrank.mesh.topology import border_of
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.tuning.trust import Trust
from tests.test_boundary_loops import block, cells, grid
from tests.test_wiring import FAST, FULL, Given, Lifted

NONE = InpaintParameters(detail="none")


def cut(points, faces, gone):
    return points, faces[~gone[faces].any(axis=1)]


def waves(points):
    return 0.5 * np.sin(0.4 * points[:, 0]) * np.cos(0.3 * points[:, 1])


@pytest.fixture(scope="module")
def middle(sheet):
    points, faces = sheet(36, 30)
    points -= points.mean(axis=0)
    return points, faces


def gap(points, inner=4.0, outer=9.0):
    distance = np.hypot(*points[:, :2].T)
    return (distance > inner) & (distance < outer)


def shapes(result):
    return [(hole.shape, hole.status) for hole in result.holes]


def crossings(result):
    return crossing_pairs(
        result.vertices,
        result.faces,
        np.flatnonzero(result.new_faces),
        np.arange(len(result.faces)),
    )


RIM = ("rim", "skipped")


def test_a_ring_in_a_flat_sheet_is_filled_flat_between_its_loops(middle):
    points, faces = middle
    gone = gap(points)
    result = inpaint(*cut(points, faces, gone), parameters=NONE)
    assert shapes(result) == [RIM, ("ring", "filled"), ("island", "filled")]
    areas = face_vectors(result.vertices, result.faces[result.new_faces])
    assert areas[:, 2].min() > 0.0
    missing = np.abs(face_vectors(points, faces[gone[faces].any(axis=1)])[:, 2]).sum()
    assert areas[:, 2].sum() == pytest.approx(missing)
    assert np.abs(areas[:, :2]).max() < 1e-9
    assert len(crossings(result)) == 0
    _, ring, island = result.holes
    assert ring.reason == "It is a ring round an island, filled between the boundary loops 1 and 2."
    assert island.reason.startswith("It is the rim of a piece of surface within hole 1,")
    assert (ring.new_faces, island.new_faces) == (result.new_faces.sum(), 0)
    border = border_of(result.faces, len(result.vertices))
    assert (border.non_manifold, border.inconsistent) == (0, 0)
    assert len(boundary_loops(result.vertices, result.faces)) == 1


def test_rims_that_are_to_be_closed_too_are_not_closed_over_an_island(sheet):
    points, faces = sheet(24, 20)
    points -= points.mean(axis=0)
    parameters = InpaintParameters(detail="none", closerim=True)
    stages = []
    result = inpaint(
        *cut(points, faces, gap(points, 3.0, 6.5)),
        parameters=parameters,
        progress=lambda event: stages.append((event.fraction, event.stage)),
    )
    assert shapes(result) == [("rim", "filled"), ("ring", "filled"), ("island", "filled")]
    assert [hole.new_faces for hole in result.holes if hole.shape == "island"] == [0]
    assert sum(hole.new_faces for hole in result.holes) == result.new_faces.sum()
    assert len(boundary_loops(result.vertices, result.faces)) == 0
    assert [fraction for fraction, _ in stages] == sorted(fraction for fraction, _ in stages)
    assert stages[-1] == (1.0, "done")


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_place_and_size_of_the_mesh_change_nothing(middle, scale):
    points, faces = middle
    bent = np.column_stack([points[:, :2], waves(points)])
    q, _ = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))
    turn = scale * q * np.sign(np.linalg.det(q))
    one = inpaint(*cut(bent, faces, gap(points)), parameters=NONE)
    other = inpaint(*cut(bent @ turn.T + 5.0 * scale, faces, gap(points)), parameters=NONE)
    assert shapes(one) == shapes(other) == [RIM, ("ring", "filled"), ("island", "filled")]
    assert np.array_equal(one.vertices[: len(points)], bent)
    truth = one.vertices[one.new_vertices]
    assert np.abs(truth[:, 2] - waves(truth)).max() < 0.25
    assert len(crossings(one)) == len(crossings(other)) == 0


def test_several_pieces_and_single_faces_lie_in_one_gap(middle):
    points, faces = middle
    gone = np.hypot(*points[:, :2].T) < 11.0
    for place in ((-5.0, 0.0), (5.0, 2.0)):
        gone &= np.hypot(*(points[:, :2] - place).T) > 2.5
    kept = ~gone[faces].any(axis=1)
    centres = points[faces].mean(axis=1)
    kept[np.argmin(np.hypot(*(centres[:, :2] - [0.0, -6.0]).T))] = True
    result = inpaint(points, faces[kept], parameters=NONE)
    islands = [hole for hole in result.holes if hole.shape == "island"]
    assert len(islands) == 3
    assert min(hole.boundary_edges for hole in islands) == 3
    assert len(crossings(result)) == 0
    assert len(boundary_loops(result.vertices, result.faces)) == 1


def test_an_island_may_hang_on_a_single_vertex():
    points, faces = grid(15)
    middle = cells(15)
    gone = block(middle, (3, 3), (12, 12))
    gone &= ~block(middle, (3, 3), (6, 6)) & ~block(middle, (6, 6), (8, 8))
    result = inpaint(points, faces[~gone], parameters=NONE)
    assert shapes(result) == [RIM, ("ring", "filled"), ("island", "filled")]
    assert len(crossings(result)) == 0
    areas = face_vectors(result.vertices, result.faces[result.new_faces])[:, 2]
    assert (areas > 0.0).all() or (areas < 0.0).all()
    assert np.abs(areas.sum()) == pytest.approx(81.0 - 9.0 - 4.0)
    assert len(boundary_loops(result.vertices, result.faces)) == 1


def test_a_sheet_below_the_hole_is_no_island(middle):
    points, faces = middle
    hole = np.hypot(*points[:, :2].T) < 9.0
    below = np.hypot(*points[:, :2].T) < 4.0
    sheet = faces[~hole[faces].any(axis=1)]
    piece = faces[below[faces].all(axis=1)] + len(points)
    both = np.concatenate([points, points - [0.0, 0.0, 6.0]])
    result = inpaint(both, np.concatenate([sheet, piece]), parameters=NONE)
    assert shapes(result) == [RIM, ("hole", "filled"), RIM]


@dataclass(frozen=True)
class Refusing(Stage):
    """A closing that can do nothing."""

    def __call__(self, regions, *, edge_lengths):  # noqa: ARG002
        return [StageError("This is too hard.") for _ in regions]


@pytest.mark.parametrize("height", [0.0, 1.5])
def test_a_ring_that_can_not_be_filled_leaves_the_hole_open_if_something_is_crossed(middle, height):
    points, faces = middle
    raised = points + height * (np.hypot(*points[:, :2].T) <= 4.0)[:, None] * [0.0, 0.0, 1.0]
    stages = replace(AUTO, close_again=Refusing())
    result = inpaint(*cut(raised, faces, gap(points)), parameters=NONE, pipeline=stages)
    assert len(crossings(result)) == 0
    if height:
        assert shapes(result) == [RIM, ("hole", "filled"), RIM]
    else:
        assert shapes(result) == [RIM, ("hole", "failed"), RIM]
        assert result.holes[1].reason == (
            "A piece of measured surface lies in it, and the ring between can't be filled: "
            "This is too hard."
        )


def test_a_piece_that_nothing_tells_of_is_not_run_through(middle):
    points, faces = middle
    hole = np.hypot(*points[:, :2].T) < 9.0
    piece = np.hypot(*points[:, :2].T) < 3.0
    upright = points[:, [0, 2, 1]]  # stands in the gap
    sheet = faces[~hole[faces].any(axis=1)]
    both = np.concatenate([points, upright])
    faces = np.concatenate([sheet, faces[piece[faces].all(axis=1)] + len(points)])
    result = inpaint(both, faces, parameters=NONE)
    assert shapes(result) == [RIM, ("hole", "failed"), RIM]
    assert "what bounds the gap between the two can't be told" in result.holes[1].reason
    assert not result.new_faces.any()


def bumps(points):
    k = 2.0 * np.pi / 7.0
    return 0.4 * (np.cos(k * points[:, 0]) + np.cos(k * points[:, 1]))


def test_a_ring_gets_the_detail_of_its_surroundings(sheet):
    points, faces = sheet(64, 56)
    points -= points.mean(axis=0)
    points[:, 2] = bumps(points)
    damaged = cut(points, faces, gap(points, 3.0, 7.0))
    detailed = inpaint(*damaged)
    (ring,) = (hole for hole in detailed.holes if hole.shape == "ring")
    assert ring.trust > 0.5
    assert [hole.trust for hole in detailed.holes if hole.shape == "island"] == [ring.trust]

    def error(result):
        new = result.vertices[result.new_vertices]
        return np.sqrt(np.mean((new[:, 2] - bumps(new)) ** 2))

    assert error(detailed) < 0.5 * error(inpaint(*damaged, parameters=NONE))


def lid(height, faces, points):
    """A closed plate above the middle of a sheet."""
    bottom = points + np.array([0.0, 0.0, height])
    top = bottom + np.array([0.0, 0.0, 0.5])
    middle = np.hypot(*points[:, :2].T) < 6.0
    piece = faces[middle[faces].all(axis=1)]
    n = len(points)
    sides = piece.ravel()[border_of(piece, n).half_edges]
    heads = np.roll(piece, -1, axis=1).ravel()[border_of(piece, n).half_edges]
    walls = [
        np.column_stack([sides, sides + n, heads + n]),
        np.column_stack([sides, heads + n, heads]),
    ]
    return np.concatenate([top, bottom]), np.concatenate([piece, piece[:, ::-1] + n, *walls])


@pytest.fixture(scope="module")
def egg(middle):
    points, faces = middle
    bumpy = np.column_stack([points[:, :2], bumps(points)])
    return cut(bumpy, faces, np.hypot(*points[:, :2].T) < 3.5)


def test_detail_that_crosses_another_part_is_taken_back(egg, middle):
    points, faces = egg
    extra, plate = lid(3.0, middle[1], middle[0])
    both = np.concatenate([points, extra]), np.concatenate([faces, plate + len(points)])
    lifted = replace(FAST, finish=Lifted())  # by five edge lengths
    free = inpaint(*egg, parameters=FULL, pipeline=lifted)
    below = inpaint(*both, parameters=FULL, pipeline=lifted)
    smooth = inpaint(*both, parameters=NONE)
    assert free.vertices[free.new_vertices, 2].max() > 3.0
    (hole,) = (hole for hole in below.holes if hole.status == "filled")
    assert hole.reason.startswith("The detail made the fill cross the surface around it")
    assert hole.trust == 0.0
    assert np.array_equal(below.vertices, smooth.vertices)


def test_detail_that_outgrows_the_smooth_fill_is_taken_back(egg):
    trust = Trust(np.full(3, 1.0), 0.8)
    lifted = replace(FAST, finish=Lifted(), tune=Given(trust))
    result = inpaint(*egg, pipeline=lifted)
    (hole,) = (hole for hole in result.holes if hole.status == "filled")
    assert hole.reason.startswith("The detail made the fill outgrow the smooth one")
    smooth = inpaint(*egg, parameters=NONE)
    assert np.array_equal(result.vertices, smooth.vertices)
    usual = inpaint(*egg, pipeline=replace(FAST, tune=Given(trust)))
    assert not np.array_equal(usual.vertices, smooth.vertices)


def dome(points):
    """Bend a sheet to a sphere of radius 20 that turns down from the middle."""
    far = np.hypot(*points[:, :2].T)
    turn = far / 20.0
    flat = points[:, :2] * (20.0 * np.sin(turn) / np.maximum(far, 1e-12))[:, None]
    return np.column_stack([flat, 20.0 * np.cos(turn)])


def test_a_smooth_fill_that_crosses_another_part_is_made_flatter(middle):
    points, faces = middle
    hole = cut(dome(points), faces, np.hypot(*points[:, :2].T) < 7.0)
    free = inpaint(*hole, parameters=NONE)
    rim = hole[0][boundary_loops(*hole)[1].vertices, 2].min()
    top = free.vertices[free.new_vertices, 2].max()
    assert top - rim > 1.0
    extra, plate = lid(0.5 * (rim + top), faces, points)
    both = np.concatenate([hole[0], extra]), np.concatenate([hole[1], plate + len(points)])
    result = inpaint(*both, parameters=NONE)
    (record,) = (each for each in result.holes if each.status == "filled")
    assert "runs through measured surface" in record.reason
    assert len(crossings(result)) == 0


def test_what_passes_through_a_hole_is_counted(middle):
    points, faces = middle
    flat = cut(points, faces, np.hypot(*points[:, :2].T) < 7.0)
    angle = 2.0 * np.pi * np.arange(12) / 12
    ring = 2.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ends = [np.column_stack([ring, np.full(12, z)]) for z in (-5.0, 5.0)]
    pole = np.concatenate([*ends, [[0.0, 0, -5], [0.0, 0, 5]]])
    i, j = np.arange(12), np.roll(np.arange(12), -1)
    sides = [
        np.column_stack([i, j, j + 12]),
        np.column_stack([i, j + 12, i + 12]),
        np.column_stack([j, i, np.full(12, 24)]),
        np.column_stack([i + 12, j + 12, np.full(12, 25)]),
    ]
    both = np.concatenate([flat[0], pole])
    result = inpaint(
        both, np.concatenate([flat[1], np.concatenate(sides) + len(flat[0])]), parameters=NONE
    )
    assert shapes(result) == [RIM, ("hole", "filled")]
    count = len(crossings(result))
    assert count > 12
    assert f"passes through it ({count} pairs of faces cross)" in result.holes[1].reason
