"""The benchmark that does the paper's experiments again, and its page."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.paper import EXPERIMENTS, Desk, main
from benchmarks.paper_cases import Setting, chain_of, paper_cases, run_setting
from benchmarks.paper_oracles import Stages
from benchmarks.paper_pictures import MOST_BYTES, draw_normals, draw_strip
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.presets import AUTO, PAPER
from meshlab_lowrank.stages.stage1b_fair_spline import SplineFairing
from meshlab_lowrank.stages.stage5_refine_nothing import NoRefinement

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "paper.md"


@pytest.fixture(scope="module")
def knurl():
    return paper_cases(None)["knurl"].problem()


def between_marks(name):
    page = PAGE.read_text(encoding="utf-8")
    found = re.search(rf"<!-- {name} -->\n(.*?)<!-- end of {name} -->", page, re.DOTALL)
    return found[1]


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_the_page_has_the_result_and_the_command_of_each_experiment(name):
    assert "| --- |" in between_marks(name)
    assert f"python -m benchmarks.paper {name} " in PAGE.read_text(encoding="utf-8")


def test_the_pictures_of_the_page_are_there_and_small():
    named = set(re.findall(r"\((paper_\w+(?:-\w+)*\.jpg)\)", PAGE.read_text(encoding="utf-8")))
    assert named == {path.name for path in DOCS.glob("paper_*.jpg")}
    assert len(named) >= 9
    sizes = [(DOCS / name).stat().st_size for name in named]
    assert max(sizes) < 120_000
    assert sum(sizes) < 1_000_000


def test_the_page_of_the_paper_itself_is_kept_apart():
    """Its numbers stand under a heading of their own, after ours."""
    page = PAGE.read_text(encoding="utf-8")
    ours, read = page.split("## Read from the paper\n")
    assert "2.9e-06" in read
    assert "2.9e-06" not in ours


def test_only_what_is_between_the_marks_changes(tmp_path):
    page = tmp_path / "paper.md"
    page.write_text("a\n<!-- siter -->\nold\n<!-- end of siter -->\nz\n", encoding="utf-8")
    desk = Desk({}, tmp_path, tmp_path)
    desk.put("siter", "new")
    assert page.read_text() == "a\n<!-- siter -->\n\nnew\n\n<!-- end of siter -->\nz\n"
    with pytest.raises(SystemExit, match=r"paper\.md has no marks for fig10"):
        desk.put("fig10", "new")


def test_an_experiment_of_another_name_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["fig99"])
    assert "fig99" in capsys.readouterr().err


def test_settings_are_pipelines():
    assert Setting().pipeline() == PAPER
    assert Setting(refined=False).pipeline().refine == NoRefinement()
    assert Setting(base="bspline").pipeline().fair == SplineFairing()
    changed = Setting(iterations=7, patchsize=20, ringnumber=2).pipeline()
    assert (changed.passes, changed.patches.sp, changed.patches.r) == (7, 20, 2)


def test_a_setting_is_run_by_the_filler_that_is_written_for_it(tmp_path):
    calls = []

    class Recording:
        def meshing_inpaint_lowrank(self, **given):
            calls.append(given)

    setting = Setting(refined=False, iterations=3)
    run_setting(Recording(), setting)
    assert calls[0]["pipeline"] == setting.pipeline()
    space = {}
    exec(Path(chain_of(setting, tmp_path)).read_text(encoding="utf-8"), space)  # noqa: S102
    space["chain"](Recording())
    assert calls[1] == calls[0]
    assert chain_of(Setting(), tmp_path) != chain_of(setting, tmp_path)


def test_the_legs_need_the_armadillo(tmp_path):
    assert set(paper_cases(tmp_path)) == set(paper_cases(None))
    (tmp_path / "armadillo.obj").touch()
    assert {"leg", "leg-big"} == set(paper_cases(tmp_path)) - set(paper_cases(None))


def test_true_normals_are_those_of_the_truth(knurl):
    stages = Stages(knurl, Setting())
    true = stages.true()
    assert stages.angle(true) < 1e-3
    assert stages.angle(stages.smooth) > 5.0
    smooth = stages.rms(stages.smooth.positions)
    assert stages.rms(AUTO.update(true).positions) < 0.4 * smooth
    known = ~stages.smooth.unknown
    np.testing.assert_array_equal(true.normals[known], stages.smooth.normals[known])


def test_pictures_are_small(knurl, tmp_path):
    truth = knurl.truth
    draw_strip(tmp_path / "strip.jpg", knurl, {"one": truth, "two": truth, "3": truth}, 2, 0.3)
    normals = vertex_normals(truth.vertices, truth.faces)
    missing = np.where(truth.vertices[:, :1] > knurl.centre[0], normals, 0.0)
    shown = {
        "a": (truth.vertices, truth.faces, normals),
        "b": (truth.vertices, truth.faces, missing),
    }
    draw_normals(tmp_path / "normals.jpg", knurl, shown, 0.3)
    for name, size in (("strip.jpg", (440, 488)), ("normals.jpg", (440, 244))):
        with Image.open(tmp_path / name) as picture:
            assert picture.size == size
        assert (tmp_path / name).stat().st_size < MOST_BYTES
    with Image.open(tmp_path / "normals.jpg") as picture:
        whole, half = np.split(np.asarray(picture, dtype=float), 2, axis=1)
    grey = [np.mean(np.ptp(each, axis=2)[60:] < 30.0) for each in (whole, half)]
    assert grey[1] > grey[0] + 0.2
