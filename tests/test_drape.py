"""The smooth fill laid where the surroundings foretell the base below their detail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.mesh.fairing import fair_surface, membrane
from meshlab_lowrank.presets import AUTO, PAPER
from meshlab_lowrank.stages.stage1d_drape_as_faired import AsFaired
from meshlab_lowrank.stages.stage1d_drape_foretold import (
    ForetoldDrape,
    folds_more,
    joined_at_rim,
    spread_where_folded,
)
from meshlab_lowrank.stages.stage1d_drape_splines import (
    Coarse,
    coarse_surface,
    foretelling,
    laid_out,
)
from meshlab_lowrank.stages.stage1e_base_low_pass import LowPassBase
from tests.builders import hole_of

LENGTH, RADIUS = 7.0, 13.5


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture(scope="module")
def egg_box(sheet):
    """A bent egg box with a hole that was faired to its rim: the hole, and the bend."""
    points, faces = sheet(62, 54)
    points -= points.mean(axis=0)
    x, y = points[:, :2].T
    bend = 0.006 * (x**2 - 0.5 * y**2)
    k = 2.0 * np.pi / LENGTH
    points[:, 2] = bend + 0.5 * (np.cos(k * x) + np.cos(k * y))
    unknown = np.hypot(x, y) < RADIUS
    points[unknown, 2] = 0.0
    points = fair_surface(points, faces, unknown)
    return replace(hole_of(points, faces, unknown), wavelength=LENGTH), bend


@pytest.fixture(scope="module")
def draped(egg_box):
    return ForetoldDrape()(egg_box[0])


def deep(hole):
    return np.hypot(*hole.positions[:, :2].T) < 0.7 * RADIUS


def test_the_fill_comes_nearer_to_what_lies_below_the_detail(egg_box, draped):
    hole, bend = egg_box
    inside = deep(hole)
    before = rms((hole.positions[:, 2] - bend)[inside])
    after = rms((draped.positions[:, 2] - bend)[inside])
    assert after < 0.5 * before


def test_known_vertices_stay_and_nothing_else_changes(egg_box, draped):
    hole, _ = egg_box
    known = ~hole.unknown
    assert np.array_equal(draped.positions[known], hole.positions[known])
    assert draped.draped
    assert not hole.draped
    assert draped.wavelength == hole.wavelength


def test_it_doesn_t_matter_how_the_mesh_lies(egg_box, draped):
    hole, _ = egg_box
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    turned = replace(hole, positions=hole.positions @ turn.T)
    back = ForetoldDrape()(turned).positions @ turn
    assert rms((back - draped.positions)[hole.unknown]) < 0.05  # the coarse surface is another


@pytest.mark.parametrize(("size", "order"), [(1.0, 2), (3.0, 2), (3.0, 1)])
def test_what_lies_beyond_the_spline_at_the_rim_goes_on_there(egg_box, size, order):
    hole, _ = egg_box
    known = ~hole.unknown
    bump = np.where(known, size, 0.0)[:, None] * [0.0, 0.0, 1.0]
    surface = hole.positions + bump
    length = 0.25 * LENGTH
    joined = joined_at_rim(surface, hole.positions, hole.faces, known, length=length, order=order)
    beyond = (joined - hole.positions)[:, 2]
    away = RADIUS - np.hypot(*hole.positions[:, :2].T)
    assert np.array_equal(joined[known], surface[known])
    assert beyond[hole.unknown & (away < 1.0)].min() > 0.3 * order * size
    assert np.abs(beyond[away > 2.0 * LENGTH]).max(initial=0.0) < 0.05 * size
    assert np.abs(beyond[away > 0.9 * RADIUS]).max() < 0.1 * size


def test_the_stiffness_follows_the_body(sheet):
    points, faces = sheet(60, 52)
    points -= points.mean(axis=0)
    x, y = points[:, :2].T
    known = np.hypot(x, y) > 9.0
    k = 2.0 * np.pi / 7.0
    detail = 0.4 * (np.cos(k * x) + np.cos(k * y))
    weights = {}
    for name, body in (("flat", 0.0 * x), ("wavy", 6.0 * np.sin(x / 8.0) * np.cos(y / 8.0))):
        surface = np.column_stack([x, y, np.where(known, body + detail, body)])
        coarse = Coarse(surface, faces, known)
        weights[name] = foretelling(coarse, (0.9, 2.8), 7.0, 9.0)
        assert weights[name].sum() == pytest.approx(1.0)
    assert weights["wavy"][0] > 0.9
    assert weights["flat"][1] > 0.9


def test_the_better_a_spline_foretells_the_more_it_counts(egg_box):
    hole, _ = egg_box
    coarse = coarse_surface(hole, RADIUS)
    cutoffs = (0.9, 1.6, 2.8)
    of_all, sharper, best = (
        foretelling(coarse, cutoffs, LENGTH, RADIUS, sharpness=power)
        for power in (0.5, 1.0, np.inf)
    )
    ratios = of_all / of_all.max()
    assert np.count_nonzero(ratios) == 3
    assert np.allclose(sharper / sharper.max(), np.where(ratios**2 < 0.1, 0.0, ratios**2))
    assert np.array_equal(best, of_all == of_all.max())


def test_the_fill_lies_on_the_mean_of_the_splines(egg_box, monkeypatch):
    hole, _ = egg_box
    module = "meshlab_lowrank.stages.stage1d_drape_foretold.foretelling"

    def laid(*weights):
        monkeypatch.setattr(module, lambda *_, **__: np.array(weights))
        return ForetoldDrape(cutoffs=(0.9, 2.8))(hole).positions

    inside = deep(hole)
    soft, stiff, mean = (laid(*each)[inside] for each in ((1.0, 0.0), (0.0, 1.0), (0.75, 0.25)))
    assert rms(mean - 0.75 * soft - 0.25 * stiff) < 0.02 * rms(soft - stiff)


def test_a_fill_that_is_faired_better_stays(sheet):
    points, faces = sheet(46, 40)
    points -= points.mean(axis=0)
    x, y = points[:, :2].T
    points[:, 2] = 3.0 * np.sin(x / 4.0) * np.cos(y / 5.0)
    unknown = np.hypot(x, y) < 5.0
    points[unknown, 2] = 0.0
    hole = hole_of(fair_surface(points, faces, unknown), faces, unknown)
    hole = replace(hole, wavelength=40.0)
    assert ForetoldDrape(least_depth=0.0)(hole) is hole


def test_the_chosen_stiffness_is_used(egg_box):
    hole, _ = egg_box
    soft, stiff = (ForetoldDrape(cutoffs=(cutoff,))(hole).positions for cutoff in (0.9, 2.8))
    assert rms((soft - stiff)[hole.unknown]) > 0.05


def test_with_too_little_around_nothing_is_foretold(sheet):
    points, faces = sheet(12, 10)
    points -= points.mean(axis=0)
    known = np.hypot(*points[:, :2].T) > 4.0
    assert foretelling(Coarse(points, faces, known), (1.0, 2.0, 3.0), 8.0, 4.0) is None


def test_a_spline_in_its_own_metric_wraps_a_tube(sheet):
    points, faces = sheet(46, 40)
    points -= points.mean(axis=0)
    x, y = points[:, :2].T
    known = np.hypot(x, y) > 10.0
    tube = np.column_stack([12.0 * np.sin(x / 12.0), y, 12.0 * np.cos(x / 12.0)])
    start = membrane(tube, faces, ~known)

    def miss(times):
        laid = laid_out(start, faces, known, cutoff=9.0, times=times)[~known]
        return rms(np.hypot(laid[:, 0], laid[:, 2]) - 12.0)

    assert miss(4) < 0.6 * miss(1)


def test_a_spline_that_folds_is_not_taken(egg_box, monkeypatch):
    hole, _ = egg_box
    over = hole.positions.copy()
    over[np.flatnonzero(deep(hole))[::7]] += [4.0, 0.0, 0.0]
    assert folds_more(over, hole)
    assert not folds_more(hole.positions, hole)
    module = "meshlab_lowrank.stages.stage1d_drape_foretold.joined_at_rim"
    monkeypatch.setattr(module, lambda *_, **__: over)
    assert ForetoldDrape()(hole) is hole


def test_a_fold_in_one_place_is_spread(egg_box, monkeypatch):
    hole, _ = egg_box
    over = hole.positions.copy()
    middle = int(np.argmin(np.hypot(*over[:, :2].T)))
    over[middle] += [2.0, 0.0, 0.0]
    assert folds_more(over, hole)
    spread = spread_where_folded(over, hole)
    assert not folds_more(spread, hole)
    away = np.linalg.norm(hole.positions - hole.positions[middle], axis=1) > 4.0
    assert np.array_equal(spread[away], over[away])
    module = "meshlab_lowrank.stages.stage1d_drape_foretold.joined_at_rim"
    monkeypatch.setattr(module, lambda *_, **__: over)
    laid = ForetoldDrape()(hole)
    assert laid.draped
    assert np.array_equal(laid.positions, spread)


def test_the_base_is_fitted_to_a_draped_fill(draped):
    lifted = draped.positions + np.where(deep(draped), 2.0, 0.0)[:, None] * [0.0, 0.0, 1.0]
    base = LowPassBase()
    inside = np.hypot(*draped.positions[:, :2].T) < 3.0

    def height(hole):
        return float(base(hole, first=True).base[inside, 2].mean())

    moved = replace(draped, positions=lifted)
    assert height(moved) - height(draped) > 1.0
    as_faired = replace(moved, draped=False), replace(draped, draped=False)
    assert abs(height(as_faired[0]) - height(as_faired[1])) < 0.5


def test_holes_that_are_not_deep_keep_their_fill(egg_box):
    hole, _ = egg_box
    longer = replace(hole, wavelength=2.0 * LENGTH)
    assert ForetoldDrape()(longer) is longer
    assert ForetoldDrape(least_depth=0.9)(longer).draped
    assert ForetoldDrape()(replace(longer, shortening=0.5)).draped  # as deep in its patches


def test_presets_and_trials(egg_box):
    hole, _ = egg_box
    assert AUTO.drape == ForetoldDrape()
    assert PAPER.drape == AsFaired()
    for drape in (AUTO.for_trial().drape, PAPER.drape):
        assert drape(hole) is hole
