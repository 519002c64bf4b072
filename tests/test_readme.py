"""The examples and commands of README.md and docs/filters.md, as they stand there."""

import re
from pathlib import Path

import pymeshlab
import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
FILTERS = (ROOT / "docs" / "filters.md").read_text(encoding="utf-8")


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


@pytest.fixture
def meshset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> pymeshlab.MeshSet:
    """Give a sphere with a hole, which is also scan.ply in the current folder."""
    monkeypatch.chdir(tmp_path)
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=3)
    ms.compute_selection_by_condition_per_face(condselect="(z0 > 0.9) && (z1 > 0.9) && (z2 > 0.9)")
    ms.meshing_remove_selected_faces()
    ms.meshing_remove_unreferenced_vertices()
    ms.save_current_mesh("scan.ply")
    return ms


def holes_of(file: str) -> int:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.load_new_mesh(file)
    return ms.get_topological_measures()["number_holes"]


@pytest.mark.usefixtures("meshset")
def test_scripts_of_the_readme(capfd: pytest.CaptureFixture[str]) -> None:
    script, arrays = blocks(README, "python")
    exec(script, {})  # noqa: S102
    assert (holes_of("scan.ply"), holes_of("whole.ply")) == (1, 0)
    assert " filled " in capfd.readouterr().out
    exec(arrays, {})  # noqa: S102
    assert re.search(r"[1-9]\d* vertices [1-9]\d* faces", capfd.readouterr().out)


def test_scripts_of_the_filter_page(meshset: pymeshlab.MeshSet) -> None:
    save, detail, select = blocks(FILTERS, "python")
    exec(detail, {"ms": meshset, "pymeshlab": pymeshlab})  # noqa: S102
    assert meshset.get_topological_measures()["number_holes"] == 0
    meshset.load_new_mesh("scan.ply")
    meshset.meshing_inpaint_lowrank()
    exec(save, {"ms": meshset})  # noqa: S102
    assert b"double inpaint_trust" in Path("whole.ply").read_bytes()
    before = meshset.current_mesh().vertex_matrix()
    new = meshset.current_mesh().selected_face_number()
    exec(select, {"ms": meshset})  # noqa: S102
    assert meshset.current_mesh().selected_face_number() == new
    moved = (meshset.current_mesh().vertex_matrix() != before).any(axis=1)
    assert 0 < moved.sum() < len(moved) / 2


def test_filter_page_names_what_the_filters_return(meshset: pymeshlab.MeshSet) -> None:
    report = meshset.get_hole_measures()
    result = meshset.meshing_inpaint_lowrank()
    for name in [*report, *result, *result["holes"][0]]:
        assert f"`{name}`" in FILTERS


def test_links_lead_somewhere() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *ROOT.glob("*/README.md")]
    for page in pages:
        for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / link).exists(), f"{link} in {page.name}"
