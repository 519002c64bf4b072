"""Parameters: what a preset ignores is refused, and what the documents promise is there."""

from __future__ import annotations

import re
from dataclasses import asdict, fields
from pathlib import Path

import pytest

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.presets import AUTO, PAPER, pipeline_of
from meshlab_lowrank.stages.stage4a_complete_svt import svt_complete

OTHER = {
    "maxholesize": 7,
    "minholesize": 5,
    "maxholelength": 9.0,
    "minholelength": 0.5,
    "closerim": True,
    "base": "bspline",
    "detail": "none",
    "continuity": "flat",
    "refineedgelen": 0.5,
    "seed": 3,
    "patchsize": 60,
    "ringnumber": 5,
    "similarpatches": 6,
    "iterations": 2,
    "tau": 0.5,
    "delta": 0.2,
    "gamma": 0.02,
    "truncation": 4,
    "mu": 0.02,
    "beta": 0.02,
    "completioniterations": 400,
    "completiontolerance": 1e-3,
    "refinementiterations": 400,
    "refinementtolerance": 1e-5,
    "updateiterations": 30,
}
SIZES = {"maxholesize", "minholesize", "maxholelength", "minholelength"}
OF_THE_CALL = SIZES | {"closerim", "detail", "continuity", "refineedgelen"}


def test_every_parameter_is_tried():
    assert set(OTHER) | {"preset"} == {field.name for field in fields(InpaintParameters)}


@pytest.mark.parametrize("name", sorted(set(OTHER) - OF_THE_CALL))
@pytest.mark.parametrize("preset", ["auto", "paper"])
def test_a_parameter_changes_the_pipeline_or_is_refused(preset, name):
    try:
        changed = InpaintParameters(preset=preset, **{name: OTHER[name]})
    except InvalidParameterError as error:
        assert re.search(f"{name} is {OTHER[name]!r}.*{preset}", str(error))  # noqa: PT017
        other = {"auto": "paper", "paper": "auto"}[preset]
        InpaintParameters(preset=other, **{name: OTHER[name]})
    else:
        assert pipeline_of(changed) != pipeline_of(InpaintParameters(preset=preset))


def test_what_auto_ignores_are_the_constants_of_the_paper_and_its_base():
    def refused(name):
        try:
            InpaintParameters(**{name: OTHER[name]})
        except InvalidParameterError:
            return True
        return False

    found = {name for name in OTHER if refused(name)}
    assert "base" in found
    assert len(found) == 12
    assert "seed" not in found


def test_defaults_are_never_refused():
    for preset, parameters in (("auto", InpaintParameters()), ("paper", InpaintParameters.paper())):
        assert InpaintParameters(**asdict(parameters)) == parameters
        assert parameters.preset == preset


def test_the_presets_are_what_their_parameters_say():
    assert pipeline_of(InpaintParameters()) == AUTO
    assert pipeline_of(InpaintParameters.paper()) == PAPER


def test_two_ways_to_the_papers_preset_are_one():
    assert InpaintParameters(preset="paper") == InpaintParameters.paper()
    assert InpaintParameters.paper(preset="paper", patchsize=50).patchsize == 50


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: InpaintParameters.paper(preset="auto"),
        lambda: InpaintParameters.paper().changed(preset="auto"),
        lambda: InpaintParameters().changed(preset="paper"),
        lambda: InpaintParameters.paper(detail="calibrated"),
    ],
)
def test_presets_are_not_mixed(wrong):
    with pytest.raises(InvalidParameterError, match=r"Parameter (preset|detail) is"):
        wrong()


def test_detail_follows_the_preset():
    assert InpaintParameters().detail == "calibrated"
    assert InpaintParameters.paper().detail == "full"
    assert InpaintParameters.paper(detail="none").detail == "none"


@pytest.mark.parametrize(
    "parameters",
    [
        InpaintParameters.paper(),
        InpaintParameters(seed=1),
        InpaintParameters(patchsize=50),
        InpaintParameters(iterations=2),
    ],
)
def test_a_pipeline_and_parameters_of_its_stages_are_refused(sheet, parameters):
    with pytest.raises(InvalidParameterError, match="pipeline"):
        inpaint(*sheet(8, 8), parameters=parameters, pipeline=AUTO)


def test_the_page_of_the_filters_has_the_defaults():
    page = (Path(__file__).parents[1] / "docs" / "filters.md").read_text(encoding="utf-8")
    paper = InpaintParameters.paper()
    for name in ("patchsize", "similarpatches", "iterations", "ringnumber"):
        row = re.search(rf"\| `{name}` \| auto: (?:about )?(\d+), paper: (\d+) \|", page)
        assert int(row[2]) == getattr(paper, name)
    assert re.search(r"`similarpatches` \| auto: (\d+)", page)[1] == str(AUTO.similar.k)
    assert re.search(r"`iterations` \| auto: (\d+)", page)[1] == str(AUTO.passes)
    assert re.search(r"`ringnumber` \| auto: (\d+)", page)[1] == f"{AUTO.reach:.0f}"


def test_functions_have_the_defaults_of_the_parameters():
    defaults = svt_complete.__kwdefaults__
    paper = InpaintParameters.paper()
    assert (defaults["tau"], defaults["delta"]) == (paper.tau, paper.delta)
    assert (defaults["niter"], defaults["tol"]) == (
        paper.completioniterations,
        paper.completiontolerance,
    )
