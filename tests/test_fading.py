"""Values that are continued so that they die away."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.mesh.fading import faded

LENGTH = 3.0


@pytest.mark.parametrize("order", [1, 2])
def test_values_die_away_over_the_length(sheet, order):
    points, faces = sheet(20, 60)
    away = points[:, 0] - points[:, 0].min()
    fixed = away < 10.0
    values = np.where(fixed, 1.0, np.nan)[:, None]
    found = faded(points, faces, fixed, values, length=LENGTH, order=order)[:, 0]
    np.testing.assert_array_equal(found[fixed], 1.0)
    assert np.abs(found[away > 10.0 + 6.0 * LENGTH]).max() < 0.03
    near = np.abs(away - (10.0 + LENGTH)) < 0.5
    near &= np.abs(points[:, 1] - np.median(points[:, 1])) < 5.0
    at_length = np.exp(-1.0 / np.sqrt(2.0)) if order == 2 else np.exp(-1.0)
    if order == 2:  # without a slope: e^-x (cos x + sin x), x over the root of 2
        at_length *= np.cos(np.sqrt(0.5)) + np.sin(np.sqrt(0.5))
    assert found[near].mean() == pytest.approx(at_length, abs=0.15)


def test_a_slope_goes_on_and_does_not_grow_with_the_surface(sheet):
    points, faces = sheet(20, 60)
    away = points[:, 0] - points[:, 0].min()
    fixed = away < 10.0
    values = (away - 10.0)[:, None]
    found = faded(points, faces, fixed, values, length=LENGTH)[:, 0]
    inner = ~fixed & (np.abs(points[:, 1] - np.median(points[:, 1])) < 5.0)  # clear of the border
    assert 0.2 * LENGTH < found[inner].max() < 0.8 * LENGTH
    assert np.abs(found[away > 10.0 + 6.0 * LENGTH]).max() < 0.05
