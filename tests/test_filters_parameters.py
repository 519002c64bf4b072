"""Filter parameters are checked as MeshLab's are, and wrong calls change nothing."""

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank import filters
from meshlab_lowrank.filters.filter_arguments import METHOD_PARAMETERS, inpaint_parameters

FILTERS = tuple(function.__name__ for function in filters.FILTERS)


def settings(**values):
    return inpaint_parameters("name_of_filter", values, METHOD_PARAMETERS)


@pytest.mark.parametrize("name", FILTERS)
def test_unknown_parameters_name_filter_and_parameter(holed_set, name):
    with pytest.raises(
        pymeshlab.PyMeshLabException, match=f"maxholsize not found for filter {name}"
    ):
        getattr(holed_set(), name)(maxholsize=3)


@pytest.mark.parametrize("name", FILTERS)
def test_plain_functions_do_the_same(holed_set, name):
    with pytest.raises(pymeshlab.PyMeshLabException, match=name):
        getattr(filters, name)(holed_set(), no_such_parameter=1)


@pytest.mark.parametrize("name", ["maxholesize", "closerim", "refineedgelen", "selected"])
def test_moving_vertices_takes_no_parameters_of_closing(holed_set, name):
    with pytest.raises(pymeshlab.PyMeshLabException, match=name):
        holed_set().apply_coord_inpaint_lowrank(**{name: 1})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("maxholesize", -1),
        ("maxholesize", 3.5),
        ("maxholesize", True),
        ("maxholesize", "30"),
        ("preset", "automatic"),
        ("detail", 1),
        ("closerim", 1),
        ("seed", None),
        ("patchsize", 0),
        ("refineedgelen", pymeshlab.PureValue(0.0)),
    ],
)
def test_wrong_values_name_filter_and_parameter(name, value):
    with pytest.raises(pymeshlab.PyMeshLabException, match=f"name_of_filter.*{name}"):
        settings(**{name: value})


@pytest.mark.parametrize("value", ["thin", "-1%", 0.0, True, [1.0], np.nan])
def test_what_is_no_length_is_refused(value):
    with pytest.raises(pymeshlab.PyMeshLabException, match=r"refineedgelen.*like '1%'"):
        settings(refineedgelen=value)


def test_a_length_has_one_meaning_however_it_is_written():
    percent, pure = pymeshlab.PercentageValue(3), pymeshlab.PureValue(0.25)
    assert settings(refineedgelen=percent) == settings(refineedgelen="3%")
    for length in (pure, "0.25", np.float64(0.25)):
        assert settings(refineedgelen=length).refineedgelen == 0.25
    assert settings(refineedgelen=None).refineedgelen is None
    assert settings().refineedgelen is None


def test_numbers_of_numpy_are_numbers():
    values = settings(maxholesize=np.int64(7), closerim=np.bool_(True), seed=np.uint8(2))
    assert (values.maxholesize, values.closerim, values.seed) == (7, True, 2)
    assert type(values.maxholesize) is int


def test_the_papers_preset_brings_its_own_values():
    paper = meshlab_lowrank.InpaintParameters.paper(maxholesize=9)
    assert settings(preset="paper", maxholesize=9) == paper


@pytest.mark.parametrize("name", FILTERS)
def test_an_empty_set_and_a_point_cloud_are_refused(name):
    ms = pymeshlab.MeshSet()
    with pytest.raises(pymeshlab.PyMeshLabException, match="at least one mesh"):
        getattr(ms, name)()
    ms.add_mesh(pymeshlab.Mesh(np.eye(3)))
    with pytest.raises(pymeshlab.PyMeshLabException, match="point cloud"):
        getattr(ms, name)()


def test_detail_beside_non_manifold_edges_is_refused_with_the_repair():
    ms = pymeshlab.MeshSet()
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    ms.add_mesh(pymeshlab.Mesh(np.random.default_rng(0).random((5, 3)), faces))
    ms.compute_selection_by_condition_per_vertex(condselect="vi == 4")
    with pytest.raises(pymeshlab.PyMeshLabException, match="meshing_repair_non_manifold_edges"):
        ms.apply_coord_inpaint_lowrank()
    assert np.array_equal(ms.current_mesh().face_matrix(), faces)
    assert ms.current_mesh().selected_vertex_number() == 1


@pytest.mark.usefixtures("fans")
def test_selected_needs_a_selection(holed_set):
    with pytest.raises(pymeshlab.PyMeshLabException, match="no face is selected"):
        holed_set().meshing_inpaint_lowrank(selected=True)
    with pytest.raises(pymeshlab.PyMeshLabException, match="selected is 1"):
        holed_set().meshing_inpaint_lowrank(selected=1)
    with pytest.raises(pymeshlab.PyMeshLabException, match="select the vertices"):
        holed_set().apply_coord_inpaint_lowrank()


@pytest.mark.parametrize("name", ["my attribute", "x", "_pi", "ü"])
@pytest.mark.usefixtures("fans")
def test_attributes_that_meshlabs_functions_choke_on_are_refused(holed_set, name):
    ms = holed_set()
    mesh = ms.current_mesh()
    mesh.add_vertex_custom_scalar_attribute(np.zeros(mesh.vertex_number()), name)
    faces = mesh.face_matrix()
    with pytest.raises(pymeshlab.PyMeshLabException, match="custom attribute"):
        ms.meshing_inpaint_lowrank()
    assert np.array_equal(mesh.face_matrix(), faces)


def test_cancelling_changes_nothing(holed_set):
    ms = holed_set()
    before = ms.current_mesh().vertex_matrix()
    ms.compute_selection_by_condition_per_face(condselect="fi < 5")
    with pytest.raises(meshlab_lowrank.InpaintCancelledError):
        ms.meshing_inpaint_lowrank(detail="none", progress=lambda _: False)
    assert np.array_equal(ms.current_mesh().vertex_matrix(), before)
    assert ms.current_mesh().selected_face_number() == 5
