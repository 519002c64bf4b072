"""Functions show and take each parameter by name, and a length in every way of writing it."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank.cli import main
from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.parameters import HOLE_PARAMETERS, InpaintParameters

PARAMETERS = {field.name for field in fields(InpaintParameters)}
OWN = {
    "meshing_inpaint_lowrank": {"holes", "near", "selected", "showtrust", "progress", "pipeline"},
    "apply_coord_inpaint_lowrank": {"progress", "pipeline"},
    "get_hole_measures": set(),
    "compute_selection_inpainted_lowrank": {"marksfile"},
}
LENGTHS = {
    "percent": ["2%", pymeshlab.PercentageValue(2)],
    "number": [0.05, "0.05", pymeshlab.PureValue(0.05)],
}


def shown(function):
    parameters = inspect.signature(function).parameters.values()
    assert not any(p.kind is p.VAR_KEYWORD for p in parameters)
    return {p.name: p for p in parameters if p.kind is p.KEYWORD_ONLY}


@pytest.mark.parametrize("name", OWN)
def test_filters_show_and_explain_what_they_take(name):
    function = getattr(pymeshlab.MeshSet(), name)
    taken = {
        "meshing_inpaint_lowrank": PARAMETERS,
        "apply_coord_inpaint_lowrank": PARAMETERS - HOLE_PARAMETERS,
    }.get(name, set())
    found = shown(function)
    assert set(found) == taken | OWN[name]
    defaults = InpaintParameters()
    for parameter in taken:
        assert found[parameter].default == getattr(defaults, parameter)
        assert found[parameter].annotation is not inspect.Parameter.empty
    text = inspect.getdoc(function)
    section = text.split("Parameters\n---")[1].split("Returns\n---")[0]
    for parameter in found:
        assert re.search(rf"^[\w, ]*\b{parameter}\b[\w, ]* :", section, re.MULTILINE), parameter
    assert "Examples\n---" in text


@pytest.mark.parametrize("name", OWN)
def test_what_a_filter_shows_it_takes(holed_set, name):
    ms = holed_set()
    ms.compute_selection_by_condition_per_vertex(condselect="vi < 9")
    for parameter, value in shown(getattr(ms, name)).items():
        with pytest.raises(pymeshlab.PyMeshLabException) as caught:
            getattr(ms, name)(**{parameter: value.default}, no_such_parameter=1)
        assert "no_such_parameter not found" in str(caught.value)


def test_functions_on_arrays_take_parameters_by_name(holed_sphere):
    by_name = meshlab_lowrank.inpaint(*holed_sphere, detail="none", maxholesize=36)
    parameters = InpaintParameters(detail="none", maxholesize=36)
    in_one = meshlab_lowrank.inpaint(*holed_sphere, parameters=parameters)
    assert by_name.vertices.tobytes() == in_one.vertices.tobytes()
    assert [hole.status for hole in by_name.holes].count("filled") == 1
    assert set(shown(meshlab_lowrank.inpaint)) >= PARAMETERS
    assert set(shown(meshlab_lowrank.restore_detail)) >= PARAMETERS - HOLE_PARAMETERS


def test_parameters_given_twice_or_unknown_are_refused(holed_sphere):
    some = np.arange(len(holed_sphere[0])) < 5
    for function, arguments in (
        (meshlab_lowrank.inpaint, holed_sphere),
        (meshlab_lowrank.restore_detail, (*holed_sphere, some)),
    ):
        with pytest.raises(InvalidParameterError, match="detail is 'none', but parameters"):
            function(*arguments, parameters=InpaintParameters(), detail="none")
        with pytest.raises(InvalidParameterError, match="detial is not known"):
            function(*arguments, detial="none")
    with pytest.raises(InvalidParameterError, match="maxholesize is of closing"):
        meshlab_lowrank.restore_detail(*holed_sphere, some, maxholesize=3)


@pytest.mark.parametrize("kind", LENGTHS)
def test_a_length_is_the_same_wherever_it_is_written(holed_sphere, tmp_path, kind):
    scan, out = str(tmp_path / "scan.ply"), str(tmp_path / "out.ply")
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(*holed_sphere))
    ms.save_current_mesh(scan)
    results = set()
    for length in LENGTHS[kind]:
        ms.load_new_mesh(scan)
        mesh = ms.current_mesh()
        vertices, faces = mesh.vertex_matrix(), mesh.face_matrix()
        result = meshlab_lowrank.inpaint(vertices, faces, detail="none", refineedgelen=length)
        ms.meshing_inpaint_lowrank(detail="none", refineedgelen=length)
        results |= {result.vertices.tobytes(), mesh.vertex_matrix().tobytes()}
    length = str(LENGTHS[kind][0])
    assert main(["inpaint", scan, out, "--detail", "none", "--refineedgelen", length]) == 0
    ms.load_new_mesh(out)
    results.add(ms.current_mesh().vertex_matrix().tobytes())
    assert len(results) == 1
    plain = meshlab_lowrank.inpaint(vertices, faces, detail="none")
    assert plain.vertices.tobytes() not in results
