"""The fillers that a comparison knows, by name and by file."""

from __future__ import annotations

import re
from pathlib import Path

import pymeshlab
import pytest

from meshlab_lowrank.comparison.fillers import FILLERS
from meshlab_lowrank.comparison.loading import find_filler
from meshlab_lowrank.errors import InvalidParameterError


def test_a_script_of_meshlab_is_a_filler(tmp_path):
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_cube()
    ms.compute_normal_per_vertex()
    ms.save_filter_script(str(tmp_path / "mine.mlx"))
    assert find_filler(str(tmp_path / "mine.mlx")).name == "mine.mlx"


@pytest.mark.parametrize("spec", ["unknown", "missing.py", "missing.mlx"])
def test_unknown_fillers_are_refused(spec):
    with pytest.raises(InvalidParameterError, match=re.escape(spec)):
        find_filler(spec)


def test_every_filler_has_a_name_and_one_line():
    for name, filler in FILLERS.items():
        assert filler.name == name
        assert filler.explanation
        assert "\n" not in filler.explanation


def test_the_docs_list_every_filler():
    page = (Path(__file__).parent.parent / "docs" / "comparison.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `([\w-]+)` \|", page, re.MULTILINE)
    assert listed == list(FILLERS)
