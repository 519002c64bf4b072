"""Relief that is copied as heights, against surfaces whose detail is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.comparison.figures import flipped_faces, mean_dihedral_angle
from meshlab_lowrank.comparison.roughness import detail_energy
from meshlab_lowrank.mesh.crossings import crossing_pairs
from meshlab_lowrank.mesh.fairing import fair_surface
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.stages import stage6c_relief_copied
from meshlab_lowrank.stages.stage6c_relief_copied import CopiedRelief
from meshlab_lowrank.stages.stage6c_relief_field import HeightField
from meshlab_lowrank.stages.stage6c_relief_fronts import Copy, copy_inwards
from meshlab_lowrank.stages.stage6c_relief_joining import Joiner
from meshlab_lowrank.stages.stage6c_relief_patches import PatchMaker
from tests.builders import hole_of

RADIUS = 7.0
PERIOD = 8.0  # on a lattice of triangles, which repeats after one edge


def waves(points):
    k = 2.0 * np.pi / PERIOD
    rows = points[:, 1] / np.sqrt(0.75)
    return 0.35 * (np.cos(k * points[:, 0]) + np.cos(k * rows))


def rubble(points, seed=4):
    """Random waves of all lengths from 5 to 30, the amplitude rising with the length."""
    chance = np.random.default_rng(seed)
    height = np.zeros(len(points))
    for _ in range(200):
        length = np.exp(chance.uniform(np.log(5.0), np.log(30.0)))
        angle, phase = chance.uniform(0.0, 2.0 * np.pi, 2)
        along = points[:, :2] @ [np.cos(angle), np.sin(angle)]
        height += np.sqrt(length) * np.cos(2.0 * np.pi * along / length + phase)
    return 0.8 * height / height.std()


def punched(points, faces, gone):
    """Give the hole on its smooth fill."""
    return hole_of(fair_surface(points, faces, gone), faces, gone)


def plain(sheet, relief, *, jitter=0.0, rows=58, columns=52, radius=RADIUS):
    """A sheet with relief and the hole in its middle: the truth and the hole."""
    points, faces = sheet(rows, columns, jitter=jitter)
    points = points - points.mean(axis=0)
    gone = np.hypot(*points[:, :2].T) < radius
    points[:, 2] = relief(points)
    return points, punched(points, faces, gone)


def miss(hole, truth, positions):
    return np.sqrt(((positions - truth)[hole.unknown] ** 2).sum(axis=1).mean())


@pytest.fixture(scope="module")
def repeated(sheet):
    return plain(sheet, waves)


@pytest.fixture(scope="module")
def loose(sheet):
    return plain(sheet, rubble, jitter=0.1, rows=70, columns=62, radius=11.0)


@pytest.fixture(scope="module")
def copied(loose):
    return CopiedRelief()(loose[1]).positions


def test_exact_copies_are_joined_to_the_truth_whatever_their_constants(repeated):
    truth, hole = repeated
    field = HeightField.over_base(hole, 18.0)
    exact = np.einsum("ij,ij->i", truth - field.base, field.normals)
    maker = PatchMaker.of_size(field, 6.0, 1.5)
    targets = maker.targets(3.0)
    copies = [
        Copy(int(centre), vertices, exact[vertices] + 5.0 * number)
        for number, (centre, vertices) in enumerate(
            zip(targets.centres, targets.vertices, strict=True)
        )
    ]
    joined = Joiner(field, copies, 1000.0).heights(np.ones(len(truth)))
    np.testing.assert_array_equal(joined[~hole.unknown], field.heights[~hole.unknown])
    np.testing.assert_allclose(joined, exact, atol=1e-3)
    assert np.abs(field.heights - exact).max() > 0.3


def test_waves_longer_than_the_split_are_the_smooth_fills(repeated):
    truth, hole = repeated
    field = HeightField.over_base(hole, 18.0)
    long = 3.0 * np.cos(2.0 * np.pi * field.base[:, 0] / 80.0)
    everything = np.arange(len(truth))
    centre = int(np.linalg.norm(field.base, axis=1).argmin())
    joined = Joiner(field, [Copy(centre, everything, long)], 18.0).heights(np.ones(len(truth)))
    nothing = Joiner(field, [Copy(centre, everything, 0.0 * long)], 18.0)
    change = (joined - nothing.heights(np.ones(len(truth))))[hole.unknown]
    assert np.abs(change).max() < 0.1


def test_without_a_copy_the_smooth_fill_stays(repeated):
    _, hole = repeated
    field = HeightField.over_base(hole, 18.0)
    joined = Joiner(field, [], 18.0).heights(np.ones(len(hole.positions)))
    np.testing.assert_allclose(joined, field.heights, atol=1e-9)


@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_on_repeated_relief_the_copies_are_the_truth_in_any_position(repeated, turn):
    truth, hole = repeated
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    rotation = np.eye(3) + np.sin(turn) * cross + (1.0 - np.cos(turn)) * cross @ cross
    moved = hole_of(hole.positions @ rotation.T, hole.faces, hole.unknown)
    field = HeightField.over_base(moved, 18.0)
    exact = np.einsum("ij,ij->i", truth @ rotation.T - field.base, field.normals)
    maker = PatchMaker.of_size(field, 8.0, 1.5)
    strength = field.carried_on(field.strength(field.heights))
    found = copy_inwards(
        maker, maker.targets(4.0), maker.sources(strength, 2500, 2, 0), strength, shortlist=1
    )
    errors = [exact[copy.vertices] - copy.heights for copy in found]
    errors = np.concatenate([each - each.mean() for each in errors])
    assert np.sqrt((errors**2).mean()) < 0.3 * exact.std()
    joined = Joiner(field, found, 100.0).heights(np.ones(len(truth)))
    assert miss(hole, truth, field.raised(joined) @ rotation) < 0.6 * miss(
        hole, truth, hole.positions
    )


def test_known_vertices_stay_and_runs_are_alike(loose, copied):
    _, hole = loose
    one = CopiedRelief()(hole).positions
    assert one.tobytes() == copied.tobytes()
    assert one[~hole.unknown].tobytes() == hole.positions[~hole.unknown].tobytes()
    different = CopiedRelief(seed=1, patches=300)(hole).positions
    assert np.abs(different - one).max() > 0.01


def looks(hole, truth, positions):
    """Roughness of a fill over that of its surroundings, mean dihedral angle over the truth's."""
    inside = ~hole.known_faces
    fill, there = (SurfacePart(each, hole.faces, inside) for each in (positions, truth))
    energy = detail_energy(fill, 1.0)
    return energy.inside / energy.around, mean_dihedral_angle(fill) / mean_dihedral_angle(there)


def test_random_relief_looks_like_its_surroundings(loose, copied):
    truth, hole = loose
    roughness, dihedral = looks(hole, truth, copied)
    assert 0.6 < roughness < 1.25
    assert 0.75 < dihedral < 1.2
    smooth, flat = looks(hole, truth, hole.positions)
    assert smooth < 0.65
    assert flat < 0.7
    assert miss(hole, truth, copied) < 1.6 * miss(hole, truth, hole.positions)  # a guess: root of 2


def test_strength_and_crispness_are_made_up_for(loose, copied):
    truth, hole = loose
    usual = looks(hole, truth, copied)
    weak = looks(hole, truth, CopiedRelief(strength=0.5)(hole).positions)
    crisp = looks(hole, truth, CopiedRelief(crispness=1.5)(hole).positions)
    assert weak[0] < 0.85 * usual[0]
    assert crisp[1] > 1.05 * usual[1]


def test_flat_surroundings_give_a_flat_fill(sheet):
    truth, hole = plain(sheet, lambda points: 0.0 * points[:, 0], jitter=0.1)
    np.testing.assert_allclose(CopiedRelief()(hole).positions, truth, atol=1e-6)


def test_relief_is_weak_where_it_is_weak_around(sheet):
    def half(points):
        return rubble(points) * (points[:, 0] > 0.0)

    truth, hole = plain(sheet, half, jitter=0.1, rows=60, columns=52)
    found = CopiedRelief()(hole)
    rise = np.abs(found.positions - hole.positions).max(axis=1)
    left, right = (rise[hole.unknown & (sign * truth[:, 0] > 2.0)].mean() for sign in (-1.0, 1.0))
    assert left < 0.6 * right


def test_a_region_that_wraps_a_tube_is_filled_without_folds_and_crossings(sheet):
    rows, columns, radius = 70, 44, 7.0
    flat, faces = sheet(rows, columns, jitter=0.1)
    angle = flat[:, 0] / (columns - 0.5) * 2.0 * np.pi
    height = 1.0 + 0.02 * rubble(flat)
    points = np.column_stack(
        [radius * height * np.cos(angle), radius * height * np.sin(angle), flat[:, 1]]
    )
    gone = (np.abs(flat[:, 1] - flat[:, 1].mean()) < 7.0) & (np.abs(angle - np.pi) < 1.0)
    hole = punched(points, faces, gone)
    found = CopiedRelief()(hole)
    assert np.abs(found.positions - hole.positions).max() > 0.05
    assert not flipped_faces(found.positions, faces).any()
    filled = np.flatnonzero(~hole.known_faces)
    assert len(crossing_pairs(found.positions, faces, filled, np.arange(len(faces)))) == 0
    outward = np.einsum("ij,ij->i", vertex_normals(found.positions, faces), points * [1, 1, 0])
    assert (outward[hole.unknown] > 0.0).all() or (outward[hole.unknown] < 0.0).all()


def test_strengths_are_carried_on_by_equal_ratios(sheet):
    truth, hole = plain(sheet, lambda points: 0.0 * points[:, 0])
    field = HeightField.over_base(hole, 18.0)
    one = field.carried_on(np.full(len(truth), 3.0))
    np.testing.assert_allclose(one, 3.0, rtol=1e-6)
    sides = field.carried_on(np.where(truth[:, 0] < 0.0, 0.01, 1.0))
    middle = hole.unknown & (np.hypot(*truth[:, :2].T) < 1.5)
    assert 0.03 < sides[middle].mean() < 0.3


def test_a_smooth_fill_that_lacks_nothing_stays(sheet):
    _, hole = plain(sheet, lambda points: 0.02 * (points[:, 0] ** 2 - points[:, 1] ** 2))
    assert CopiedRelief()(hole).positions.tobytes() == hole.positions.tobytes()


def test_a_crumpled_fill_is_calmed_and_another_left(repeated, loose):
    truth, hole = repeated
    right = replace(hole, positions=truth)
    assert CopiedRelief().calmed(right).positions.tobytes() == truth.tobytes()
    truth, hole = loose
    noise = np.random.default_rng(3).normal(0.0, 0.2, len(truth)) * hole.unknown
    crumpled = replace(hole, positions=truth + noise[:, None] * [0.0, 0.0, 1.0])
    calm = CopiedRelief().calmed(crumpled).positions
    assert looks(hole, truth, crumpled.positions)[1] > 1.3
    assert 0.85 < looks(hole, truth, calm)[1] < 1.15
    assert miss(hole, truth, calm) < 0.8 * miss(hole, truth, crumpled.positions)
    assert calm[~hole.unknown].tobytes() == truth[~hole.unknown].tobytes()


def test_narrow_surroundings_take_smaller_patches_and_then_none(sheet, monkeypatch):
    sizes = []
    usual = PatchMaker.of_size

    def noted(field, radius, spacing):
        sizes.append(radius)
        return usual(field, radius, spacing)

    monkeypatch.setattr(stage6c_relief_copied.PatchMaker, "of_size", noted)
    _, hole = plain(sheet, rubble, rows=44, columns=38)
    assert CopiedRelief()(hole) is not None
    assert len(sizes) > 1
    _, hole = plain(sheet, rubble, rows=24, columns=21)
    assert CopiedRelief()(hole) is None
    nothing = replace(hole, measured=np.zeros(len(hole.measured), dtype=bool))
    assert CopiedRelief()(nothing) is None
