"""PyMeshLab's own calls know our filters, and do with MeshLab's what they did."""

import re
import subprocess
import sys

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank import filters
from meshlab_lowrank.chains import load_chain
from meshlab_lowrank.filters.native_calls import FUNCTIONS, METHODS
from meshlab_lowrank.filters.script_steps import with_steps
from meshlab_lowrank.presets import AUTO

NAMES = [function.__name__ for function in filters.FILTERS]


def opened(subdiv=2):
    """Give a sphere without its cap, made by two steps of a script."""
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=subdiv)
    ms.clear_filter_script()
    ms.compute_selection_by_condition_per_face(condselect="z0 > 0.8")
    ms.meshing_remove_selected_faces()
    return ms


def script(ms, path):
    ms.save_filter_script(str(path))
    return path.read_text(encoding="utf-8")


def steps(text):
    return re.findall('<filter name="(.*?)"', text)


def test_filters_are_applied_by_name():
    ms, other = opened(), opened()
    report = ms.apply_filter("meshing_inpaint_lowrank", maxholesize=400, detail="none")
    assert report == other.meshing_inpaint_lowrank(maxholesize=400, detail="none")
    assert report["closed_holes"] == 1
    assert np.array_equal(ms.current_mesh().face_matrix(), other.current_mesh().face_matrix())
    with pytest.raises(pymeshlab.PyMeshLabException, match="maxholsize not found"):
        ms.apply_filter("meshing_inpaint_lowrank", maxholsize=3)
    with pytest.raises(pymeshlab.PyMeshLabException, match="Filter does not exist"):
        ms.apply_filter("meshing_inpaint")


def test_values_of_parameters():
    ms = opened()
    values = ms.filter_parameter_values("meshing_inpaint_lowrank", maxholesize=7)
    assert (values["maxholesize"], values["detail"], values["selected"]) == (7, "calibrated", False)
    paper = ms.filter_parameter_values("meshing_inpaint_lowrank", preset="paper")
    assert (paper["detail"], paper["patchsize"]) == ("full", 100)
    assert "maxholesize" not in ms.filter_parameter_values("apply_coord_inpaint_lowrank")
    assert ms.filter_parameter_values("get_hole_measures") == {}
    for wrong in ({"maxholesize": -1}, {"size": 1}):
        with pytest.raises(pymeshlab.PyMeshLabException, match="meshing_inpaint_lowrank"):
            ms.filter_parameter_values("meshing_inpaint_lowrank", **wrong)


def test_lists_of_filters(capfd):
    names = pymeshlab.filter_list()
    assert names == sorted({*FUNCTIONS["filter_list"](), *NAMES})
    FUNCTIONS["print_filter_list"]()
    native = capfd.readouterr().out
    pymeshlab.print_filter_list()
    printed = capfd.readouterr().out.splitlines()
    assert [line for line in printed if line.strip() not in NAMES] == native.splitlines()
    assert [line.strip() for line in printed[1:]] == names
    for name in NAMES:
        pymeshlab.print_filter_parameter_list(name)
        lines = capfd.readouterr().out.splitlines()
        assert lines[0] == f"{name} filter - list of parameter names:"
        values = pymeshlab.MeshSet().filter_parameter_values(name)
        assert [line.split(" : ")[0].strip() for line in lines[1:]] == list(values)
    pymeshlab.search("inpaint")
    assert {"meshing_inpaint_lowrank", "apply_coord_inpaint_lowrank"} <= set(
        re.findall(r"^\w+", capfd.readouterr().out, re.MULTILINE)
    )


def test_meshlabs_own_filters_are_told_of_as_before(capfd):
    ms = opened()
    calls = (
        (FUNCTIONS["print_filter_parameter_list"], pymeshlab.print_filter_parameter_list),
        (FUNCTIONS["search"], pymeshlab.search),
    )
    for native, ours in calls:
        native("meshing_close_holes")
        before = capfd.readouterr()
        ours("meshing_close_holes")
        assert capfd.readouterr() == before
    METHODS["print_filter_script"](ms)
    before = capfd.readouterr()
    ms.print_filter_script()
    assert capfd.readouterr() == before
    name = "meshing_close_holes"
    native = METHODS["filter_parameter_values"](ms, name, maxholesize=9)
    assert ms.filter_parameter_values(name, maxholesize=9) == native
    for owner, originals in ((pymeshlab.MeshSet, METHODS), (pymeshlab, FUNCTIONS)):
        for call, original in originals.items():
            assert getattr(owner, call).__doc__.startswith(original.__doc__.rstrip())


def test_a_script_keeps_our_filters_in_their_places(tmp_path, capfd):
    ms = opened()
    length = pymeshlab.PercentageValue(8)
    ms.meshing_inpaint_lowrank(detail="none", refineedgelen=length, progress=lambda _: True)
    ms.meshing_invert_face_orientation()
    ms.meshing_inpaint_lowrank(detail="none")
    text = script(ms, tmp_path / "script.mlx")
    ours = "meshing_inpaint_lowrank"
    native = ["Conditional Face Selection", "Delete Selected Faces", "Invert Faces Orientation"]
    assert steps(text) == [*native[:2], ours, native[2], ours]
    ms.print_filter_script()
    printed = capfd.readouterr().out
    assert printed.startswith("Filter Script Size : 5\n")
    titles = re.findall(r"^(\d): (\w+)$", printed, re.MULTILINE)
    assert [number for number, _ in titles] == list("01234")
    assert [title == ours for _, title in titles] == [False, False, True, False, True]
    assert "detail : str = 'none'" in printed
    assert "refineedgelen : PercentageValue = 8.0%" in printed

    again = pymeshlab.MeshSet(verbose=False)
    again.create_sphere(subdiv=2)
    again.load_filter_script(str(tmp_path / "script.mlx"))
    assert steps(script(again, tmp_path / "again.mlx")) == steps(text)
    again.apply_filter_script()
    for get in ("vertex_matrix", "face_matrix"):
        found, expected = (getattr(one.current_mesh(), get)() for one in (again, ms))
        assert np.array_equal(found, expected)
    assert steps(script(again, tmp_path / "again.mlx")) == steps(text)

    third = pymeshlab.MeshSet(verbose=False)
    third.create_sphere(subdiv=2)
    load_chain(tmp_path / "script.mlx").run(third)
    assert np.array_equal(third.current_mesh().vertex_matrix(), ms.current_mesh().vertex_matrix())


def test_a_script_is_cleared_replaced_and_each_meshsets_own(tmp_path):
    ms, other = opened(), opened()
    alone = script(ms, tmp_path / "alone.mlx")
    ms.get_hole_measures()
    assert steps(script(ms, tmp_path / "a.mlx"))[-1] == "get_hole_measures"
    assert steps(script(other, tmp_path / "b.mlx")) == steps(alone)
    ms.load_filter_script(str(tmp_path / "alone.mlx"))
    assert steps(script(ms, tmp_path / "a.mlx")) == steps(alone)
    ms.get_hole_measures()
    ms.clear_filter_script()
    assert steps(script(ms, tmp_path / "a.mlx")) == []
    ms.meshing_inpaint_lowrank(detail="none")
    assert steps(script(ms, tmp_path / "a.mlx")) == ["meshing_inpaint_lowrank"]
    assert with_steps(alone, []) == alone


def test_what_failed_is_no_step_and_a_failing_script_stays_whole(tmp_path):
    ms = opened()
    with pytest.raises(pymeshlab.PyMeshLabException):
        ms.meshing_inpaint_lowrank(maxholesize=-1)
    assert len(steps(script(ms, tmp_path / "a.mlx"))) == 2
    ms.meshing_inpaint_lowrank(detail="none")
    whole = script(ms, tmp_path / "a.mlx")
    ms.clear()
    ms.add_mesh(pymeshlab.Mesh(np.eye(3)))
    with pytest.raises(pymeshlab.PyMeshLabException):
        ms.apply_filter_script()
    assert steps(script(ms, tmp_path / "a.mlx")) == steps(whole)


def test_what_a_script_cannot_hold_is_refused(tmp_path):
    ms = opened()
    ms.meshing_inpaint_lowrank(pipeline=AUTO, detail="none")
    with pytest.raises(pymeshlab.PyMeshLabException, match=r"pipeline.*Python file"):
        ms.save_filter_script(str(tmp_path / "a.mlx"))
    assert not (tmp_path / "a.mlx").exists()
    ms.clear_filter_script()
    ms.get_hole_measures()
    with pytest.raises(pymeshlab.PyMeshLabException, match="can't be written"):
        ms.save_filter_script(str(tmp_path / "no" / "a.mlx"))


@pytest.mark.parametrize("parameter", ['"maxholsize" value="3"', '"maxholesize" value="many"'])
def test_a_wrong_parameter_of_ours_keeps_a_script_from_being_loaded(tmp_path, parameter):
    path = tmp_path / "wrong.mlx"
    path.write_text(
        '<FilterScript><filter name="meshing_inpaint_lowrank">'
        f"<Param name={parameter}/></filter></FilterScript>"
    )
    ms = opened()
    before = script(ms, tmp_path / "a.mlx")
    with pytest.raises(pymeshlab.PyMeshLabException, match=r"wrong\.mlx was not loaded.*maxhol"):
        ms.load_filter_script(str(path))
    assert steps(script(ms, tmp_path / "a.mlx")) == steps(before)


def test_importing_twice_changes_nothing_more():
    code = """
import sys, pymeshlab, meshlab_lowrank
for name in [name for name in sys.modules if name.startswith("meshlab_lowrank")]:
    del sys.modules[name]
import meshlab_lowrank
from meshlab_lowrank.filters.native_calls import FUNCTIONS, METHODS, ORIGINAL
assert not any(hasattr(call, ORIGINAL) for call in (*METHODS.values(), *FUNCTIONS.values()))
assert getattr(pymeshlab.filter_list, ORIGINAL) is FUNCTIONS["filter_list"]
meshlab_lowrank.register()
assert pymeshlab.MeshSet.apply_filter.__doc__.count("meshlab_lowrank") == 1
ms = pymeshlab.MeshSet(verbose=False)
ms.apply_filter("create_cube")
print(len(ms.apply_filter("get_hole_measures")["id"]))
"""
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "0\n", "")
