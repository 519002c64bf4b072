"""The page on adding a variant: its file is used as it stands, and its test runs."""

from __future__ import annotations

import importlib.util
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.stages.stage4a_complete_mean import GroupMean
from sample_meshes.shapes import make_shape

PAGE = Path(__file__).parents[1] / "docs" / "adding.md"


@pytest.fixture(scope="module")
def blocks():
    """The page's blocks of Python: the file, its use, its test."""
    return re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)


@pytest.fixture(scope="module")
def variant(blocks, tmp_path_factory):
    """The module of the page's file."""
    path = tmp_path_factory.mktemp("variant") / "stage4a_complete_median.py"
    path.write_text(blocks[0], encoding="utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[path.stem]


@pytest.fixture(scope="module")
def mesh():
    vertices, faces = make_shape("torus", "bumps", count=4000, seed=1)
    gone = np.linalg.norm(vertices - vertices[500], axis=1) < 3.5
    return vertices, faces[~gone[faces].any(axis=1)]


def test_a_variant_in_one_file_is_used(blocks, variant, mesh):
    names = {**vars(variant), "vertices": mesh[0], "faces": mesh[1]}
    exec(blocks[1], names)  # noqa: S102  our own page
    result = names["result"]
    assert [hole.status for hole in result.holes] == ["filled"]
    assert result.holes[0].trust > 0.3
    other = names["inpaint"](*mesh, pipeline=replace(AUTO, complete=GroupMean()))
    assert np.abs(result.vertices - other.vertices).max() > 1e-6


def test_the_test_of_the_variant_passes_and_can_fail(blocks, variant):
    names = dict(vars(variant))
    exec(blocks[2], names)  # noqa: S102
    test = names["test_equal_patches_give_that_patch"]
    test()
    names["GroupMedian"] = lambda: lambda values, *_: variant.Completed(values, np.zeros(1))
    with pytest.raises(AssertionError):
        test()
