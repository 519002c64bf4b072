"""Our filters among MeshLab's own: chains, selection, silence, filter scripts."""

import re

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank  # noqa: F401  (binds the filters)


@pytest.fixture
def scan(holed_sphere, tmp_path):
    """A file of the holed sphere, its faces not sharing any vertex."""
    vertices, faces = holed_sphere
    ms = pymeshlab.MeshSet()
    ms.add_mesh(
        pymeshlab.Mesh(vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    )
    path = tmp_path / "scan.ply"
    ms.save_current_mesh(str(path))
    return path


def test_a_chain_of_filters(scan, tmp_path):
    ms = pymeshlab.MeshSet()
    ms.load_new_mesh(str(scan))
    ms.meshing_remove_duplicate_vertices()
    known = ms.current_mesh().vertex_matrix()
    out = ms.meshing_inpaint_lowrank(maxholesize=400, detail="none")
    ms.save_current_mesh(str(tmp_path / "whole.ply"))
    assert out["closed_holes"] == len(out["holes"]) == 2
    assert out["skipped_holes"] == out["failed_holes"] == 0
    assert out["new_faces"] == sum(hole["new_faces"] for hole in out["holes"])
    assert out["new_vertices"] == sum(hole["new_vertices"] for hole in out["holes"])
    after = pymeshlab.MeshSet()
    after.load_new_mesh(str(tmp_path / "whole.ply"))
    assert after.get_topological_measures()["boundary_edges"] == 0
    assert np.array_equal(after.current_mesh().vertex_matrix()[: len(known)], known)
    assert after.current_mesh().vertex_number() == len(known) + out["new_vertices"]


@pytest.mark.usefixtures("fans")
def test_new_faces_are_selected_and_nothing_else(holed_set):
    ms = holed_set()
    mesh = ms.current_mesh()
    ms.compute_selection_by_condition_per_vertex(condselect="vi < 9")
    ms.compute_selection_by_condition_per_face(condselect="fi < 9")
    m = mesh.face_number()
    ms.meshing_inpaint_lowrank()
    assert np.array_equal(
        np.flatnonzero(mesh.face_selection_array()), np.arange(m, mesh.face_number())
    )
    assert mesh.selected_vertex_number() == 0
    assert ms.meshing_inpaint_lowrank()["new_faces"] == 0
    assert mesh.selected_face_number() == 0


def test_a_selection_is_not_obeyed_unless_asked_for(holed_set):
    ms = holed_set()
    table = ms.get_hole_measures()
    assert len(table["id"]) == 2
    ms.compute_selection_by_condition_per_face(condselect="z0 > 0.8")
    out = ms.meshing_inpaint_lowrank(selected=True, detail="none")
    assert [hole["status"] for hole in out["holes"]].count("filled") == 1
    assert ms.current_mesh().selected_face_number() == out["new_faces"] > 0
    out = ms.meshing_inpaint_lowrank(detail="none")  # in spite of the selected patch
    assert out["closed_holes"] == 1
    assert ms.get_hole_measures()["id"] == []


def test_maxholesize_is_inclusive(holed_set):
    edges = sorted(holed_set().get_hole_measures()["boundary_edges"])
    ms = holed_set()
    assert ms.meshing_inpaint_lowrank(maxholesize=edges[0] - 1, detail="none")["new_faces"] == 0
    ms.meshing_inpaint_lowrank(maxholesize=edges[0], detail="none")
    assert len(ms.get_hole_measures()["id"]) == sum(size > edges[0] for size in edges)


def test_a_patch_of_meshlabs_own_gets_detail(holed_set):
    ms = holed_set()
    ms.meshing_close_holes(
        maxholesize=100,
        selected=False,
        newfaceselected=True,
        refinehole=True,
        refineholeedgelen=pymeshlab.PercentageValue(2),
    )
    faces = ms.current_mesh().face_matrix()
    assert ms.apply_coord_inpaint_lowrank(detail="none")["closed_holes"] == 2
    assert np.array_equal(ms.current_mesh().face_matrix(), faces)


def test_nothing_is_printed_when_verbosity_is_off(holed_set, capfd):
    ms = holed_set()
    ms.get_hole_measures()
    ms.meshing_inpaint_lowrank(detail="none")
    ms.apply_coord_inpaint_lowrank(detail="none")
    ms.meshing_inpaint_lowrank(detail="none")
    assert capfd.readouterr() == ("", "")


def test_works_with_verbosity_on(holed_set, capfd):
    ms = holed_set()
    ms.set_verbosity(True)
    try:
        ms.meshing_inpaint_lowrank(detail="none")
    finally:
        ms.set_verbosity(False)
    assert ms.get_hole_measures()["id"] == []
    assert "Applying filter" in capfd.readouterr().out


@pytest.mark.usefixtures("fans")
def test_steps_stay_out_of_the_filter_script(holed_set, tmp_path, capfd):
    def names(ms):
        ms.save_filter_script(str(tmp_path / "script.mlx"))
        return re.findall(
            '<filter name="(.*?)"', (tmp_path / "script.mlx").read_text(encoding="utf-8")
        )

    ms = holed_set()
    ms.meshing_inpaint_lowrank()
    assert names(ms) == ["meshing_inpaint_lowrank"]

    ms = holed_set()
    ms.meshing_remove_duplicate_vertices()
    ms.compute_selection_by_condition_per_face(condselect="fi < 7")
    before = names(ms)
    ms.meshing_inpaint_lowrank()
    ms.apply_coord_inpaint_lowrank(detail="none")
    assert names(ms) == [*before, "meshing_inpaint_lowrank", "apply_coord_inpaint_lowrank"]
    assert capfd.readouterr() == ("", "")


def test_marks_are_kept_from_run_to_run_and_saved_to_ply(holed_set, tmp_path):
    ms = holed_set()
    mesh = ms.current_mesh()
    ms.compute_selection_by_condition_per_face(condselect="z0 > 0.8")
    first = ms.meshing_inpaint_lowrank(selected=True, detail="none")
    n = mesh.vertex_number()
    trust = mesh.vertex_custom_scalar_attribute_array("inpaint_trust")
    second = ms.meshing_inpaint_lowrank(detail="none")
    vertices = mesh.vertex_custom_scalar_attribute_array("inpainted")
    faces = mesh.face_custom_scalar_attribute_array("inpainted")
    assert set(vertices) == set(faces) == {0.0, 1.0}
    new = first["new_vertices"] + second["new_vertices"]
    assert np.flatnonzero(vertices).tolist() == list(range(len(vertices) - new, len(vertices)))
    assert faces.sum() == first["new_faces"] + second["new_faces"]
    assert np.array_equal(mesh.vertex_custom_scalar_attribute_array("inpaint_trust")[:n], trust)

    path = tmp_path / "marked.ply"
    ms.save_current_mesh(str(path), binary=False, __ca_vs__inpainted=True, __ca_fs__inpainted=True)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines.count("property double inpainted") == 2
    rows = lines[lines.index("end_header") + 1 :]
    marks = [float(row.split()[-1]) for row in rows[: len(vertices)]]
    assert np.array_equal(marks, vertices)


def test_defaults_of_other_filters_stay(holed_set):
    """MeshLab remembers the values of some calls, and takes them as defaults of later ones."""

    def defaults():
        ms = pymeshlab.MeshSet(verbose=False)
        ms.create_cube()
        names = [
            name for name in pymeshlab.filter_list() if name.startswith(("meshing", "apply_coord"))
        ]
        values = {name: ms.filter_parameter_values(name) for name in names}
        return {(name, key): repr(one) for name in names for key, one in values[name].items()}

    before = defaults()
    ms = holed_set()
    ms.get_hole_measures()
    ms.meshing_inpaint_lowrank(detail="none")
    ms.apply_coord_inpaint_lowrank(detail="none")
    assert defaults() == before


def test_marks_are_there_where_nothing_was_filled(tmp_path):
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=2)
    assert ms.meshing_inpaint_lowrank()["holes"] == []
    mesh = ms.current_mesh()
    assert not mesh.vertex_custom_scalar_attribute_array("inpainted").any()
    assert not mesh.face_custom_scalar_attribute_array("inpainted").any()
    assert (mesh.vertex_custom_scalar_attribute_array("inpaint_trust") == 1.0).all()
    path = tmp_path / "whole.ply"
    ms.save_current_mesh(
        str(path), __ca_vs__inpainted=True, __ca_vs__inpaint_trust=True, __ca_fs__inpainted=True
    )
    assert path.read_bytes().count(b"double inpaint") == 3


def test_a_run_that_fills_nothing_keeps_marks_and_attributes(holed_set):
    ms = holed_set()
    mesh = ms.current_mesh()
    own = np.arange(float(mesh.vertex_number()))
    mesh.add_vertex_custom_scalar_attribute(own, "own")
    ms.meshing_inpaint_lowrank(maxholesize=3)
    assert np.array_equal(mesh.vertex_custom_scalar_attribute_array("own"), own)
    ms.meshing_inpaint_lowrank(detail="none")
    read = mesh.vertex_custom_scalar_attribute_array, mesh.face_custom_scalar_attribute_array
    before = read[0]("inpainted"), read[1]("inpainted"), read[0]("inpaint_trust")
    assert before[0].any()
    assert before[1].any()
    assert (before[2] == 0.0).any()
    ms.meshing_inpaint_lowrank()
    after = read[0]("inpainted"), read[1]("inpainted"), read[0]("inpaint_trust")
    assert all(map(np.array_equal, before, after))
