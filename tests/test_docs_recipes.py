"""Each recipe of docs/recipes.md runs as it stands there, where its library is installed."""

import re
from pathlib import Path

import pymeshlab
import pytest

TEXT = (Path(__file__).parents[1] / "docs" / "recipes.md").read_text(encoding="utf-8")
RECIPES = dict(re.findall(r"^## (.*?)\n\n```python\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE))


def test_every_block_is_found():
    assert len(RECIPES) == TEXT.count("```python") == TEXT.count("\n## ")


@pytest.mark.parametrize("title", RECIPES)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the libraries
def test_recipe(title, tmp_path, monkeypatch, capfd):
    pytest.importorskip(re.match(r"import (\w+)", RECIPES[title])[1])
    monkeypatch.chdir(tmp_path)
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=3)
    ms.compute_selection_by_condition_per_face(condselect="(z0 > 0.9) && (z1 > 0.9) && (z2 > 0.9)")
    ms.meshing_remove_selected_faces()
    ms.meshing_remove_unreferenced_vertices()
    ms.save_current_mesh("scan.ply")
    exec(RECIPES[title], {})  # noqa: S102
    told = capfd.readouterr().out
    if "whole.ply" in RECIPES[title]:
        ms.load_new_mesh("whole.ply")
        assert ms.get_topological_measures()["boundary_edges"] == 0
    for fact in ("1 of 1 holes filled", "True"):
        if "print(result)" in RECIPES[title]:
            assert fact in told
    assert "False" not in told
