"""Which creases are found at a rim, which belong together, and the curves that join them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.creases import creased_fills
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_crease_curves import curve_through, straightness
from meshlab_lowrank.stages.stage0_crease_pairs import arcs_between, junctions_of
from meshlab_lowrank.stages.stage0_creases import CreaseEnd, crease_ends
from meshlab_lowrank.stages.stage0_region import cut_rings
from meshlab_lowrank.stages.stage0_sharp_edges import STRONG, may_have_creases, sharp_edges
from sample_meshes.parts import PARTS, edge

UP = np.array([[-0.7, 0.0, 0.7], [0.7, 0.0, 0.7]])


def region_of(part, noise=0.0):
    faces = part.faces[~part.removed]
    vertices = part.noisy(noise)
    loops = boundary_loops(vertices, faces)
    hole = min(loops, key=lambda loop: np.linalg.norm(vertices[loop.vertices], axis=1).max())
    (region,) = cut_rings(vertices, faces, [hole.vertices], [hole.faces], rings=9)
    return region


def straight_end(place, start, towards, angle=1.5, sides=UP):
    """A straight crease of eight vertices that enters at a point."""
    towards = np.asarray(towards, dtype=float) / np.linalg.norm(towards)
    points = np.asarray(start, dtype=float) - np.arange(8)[:, None] * towards
    return CreaseEnd(place, points, angle, sides, ())


def ring(radius=5.0):
    turn = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    return radius * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("name", PARTS)
def test_all_creases_of_parts_are_found(name, noise):
    region = region_of(PARTS[name](6.0), noise)
    assert may_have_creases([region], STRONG) == [True]
    ends = crease_ends(region, sharp_edges(region.vertices, region.faces, STRONG), STRONG)
    wanted = {"box corner": 3, "blunt corner": 3, "stairs": 8, "groove": 8, "chamfer": 4}
    assert len(ends) == wanted.get(name, 2)
    for end in ends:
        assert np.allclose(end.points[0], region.vertices[region.loop[end.place]])
        assert end.direction @ (end.points[0] - end.points[-1]) > 0.0


@pytest.mark.parametrize("angle", [40.0, -75.0, 120.0])
def test_a_crease_has_its_angle_its_sign_and_its_sides(angle):
    region = region_of(edge(6.0, angle))
    ends = crease_ends(region, sharp_edges(region.vertices, region.faces, STRONG), STRONG)
    for end in ends:
        assert np.degrees(end.angle) == pytest.approx(angle)
        assert abs(end.direction[1]) == pytest.approx(1.0)
        left = np.sign(-end.direction[1]) * np.sign(angle)  # of who looks along the crease
        assert np.sign(end.side_normals[0, 0]) == left


def test_noise_is_no_crease():
    region = region_of(edge(6.0, 0.0), 0.25)
    ends = crease_ends(region, sharp_edges(region.vertices, region.faces, STRONG), STRONG)
    assert ends == []


def test_few_edges_are_no_strong_crease():
    region = region_of(edge(6.0, 90.0), 0.02)
    edges = sharp_edges(region.vertices, region.faces, STRONG)
    assert len(crease_ends(region, edges, STRONG)) == 2
    assert crease_ends(region, edges, replace(STRONG, edges=30)) == []


def test_a_line_an_arc_and_a_cubic_are_found_again():
    t = np.arange(8.0)
    line = curve_through(
        np.stack([-5.0 - t, 0 * t, 0 * t], 1), np.stack([5.0 + t, 0 * t, 0 * t], 1)
    )
    assert np.abs(line.curve[:, 1:]).max() < 1e-12
    assert line.turn == pytest.approx(0.0, abs=1e-9)

    def at(turn):
        return 9.0 * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1) + [1.0, 2.0, 3.0]

    arc = curve_through(at(-0.6 - t / 9.0), at(0.9 + t / 9.0))
    assert np.allclose(np.linalg.norm(arc.curve - [1.0, 2.0, 3.0], axis=1), 9.0, atol=1e-6)
    assert arc.turn == pytest.approx(1.5, abs=1e-6)
    assert np.allclose(arc.curve[[0, -1]], at(np.array([-0.6, 0.9])))

    def swing(x):
        return np.stack([x, 0.004 * (x**3 - 25.0 * x), 0.0 * x], axis=1)

    cubic = curve_through(swing(-5.0 - t), swing(5.0 + t))
    assert np.allclose(cubic.curve, swing(cubic.curve[:, 0]), atol=1e-6)


def test_straightness_tells_a_bend():
    x = np.arange(9.0)
    line, parabola = straightness(np.stack([x, 0.02 * x**2, 0.0 * x], axis=1))
    assert line > 0.1
    assert parabola < 1e-2


def test_two_ends_of_a_line_are_a_pair():
    ends = [
        straight_end(0, [5, 0, 0], [-1, 0, 0]),
        straight_end(20, [-5, 0, 0], [1, 0, 0], sides=UP[::-1]),
    ]
    (junction,) = junctions_of(ends, ring(), [None, None])
    assert junction.ends == (0, 1)
    assert len(junction.curves) == 1
    assert junctions_of(ends, ring(), [None, None], only_corners=True) == []


@pytest.mark.parametrize(
    "change",
    [
        {"angle": -1.5},  # a ridge and a valley
        {"angle": 0.6},
        {"sides": UP},  # the slopes are on the wrong sides
        {"start": [-5, 3, 0]},  # beside it
        {"towards": [0.3, 1, 0]},
    ],
)
def test_what_does_not_fit_is_no_pair(change):
    values = {"place": 20, "start": [-5, 0, 0], "towards": [1, 0, 0], "sides": UP[::-1]}
    ends = [straight_end(0, [5, 0, 0], [-1, 0, 0]), straight_end(**{**values, **change})]
    assert junctions_of(ends, ring(), [None, None]) == []


def three(peak=(0.0, 0.0, 3.0), shift=0.0):
    """Three creases that point to a peak, the last one past it."""
    starts = ring()[[0, 13, 26]]
    aims = [peak - starts[0], peak - starts[1], peak - starts[2] + [0.0, 0.0, shift]]
    return [
        straight_end(place, start, aim)
        for place, start, aim in zip((0, 13, 26), starts, aims, strict=True)
    ]


def test_three_creases_meet_in_a_corner():
    (junction,) = junctions_of(three(), ring(), [None] * 3)
    assert junction.ends == (0, 1, 2)
    for curve in junction.curves:
        assert np.allclose(curve[-1], [0.0, 0.0, 3.0], atol=1e-9)


def test_flat_sides_correct_the_corner():
    truth = np.array([0.0, 0.0, 3.0])
    starts = ring()[[0, 13, 26]]
    planes = []
    for one, two in ((0, 1), (1, 2), (2, 0)):
        normal = np.cross(starts[one] - truth, starts[two] - truth)
        normal /= np.linalg.norm(normal)
        planes.append(np.append(normal, normal @ truth))
    ends = three(shift=0.4)
    off = junctions_of(ends, ring(), [None] * 3)[0].curves[0][-1]
    better = junctions_of(ends, ring(), planes)[0].curves[0][-1]
    assert np.linalg.norm(better - truth) < 0.7 * np.linalg.norm(off - truth)


@pytest.mark.parametrize("ends", [three(shift=3.0), three(peak=np.array([0.0, 0.0, 40.0]))])
def test_creases_that_miss_one_another_or_meet_far_off_have_no_corner(ends):
    assert junctions_of(ends, ring(), [None] * 3) == []


def test_pieces_between_parallel_creases_run_from_crease_to_crease():
    places = ring()
    ends = [
        straight_end(place, places[place], [towards, 0, 0], sides=UP[::step])
        for place, towards, step in ((4, -1, 1), (16, 1, -1), (24, 1, -1), (36, -1, 1))
    ]
    junctions = junctions_of(ends, places, [None] * 4)
    assert sorted(each.ends for each in junctions) == [(0, 1), (2, 3)]
    pieces = arcs_between(junctions)
    assert sorted(map(sorted, pieces)) == [[(0, 1)], [(1, 2), (3, 0)], [(2, 3)]]


def test_creases_of_a_pattern_are_left_to_the_detail():
    region = region_of(edge(6.0, 90.0), 0.02)
    (fill,) = creased_fills([region], [None], STRONG)
    assert fill.creases == 1
    assert creased_fills([region], [None], replace(STRONG, joined=1.1)) == [None]
