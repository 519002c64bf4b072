"""What comes of a hole once its detail is judged: trust, bars, relief, or the smooth fill."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.presets import pipeline_of
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage1d_drape_as_faired import AsFaired
from meshlab_lowrank.stages.stage6c_relief_copied import CopiedRelief
from meshlab_lowrank.tuning.trust import Trust
from tests.wiring import FAST, FULL, Given, Sunk, egg_box, filled


@pytest.fixture(scope="module")
def egg(sheet):
    return egg_box(sheet)


def test_trust_scales_the_detail_by_depth(egg):
    fast = replace(FAST, drape=AsFaired())
    full = inpaint(*egg, parameters=FULL, pipeline=replace(fast, copying=False))
    smooth = inpaint(*egg, parameters=InpaintParameters(detail="none"))
    new = full.new_vertices
    for strength in (1.0, 0.5):
        trust = Trust(np.full(3, strength), 0.8)
        scaled = inpaint(*egg, pipeline=replace(fast, tune=Given(trust)))
        expected = smooth.vertices + strength * (full.vertices - smooth.vertices)
        np.testing.assert_allclose(scaled.vertices[new], expected[new], atol=1e-12)
        np.testing.assert_array_equal(scaled.trust[new], 0.8)
    for doubtful in (Trust(np.ones(3), 0.1), Trust(np.array([0.0, 1.0, 1.0]), 0.8)):
        left = inpaint(*egg, pipeline=replace(FAST, tune=Given(doubtful)))
        assert left.vertices.tobytes() == smooth.vertices.tobytes()
        (record,) = (hole for hole in left.holes if hole.status == "filled")
        assert "doesn't predict itself" in record.reason


def test_detail_is_scaled_from_the_draped_fill(egg):
    slight = replace(FAST, tune=Given(Trust(np.full(3, 1e-9), 0.8)))
    smooth = inpaint(*egg, parameters=InpaintParameters(detail="none"))
    laid, left = (
        inpaint(*egg, pipeline=replace(slight, drape=drape)) for drape in (Sunk(), AsFaired())
    )
    new = smooth.new_vertices
    assert np.abs(left.vertices - smooth.vertices).max() < 1e-6
    assert np.median(np.linalg.norm((laid.vertices - smooth.vertices)[new], axis=1)) > 0.5


def test_bars_are_those_of_the_smooth_fill_less_what_trials_explain(egg):
    smooth = inpaint(*egg, parameters=InpaintParameters(detail="none"))
    new = smooth.new_vertices
    trust = Trust(np.ones(3), 0.8, np.array([0.04, 0.25, 0.64]), np.array([0.09, 0.36, 1.44]))
    for parameters, left in ((None, trust.left), (FULL, trust.left_by_whole)):
        pipeline = replace(FAST, copying=False, tune=Given(trust))
        result = inpaint(*egg, parameters=parameters, pipeline=pipeline)
        shares = result.error[new] / smooth.error[new]
        assert 0.9 * np.sqrt(left[0]) < shares.min() < shares.max() < 1.1 * np.sqrt(left[-1])
        np.testing.assert_allclose(result.trust[new], np.maximum(1.0 - shares**2, 0.0), atol=1e-9)
        deepest = smooth.error[new].argmax()
        assert result.trust[new][deepest] == result.trust[new].min() < result.trust[new].max()
        (record,) = (hole for hole in result.holes if hole.status == "filled")
        assert record.largest_error == result.error[new].max()


def test_full_detail_is_copied_as_relief_where_it_does_not_predict_itself(egg):
    right, wrong = Trust(np.ones(3), 0.8), Trust(np.zeros(3), 0.0)
    for trust, copied in ((right, False), (wrong, True), (None, True)):
        tune = Given(trust)
        recovered = filled(egg, replace(FAST, tune=tune))
        usual = filled(egg, replace(FAST, tune=tune, relief=CopiedRelief()))
        assert (recovered.tobytes() != usual.tobytes()) == copied
    calibrated = replace(FAST, tune=Given(wrong), relief=CopiedRelief())
    left = inpaint(*egg, pipeline=calibrated)
    (record,) = (hole for hole in left.holes if hole.status == "filled")
    assert "doesn't predict itself" in record.reason
    assert pipeline_of(InpaintParameters(seed=3)).relief.seed == 3


def test_trust_that_nothing_tells_is_not_a_number(egg):
    for pipeline, parameters in ((None, InpaintParameters.paper(patchsize=40)), (FAST, FULL)):
        result = inpaint(*egg, parameters=parameters, pipeline=pipeline)
        (record,) = (hole for hole in result.holes if hole.status == "filled")
        assert math.isnan(record.trust)
        assert "not known" in record.reason
        assert np.isnan(result.trust[result.new_vertices]).all()
        assert not np.isnan(result.trust[~result.new_vertices]).any()
        assert json.loads(json.dumps(record.as_dict(), allow_nan=False))["trust"] is None


def test_the_filter_hands_on_that_trust_is_not_known(holed_set):
    ms = holed_set()
    report = ms.meshing_inpaint_lowrank(preset="paper", patchsize=20, ringnumber=3)
    assert [hole["trust"] for hole in report["holes"]] == [None, None]
    trust = ms.current_mesh().vertex_custom_scalar_attribute_array("inpaint_trust")
    new = ms.current_mesh().vertex_custom_scalar_attribute_array("inpainted") > 0.5
    np.testing.assert_array_equal(np.isnan(trust), new)


def test_a_fill_that_stays_smooth_is_not_trusted(egg):
    result = inpaint(*egg, pipeline=replace(FAST, tune=Given(Trust(np.ones(3), 0.1))))
    assert (result.trust[result.new_vertices] == 0.0).all()
    (record,) = (hole for hole in result.holes if hole.status == "filled")
    assert record.trust == 0.0


@dataclass(frozen=True)
class Failing(Stage):
    """A base that fails."""

    def __call__(self, hole, *, first):  # noqa: ARG002
        msg = "It is not to be."
        raise StageError(msg)


@dataclass(frozen=True)
class Spoiling(Stage):
    """A finish after which nothing is a number."""

    def __call__(self, hole, positions, base_normals):  # noqa: ARG002
        return np.full_like(positions, np.nan)


@pytest.mark.parametrize(
    ("broken", "words"),
    [({"base": Failing()}, "It is not to be."), ({"finish": Spoiling()}, "not finite")],
)
def test_a_hole_whose_detail_fails_keeps_its_smooth_fill(egg, broken, words):
    smooth = inpaint(*egg, parameters=InpaintParameters(detail="none"))
    trust = Trust(np.ones(3), 0.8)
    result = inpaint(*egg, pipeline=replace(FAST, tune=Given(trust), **broken))
    assert result.vertices.tobytes() == smooth.vertices.tobytes()
    (record,) = (hole for hole in result.holes if hole.status == "filled")
    assert words in record.reason
    assert record.trust == 0.0
