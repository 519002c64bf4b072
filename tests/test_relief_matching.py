"""Copied relief that is made as strong and as crisp as its surroundings, and no stronger."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.comparison.figures import mean_dihedral_angle
from meshlab_lowrank.hole import depth_of
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.mesh.topology import vertex_adjacency
from meshlab_lowrank.stages.stage6c_relief_copied import CopiedRelief
from meshlab_lowrank.stages.stage6c_relief_crispness import Crispness
from meshlab_lowrank.stages.stage6c_relief_field import HeightField
from meshlab_lowrank.stages.stage6c_relief_fronts import copy_inwards
from meshlab_lowrank.stages.stage6c_relief_joining import Joiner
from meshlab_lowrank.stages.stage6c_relief_matching import matched
from meshlab_lowrank.stages.stage6c_relief_patches import PatchMaker
from tests.test_copied_relief import miss, plain, punched, rubble

CUTOFF = 18.0


def standing_out(heights, faces):
    """How far each vertex is from the mean of its neighbours."""
    around = vertex_adjacency(faces, len(heights)).astype(np.float64)
    return np.abs(heights - (around @ heights) / np.asarray(around.sum(axis=1)).ravel())


@pytest.fixture(scope="module")
def hole(sheet):
    return plain(sheet, rubble, jitter=0.1, rows=70, columns=62, radius=11.0)[1]


@pytest.fixture(scope="module")
def field(hole):
    return HeightField.over_base(hole, CUTOFF)


def joined(field, split):
    maker = PatchMaker.of_size(field, 9.0, 1.5)
    strength = field.carried_on(field.strength(field.heights))
    sources = maker.sources(strength, 1000, 1, 0)
    copies = copy_inwards(maker, maker.targets(7.2), sources, strength, shortlist=20)
    return Joiner(field, copies, split)


@pytest.fixture(scope="module")
def joiner(field):
    return joined(field, 10.0)


@pytest.mark.parametrize(("strong", "crisp"), [(0.8, 1.0), (0.8, 1.1), (1.0, 1.1)])
def test_strength_and_angles_are_both_those_wanted(field, joiner, strong, crisp):
    strength = strong * field.carried_on(field.strength(field.heights))
    crispness = Crispness(field)
    angles = crisp * crispness.wanted
    heights = matched(field, joiner, crispness, strength=strength, angles=angles)
    inside = field.hole.unknown & (depth_of(field.hole) > 2.5)
    assert 0.9 < field.strength(heights)[inside].mean() / strength[inside].mean() < 1.1
    assert 0.9 < crispness.ratio(heights) / crisp < 1.1
    known = ~field.hole.unknown
    assert heights[known].tobytes() == field.heights[known].tobytes()


@pytest.mark.parametrize("seed", [5, 6])
def test_strong_relief_at_the_rim_does_not_count_for_the_inside(sheet, seed):
    _, hole = plain(
        sheet, lambda points: rubble(points, seed), jitter=0.1, rows=60, columns=54, radius=6.0
    )
    field = HeightField.over_base(hole, CUTOFF)
    strength = 0.6 * field.carried_on(field.strength(field.heights))
    crispness = Crispness(field)
    angles = 0.9 * crispness.wanted
    heights = matched(field, joined(field, 8.0), crispness, strength=strength, angles=angles)
    inside = hole.unknown & (depth_of(hole) > 2.5)
    assert 0.95 < field.strength(heights)[inside].mean() / strength[inside].mean() < 1.1


def test_no_vertex_stands_out_further_than_known_ones(field):
    faces, unknown = field.hole.faces, field.hole.unknown
    crispness = Crispness(field)
    noise = np.random.default_rng(2).normal(0.0, 1.0, len(unknown)) * unknown
    calm = crispness.scaled(field.heights + noise, np.ones(len(unknown)))
    furthest = standing_out(field.heights, faces)[field.source].max()
    inner = unknown & (depth_of(field.hole) > 2.0)
    assert standing_out(field.heights + noise, faces)[inner].max() > 2.0 * furthest
    assert standing_out(calm, faces)[inner].max() < 1.3 * furthest


def test_the_rim_keeps_its_own_curvature_however_strong_the_copies(field, joiner, monkeypatch):
    gains = []
    usual = joiner.heights
    monkeypatch.setattr(joiner, "heights", lambda gain: (gains.append(gain), usual(gain))[1])
    strength = 2.0 * field.carried_on(field.strength(field.heights))
    crispness = Crispness(field)
    matched(field, joiner, crispness, strength=strength, angles=crispness.wanted)
    assert gains[-1][field.hole.unknown].mean() > 1.5
    assert (gains[-1][~field.hole.unknown] == 1.0).all()


def test_angles_expected_are_those_of_the_mean_edge_where_creases_have_short_ones(sheet):
    points, faces = sheet(60, 54)
    points = points - points.mean(axis=0)
    phase = 2.0 * np.pi * points[:, 0] / 9.0
    noise = np.random.default_rng(1).normal(0.0, 0.2, len(points))
    points[:, 2] = noise * (np.cos(phase) > 0.0)
    points[:, 0] -= 0.9 * 9.0 / (2.0 * np.pi) * np.sin(phase)  # dense where it is rough
    hole = punched(points, faces, np.hypot(*points[:, :2].T) < 8.0)
    known = mean_dihedral_angle(SurfacePart(points, faces, hole.known_faces))
    found = CopiedRelief()(hole).positions
    inside = mean_dihedral_angle(SurfacePart(found, faces, ~hole.known_faces))
    assert 0.75 < inside / known < 1.05


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_longer_waves_in_a_shallow_hole_would_be_further_from_the_truth(sheet, seed):
    truth, hole = plain(
        sheet, lambda points: rubble(points, seed), jitter=0.1, rows=60, columns=54, radius=6.0
    )
    usual = miss(hole, truth, CopiedRelief()(hole).positions)
    longer = miss(hole, truth, CopiedRelief(share=CopiedRelief.split)(hole).positions)
    assert usual < 0.97 * longer
    assert usual < 1.3 * miss(hole, truth, hole.positions)  # two unrelated reliefs: root of 2


def test_what_counts_more_decides_what_is_carried_on(field):
    left = field.base[:, 0] < 0.0
    values = np.where(left, 1.0, 3.0)
    usual = field.carried_on(values)[field.hole.unknown].mean()
    leftish = field.carried_on(values, np.where(left, 100.0, 1.0))[field.hole.unknown].mean()
    assert leftish < 0.9 * usual
