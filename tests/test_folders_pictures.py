"""Pictures of the worst holes on the page of a batch run."""

import base64
import contextlib
import io
import re
import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab
import pytest
from PIL import Image

from meshlab_lowrank.folders import batch, drawing, hole_pictures
from meshlab_lowrank.folders.hole_pictures import Album, HolePictures, draw_holes
from meshlab_lowrank.folders.ranking import worst_holes
from meshlab_lowrank.folders.run import BatchResult
from meshlab_lowrank.folders.summary_page import PAGE_NAME, summary_page
from meshlab_lowrank.isolation.process import Ending
from meshlab_lowrank.report import rendering
from meshlab_lowrank.report.pictures import Picture
from meshlab_lowrank.report.rendering import HOW_TO_GET
from tests.builders import RUN_FACTS as FACTS

DECIMATE = """
def chain(ms):
    report = ms.meshing_inpaint_lowrank(detail="none")
    ms.meshing_decimation_quadric_edge_collapse(targetperc=0.5)
    return report
"""
RESIZE = """
def chain(ms):
    ms.compute_matrix_from_scaling_or_normalization(axisx=2)
    return ms.meshing_inpaint_lowrank(detail="none")
"""


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two spheres with two holes each."""
    folder = tmp_path_factory.mktemp("pictures") / "scans"
    folder.mkdir()
    for number in range(2):
        meshset = pymeshlab.MeshSet(verbose=False)
        meshset.create_sphere(subdiv=3 + number)
        mesh = meshset.current_mesh()
        vertices, faces = mesh.vertex_matrix(), mesh.face_matrix()
        centres = vertices[faces].mean(axis=1)
        faces = faces[(centres[:, 0] < 0.9) & (centres[:, 2] > -0.95)]
        meshset.add_mesh(pymeshlab.Mesh(vertices, faces))
        meshset.meshing_remove_unreferenced_vertices()
        meshset.save_current_mesh(str(folder / f"sphere{number}.ply"))
    return folder


@pytest.fixture(scope="module")
def filled(scans: Path) -> tuple[BatchResult, Path, str]:
    """Give a run without pictures: its result, its folder, its page."""
    out = scans.parent / "out"
    result = batch(scans, out, parameters={"detail": "none"}, workers=1, pictures=False)
    return result, out, (out / PAGE_NAME).read_text(encoding="utf-8")


def items(scans: Path, out: Path, result: BatchResult) -> list[dict[str, Any]]:
    return [
        {"source": str(scans / record.file), "target": str(out / record.output), "hole": hole}
        for record, hole in worst_holes(result.records)
    ]


def drawn(monkeypatch: pytest.MonkeyPatch, jobs: list[dict[str, Any]]) -> dict[Any, Picture]:
    """Collect what would be drawn."""
    found: dict[Any, Picture] = {}
    monkeypatch.setattr(drawing, "draw", lambda some: (found.update(some) or {}, ""))
    report = drawing.perform({"holes": jobs}, lambda _: None)
    assert len(report["pictures"]) == len(jobs)
    return found


def test_switched_off_pictures_are_told_of(filled: tuple[BatchResult, Path, str]) -> None:
    _, _, text = filled
    assert "<img" not in text
    assert "switched off" in text
    assert "meshlab-lowrank[pictures]" in text
    assert text.count("sphere0.ply") == 3


def test_the_page_tells_how_wrong_fills_may_be(filled: tuple[BatchResult, Path, str]) -> None:
    result, _, text = filled
    assert 'data-name="median error"' in text
    for record in result.records:
        for hole in record.holes:
            assert 0.0 < hole["median_error"] < hole["largest_error"]
            assert f'data-name="largest error">{hole["largest_error"]:.3g}<' in text


def test_without_the_extra_the_page_has_the_tables(
    scans: Path, filled: tuple[BatchResult, Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hole_pictures, "missing_renderer", lambda: HOW_TO_GET)
    result = batch(scans, filled[1], parameters={"detail": "none"}, workers=1)
    assert result.counts == {"skipped": 2}
    text = (filled[1] / PAGE_NAME).read_text(encoding="utf-8")
    assert "<img" not in text
    assert "meshlab-lowrank[pictures]" in text
    assert "4 of 4 holes" in text


def test_fills_are_found_again_and_marked(
    scans: Path, filled: tuple[BatchResult, Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    result, out, _ = filled
    jobs = items(scans, out, result)
    found = drawn(monkeypatch, jobs)
    assert len(found) == 3 * len(jobs) == 12
    for number, job in enumerate(jobs):
        before, after = found[number, "before"], found[number, "after"]
        assert not before.surface.part.any()
        assert after.marked
        assert np.count_nonzero(after.surface.part) == job["hole"]["new_faces"]
        assert before.view.radius < job["hole"]["diameter"] < 2.1 * before.view.radius
        assert before.view is after.view
        bars = found[number, "bars"]
        assert bars.view is after.view
        assert bars.errors.distances[bars.errors.faces].max() == bars.limit
        assert bars.limit == pytest.approx(job["hole"]["largest_error"])
        assert len(bars.errors.faces) == job["hole"]["new_faces"]


@pytest.mark.parametrize(("text", "shown"), [(DECIMATE, True), (RESIZE, False)])
def test_a_chain_may_change_the_rest(
    scans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, shown: bool
) -> None:
    chain = tmp_path / "chain.py"
    chain.write_text(text)
    result = batch(scans, tmp_path / "out", chain=chain, workers=1, pictures=False)
    assert result.counts == {"done": 2}
    found = drawn(monkeypatch, items(scans, tmp_path / "out", result))
    assert bool(found) == shown
    assert all(found[key].surface.part.any() for key in found if key[1] == "after")


def test_a_hole_left_open_is_shown_open(
    scans: Path, filled: tuple[BatchResult, Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    result, _, _ = filled
    job = items(scans, filled[1], result)[0]
    failed = {**job, "target": "", "hole": {**job["hole"], "status": "failed"}}
    assert set(drawn(monkeypatch, [failed])) == {(0, "before")}


def test_what_cannot_be_drawn_has_a_reason(
    scans: Path, filled: tuple[BatchResult, Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    result, out, _ = filled
    good = items(scans, out, result)[0]
    monkeypatch.setattr(rendering.importlib.util, "find_spec", lambda _: True)
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    report = drawing.perform({"holes": [{**good, "source": "gone.ply"}, good]}, lambda _: None)
    assert "libegl1" in report["reason"]
    assert "no file gone.ply" in report["pictures"][0]["reason"]
    assert report["pictures"][1] == {"before": "", "after": "", "bars": "", "reason": ""}
    record, reason = result.records[0], "The renderer had no luck."
    pictured = Album((HolePictures(reason=reason),))
    assert reason in summary_page([record], FACTS, pictured)


@pytest.mark.parametrize("timed_out", [True, False])
def test_a_drawing_process_that_dies_costs_the_pictures_only(
    filled: tuple[BatchResult, Path, str], monkeypatch: pytest.MonkeyPatch, timed_out: bool
) -> None:
    class Pool:
        @contextlib.contextmanager
        def borrowed(self) -> Iterator[Any]:
            yield self

        def run(self, _: dict[str, Any], **__: Any) -> Ending:
            return Ending(None, 9, timed_out, "drawing", 0, 1.0)

    monkeypatch.setattr(hole_pictures, "missing_renderer", lambda: "")
    holes = worst_holes(filled[0].records)
    album = draw_holes(holes, Path("a"), Path("b"), Pool())  # type: ignore[arg-type]
    assert not album.holes
    assert ("ended after" if timed_out else "SIGKILL") in album.missing


def test_pictures_are_drawn(
    scans: Path, filled: tuple[BatchResult, Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyvista")
    monkeypatch.delenv("DISPLAY", raising=False)
    batch(scans, filled[1], parameters={"detail": "none"}, workers=1)
    text = (filled[1] / PAGE_NAME).read_text(encoding="utf-8")
    if "OpenGL" in text:
        pytest.skip("no OpenGL")
    images = re.findall(r"data:image/jpeg;base64,([^\"]+)", text)
    assert len(images) == 12
    assert text.count("(median)") == 4
    for number, data in enumerate(images):
        with Image.open(io.BytesIO(base64.b64decode(data))) as image:
            red, _, blue = np.moveaxis(np.asarray(image.convert("RGB"), dtype=float), 2, 0)
        orange, dark = np.count_nonzero(red > blue + 40), np.count_nonzero(blue > red + 60)
        assert (orange > 1000) == (number % 3 == 1) or number % 3 == 2  # before, after, error bars
        assert (dark > 300) == (number % 3 == 2)


def test_skipped_records_are_pictured_too(filled: tuple[BatchResult, Path, str]) -> None:
    skipped = [replace(record, status="skipped") for record in filled[0].records]
    assert len(worst_holes(skipped)) == len(worst_holes(filled[0].records)) == 4
