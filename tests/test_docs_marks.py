"""The code of docs/marks.md runs as it stands there, one block after the other."""

import re
from pathlib import Path

import pymeshlab
import pytest

TEXT = (Path(__file__).parents[1] / "docs" / "marks.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the libraries
def test_the_blocks_find_what_was_filled(tmp_path, monkeypatch, capfd):
    assert len(BLOCKS) == 3
    monkeypatch.chdir(tmp_path)
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=3)
    ms.compute_selection_by_condition_per_face(condselect="(z0 > 0.9) && (z1 > 0.9) && (z2 > 0.9)")
    ms.meshing_remove_selected_faces()
    ms.meshing_remove_unreferenced_vertices()
    ms.save_current_mesh("scan.ply")
    for block in BLOCKS:
        if "import pyvista" in block:
            pytest.importorskip("pyvista")
        exec(block, {})  # noqa: S102
        told = capfd.readouterr().out.splitlines()
        assert told[-1] == "True"
