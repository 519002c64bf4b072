"""The examples of docs/shapes.md print what stands below them, and draw its pictures."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import matplotlib as mpl
import pytest

DOCS = Path(__file__).parent.parent / "docs"


@pytest.fixture
def rerun():
    spec = importlib.util.spec_from_file_location("rerun", DOCS / "rerun.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_what_its_code_makes(rerun, tmp_path, monkeypatch):
    mpl.use("agg")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").mkdir()
    page = (DOCS / "shapes.md").read_text(encoding="utf-8")
    assert rerun.updated(page) == page
    pictures = re.findall(r"!\[.*\]\((.*)\)", page)
    assert len(pictures) == 6
    assert sorted(path.name for path in (tmp_path / "docs").iterdir()) == sorted(pictures)
    assert all((DOCS / name).exists() for name in pictures)


def test_output_of_before_is_replaced(rerun):
    page = "```python run\nprint(1 + 1)\n```\n\n```text\n3\n```\n\nand ```python\nno\n```\n"
    assert rerun.updated(page) == page.replace("\n3\n", "\n2\n")
