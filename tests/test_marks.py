"""What was invented is seen: in the quality or colour of vertices, in files, and by a selection."""

import importlib
import json
import os
from pathlib import Path

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank.cli import main
from meshlab_lowrank.mesh_files import load_mesh, save_mesh

MODULE = importlib.import_module("meshlab_lowrank.filters.meshing_inpaint_lowrank")
MARKS = {f"__ca_{kind}": True for kind in ("vs__inpainted", "vs__inpaint_trust", "fs__inpainted")}


@pytest.fixture
def bare():
    """Make a MeshSet with a sphere that has three holes and neither quality nor colours."""

    def make():
        ms = pymeshlab.MeshSet(verbose=False)
        ms.create_sphere(subdiv=3)
        ms.compute_selection_by_condition_per_face(
            condselect="z0 > 0.93 || x0 > 0.93 || y0 < -0.93"
        )
        ms.meshing_remove_selected_faces()
        ms.meshing_remove_unreferenced_vertices()
        return ms

    return make


@pytest.fixture
def opened(bare, tmp_path):
    """Write that sphere to a file of some format."""

    def write(suffix):
        path = tmp_path / f"scan{suffix}"
        bare().save_current_mesh(str(path))
        return path

    return write


def loaded(path):
    ms = pymeshlab.MeshSet(verbose=False)
    ms.load_new_mesh(str(path))
    return ms


def fill(source, target, *options):
    return main(["inpaint", str(source), str(target), "--detail", "none", "--quiet", *options])


def middles(ms, chosen):
    mesh = ms.current_mesh()
    return mesh.vertex_matrix()[mesh.face_matrix()[chosen]].mean(axis=1)


def near_a_hole(points):
    poles = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    return np.linalg.norm(points[:, None] - poles, axis=2).min(axis=1) < 0.45


@pytest.mark.usefixtures("fans")
def test_trust_is_the_quality_where_there_was_none(bare):
    ms = bare()
    n = ms.current_mesh().vertex_number()
    ms.meshing_inpaint_lowrank()
    quality = ms.current_mesh().vertex_scalar_array()
    assert len(quality) == n + 3
    assert (quality[:n] == 1.0).all()
    assert (quality[n:] == 0.25).all()
    assert not ms.current_mesh().has_vertex_color()


@pytest.mark.usefixtures("fans")
def test_a_quality_of_the_mesh_stays_and_runs_on(holed_sphere, holed_set):
    given = 7.0 + holed_sphere[0][:, 2]
    ms = holed_set(v_scalar_array=given)
    ms.meshing_inpaint_lowrank(showtrust="quality")
    quality = ms.current_mesh().vertex_scalar_array()
    assert np.array_equal(quality[: len(given)], given)
    assert (quality[len(given) :] > 6.0).all()


@pytest.mark.usefixtures("fans")
@pytest.mark.parametrize("asked", [None, "quality", "colour", "none"])
def test_what_is_the_same_everywhere_gives_way_if_trust_is_asked_for(holed_set, asked):
    ms = holed_set()
    n = ms.current_mesh().vertex_number()
    assert not ms.current_mesh().vertex_scalar_array().any()
    ms.meshing_inpaint_lowrank(showtrust=asked)
    quality = ms.current_mesh().vertex_scalar_array()
    white = (ms.current_mesh().vertex_color_matrix() == 1.0).all()
    assert white == (asked != "colour")
    if asked == "quality":
        assert (quality[:n] == 1.0).all()
        assert (quality[n:] == 0.25).all()
    else:
        assert not quality.any()


@pytest.mark.usefixtures("fans")
def test_trust_is_the_colour_if_asked_for(bare):
    ms = bare()
    n = ms.current_mesh().vertex_number()
    ms.meshing_inpaint_lowrank(showtrust="colour")
    colours = np.rint(255.0 * ms.current_mesh().vertex_color_matrix())
    assert len({tuple(colour) for colour in colours[:n]}) == 1
    assert np.ptp(colours[0, :3]) == 0.0  # grey
    assert (colours[n:, 0] > colours[n:, 2] + 100.0).all()
    assert not ms.current_mesh().has_vertex_scalar()


@pytest.mark.parametrize("place", ["quality", "colour"])
def test_a_second_run_goes_on_with_the_first(monkeypatch, fans, bare, place):
    def values():
        if place == "quality":
            return ms.current_mesh().vertex_scalar_array()
        return ms.current_mesh().vertex_color_matrix()

    def other_trust(vertices, faces, **rest):
        result = fans(vertices, faces, **rest)
        result.trust[result.new_vertices] = np.nan
        return result

    ms = bare()
    n = ms.current_mesh().vertex_number()
    ms.meshing_inpaint_lowrank(showtrust=place)
    first = values()
    ms.compute_selection_by_condition_per_face(condselect="fi == 0")
    ms.meshing_remove_selected_faces()
    monkeypatch.setattr(MODULE, "inpaint", other_trust)
    ms.meshing_inpaint_lowrank(showtrust="none")
    assert np.array_equal(values()[: n + 3], first)
    assert not np.array_equal(values()[n + 3], first[0])  # as invented as it is
    assert not np.array_equal(values()[n + 3], first[n])  # and no trust is the least
    if place == "quality":
        assert values()[n + 3] == 0.0


def test_full_trust_is_told_from_what_was_measured(monkeypatch, fans, bare):
    def sure(vertices, faces, **rest):
        result = fans(vertices, faces, **rest)
        result.trust[:] = 1.0
        return result

    monkeypatch.setattr(MODULE, "inpaint", sure)
    ms = bare()
    report = ms.meshing_inpaint_lowrank()
    reloaded = pymeshlab.MeshSet(verbose=False)
    mesh = ms.current_mesh()
    reloaded.add_mesh(
        pymeshlab.Mesh(
            mesh.vertex_matrix(), mesh.face_matrix(), v_scalar_array=mesh.vertex_scalar_array()
        )
    )
    found = reloaded.compute_selection_inpainted_lowrank()
    assert found == {"selected_faces": report["new_faces"], "source": "quality"}


def test_a_wrong_choice_is_refused(holed_set, tmp_path, opened, capsys):
    with pytest.raises(pymeshlab.PyMeshLabException, match="showtrust is 'color'"):
        holed_set().meshing_inpaint_lowrank(showtrust="color")
    with pytest.raises(meshlab_lowrank.errors.InvalidParameterError, match="showtrust"):
        meshlab_lowrank.batch(tmp_path, tmp_path / "out", parameters={"showtrust": "loud"})
    with pytest.raises(SystemExit):
        fill(opened(".ply"), tmp_path / "out.ply", "--showtrust", "loud")
    capsys.readouterr()


def test_what_fails_while_it_is_shown_is_undone(monkeypatch, bare):
    ms = bare()
    before = ms.current_mesh().vertex_number(), ms.current_mesh().face_number()
    written = []

    def broken(meshset, places):
        written.append((meshset.current_mesh().face_number(), places))
        raise MemoryError

    monkeypatch.setattr(MODULE, "show_trust", broken)
    with pytest.raises(MemoryError):
        ms.meshing_inpaint_lowrank(detail="none")
    assert (ms.current_mesh().vertex_number(), ms.current_mesh().face_number()) == before
    assert written[0][0] > before[1]
    assert written[0][1] == {"quality"}


def test_a_ply_file_shows_its_fill_after_meshlab_has_read_it(opened, tmp_path):
    assert fill(opened(".ply"), tmp_path / "out.ply") == 0
    ms = loaded(tmp_path / "out.ply")
    mesh = ms.current_mesh()
    assert sorted(set(mesh.vertex_scalar_array())) == [0.0, 1.0]
    assert ms.compute_selection_inpainted_lowrank()["source"] == "quality"
    shown = mesh.face_selection_array()
    assert 30 < shown.sum() < 500
    assert near_a_hole(middles(ms, shown)).all()
    found = ms.compute_selection_inpainted_lowrank(marksfile=str(tmp_path / "out.ply"))
    assert found == {"selected_faces": int(shown.sum()), "source": "marksfile"}
    assert np.array_equal(mesh.face_selection_array(), shown)
    assert ms.compute_selection_inpainted_lowrank()["source"] == "marks"  # which it has again


def test_the_command_shows_trust_where_it_is_asked_to(opened, tmp_path):
    source = opened(".ply")
    assert fill(source, tmp_path / "out.ply", "--showtrust", "colour") == 0
    mesh = (ms := loaded(tmp_path / "out.ply")).current_mesh()
    assert (mesh.has_vertex_color(), mesh.has_vertex_scalar()) == (True, False)
    assert len(np.unique(mesh.vertex_color_matrix(), axis=0)) == 2
    assert fill(source, tmp_path / "bare.ply", "--showtrust", "none") == 0
    mesh = (ms := loaded(tmp_path / "bare.ply")).current_mesh()
    assert (mesh.has_vertex_color(), mesh.has_vertex_scalar()) == (False, False)
    assert ms.compute_selection_inpainted_lowrank(marksfile=str(tmp_path / "bare.ply"))


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".x3d"])
def test_other_files_have_their_marks_beside_them(opened, tmp_path, suffix):
    target = tmp_path / f"out{suffix}"
    assert fill(opened(".ply"), target) == 0
    ms = loaded(target)
    assert not ms.current_mesh().has_vertex_scalar()
    marks = tmp_path / f"out{suffix}.marks.json"
    found = ms.compute_selection_inpainted_lowrank(marksfile=str(marks))
    document = json.loads(marks.read_text(encoding="utf-8"))
    assert found["selected_faces"] == len(document["faces"]) > 30
    chosen = ms.current_mesh().face_selection_array()
    assert np.array_equal(np.flatnonzero(chosen), document["faces"])
    assert near_a_hole(middles(ms, chosen)).all()
    new = np.zeros(ms.current_mesh().vertex_number(), dtype=bool)
    new[document["vertices"]] = True
    assert not new[ms.current_mesh().face_matrix()[~chosen]].any()
    assert set(document["vertex_trust"]) == {0.0}


@pytest.mark.parametrize("suffix", [".ply", ".obj"])
def test_the_command_reads_marks_and_goes_on_with_them(opened, tmp_path, suffix):
    source = opened(".ply")
    first, second = tmp_path / f"first{suffix}", tmp_path / f"second{suffix}"
    assert fill(source, first, "--holes", "0") == 0
    assert fill(first, second) == 0
    ends = []
    for path in (first, second):
        ms = loaded(path)
        beside = path if suffix == ".ply" else path.with_name(f"{path.name}.marks.json")
        ms.compute_selection_inpainted_lowrank(marksfile=str(beside))
        ends.append(set(np.flatnonzero(ms.current_mesh().face_selection_array()).tolist()))
    assert ends[0] < ends[1]
    if suffix == ".ply":
        assert sorted(set(ms.current_mesh().vertex_scalar_array())) == [0.0, 1.0]
    assert fill(second, tmp_path / f"copy{suffix}") == 0  # nothing is left to fill
    ms = loaded(tmp_path / f"copy{suffix}")
    beside = tmp_path / (f"copy{suffix}" + ("" if suffix == ".ply" else ".marks.json"))
    found = ms.compute_selection_inpainted_lowrank(marksfile=str(beside))
    assert found["selected_faces"] == len(ends[1])


def test_marks_of_another_file_are_not_believed(opened, tmp_path, capsys):
    assert fill(opened(".ply"), tmp_path / "out.obj", "--holes", "0") == 0
    with (tmp_path / "out.obj").open("a") as file:
        file.write("# changed\n")
    capsys.readouterr()
    assert fill(tmp_path / "out.obj", tmp_path / "again.obj") == 0
    assert "written for another out.obj" in capsys.readouterr().err
    one, other = (
        json.loads((tmp_path / f"{name}.obj.marks.json").read_text(encoding="utf-8"))
        for name in ("out", "again")
    )
    assert one["faces"][-1] < other["faces"][0]


def test_damaged_marks_are_refused(opened, tmp_path):
    assert fill(opened(".ply"), tmp_path / "out.obj") == 0
    marks = tmp_path / "out.obj.marks.json"
    document = json.loads(marks.read_text(encoding="utf-8"))
    ms = loaded(tmp_path / "out.obj")
    for change, reason in (
        ({"faces": [10**9]}, "doesn't have"),
        ({"face_count": 10**12}, "marks a mesh of"),
        ({"vertices": [0]}, "doesn't have"),
        ({"faces": ["all"]}, "no file of marks"),
        ({"format": "marks 7"}, "format 'marks 7'"),
    ):
        marks.write_text(json.dumps({**document, **change}))
        with pytest.raises(pymeshlab.PyMeshLabException, match=f"marksfile.*{reason}"):
            ms.compute_selection_inpainted_lowrank(marksfile=str(marks))
        assert ms.current_mesh().selected_face_number() == 0
    assert fill(tmp_path / "out.obj", tmp_path / "again.obj") == 0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_a_pipe_instead_of_marks_is_not_opened(opened, tmp_path):
    source = opened(".obj")
    os.mkfifo(tmp_path / "scan.obj.marks.json")
    assert fill(source, tmp_path / "out.obj") == 0
    ms = loaded(source)
    with pytest.raises(pymeshlab.PyMeshLabException, match="a pipe"):
        ms.compute_selection_inpainted_lowrank(marksfile=str(tmp_path / "scan.obj.marks.json"))


def test_what_nothing_tells_is_refused(bare, holed_sphere, holed_set, tmp_path):
    ms, other = bare(), holed_set(v_scalar_array=holed_sphere[0][:, 2])
    with pytest.raises(pymeshlab.PyMeshLabException, match="no marks, and its quality"):
        ms.compute_selection_inpainted_lowrank()
    with pytest.raises(pymeshlab.PyMeshLabException, match="no marks, and its quality"):
        other.compute_selection_inpainted_lowrank()
    with pytest.raises(pymeshlab.PyMeshLabException, match=r"marksfile is .*no\.json"):
        ms.compute_selection_inpainted_lowrank(marksfile=str(tmp_path / "no.json"))
    ms.save_current_mesh(str(tmp_path / "bare.ply"))
    with pytest.raises(pymeshlab.PyMeshLabException, match="holds no marks"):
        ms.compute_selection_inpainted_lowrank(marksfile=str(tmp_path / "bare.ply"))


@pytest.mark.usefixtures("fans")
def test_the_marks_of_the_mesh_come_first(bare, tmp_path):
    ms = bare()
    report = ms.meshing_inpaint_lowrank()
    ms.set_selection_all()
    found = ms.apply_filter("compute_selection_inpainted_lowrank")
    assert found == {"selected_faces": report["new_faces"], "source": "marks"}
    assert ms.current_mesh().selected_vertex_number() == ms.current_mesh().vertex_number()
    ms.save_current_mesh(str(tmp_path / "a.ply"), **MARKS)
    with pytest.raises(pymeshlab.PyMeshLabException, match="has marks; leave it out"):
        ms.compute_selection_inpainted_lowrank(marksfile=str(tmp_path / "a.ply"))


def test_a_batch_writes_marks_and_writes_them_again(opened, tmp_path):
    source = opened(".obj")
    (tmp_path / "in").mkdir()
    source.rename(tmp_path / "in" / "a.obj")
    marks = tmp_path / "out" / "a.obj.marks.json"
    for seed in (0, 1):
        settings = {"detail": "none", "seed": seed}
        result = meshlab_lowrank.batch(
            tmp_path / "in", tmp_path / "out", parameters=settings, pictures=False
        )
        assert result.records[0].status == "done"
        assert json.loads(marks.read_text(encoding="utf-8"))["mesh"] == "a.obj"
    left = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"a.obj", "a.obj.marks.json"} <= left


def test_quality_keeps_ctm_from_being_written_with_a_sentence(opened, tmp_path):
    assert fill(opened(".ply"), tmp_path / "out.ctm") == 0
    assert not (tmp_path / "out.ctm.marks.json").exists()  # it orders faces anew
    whole = load_mesh(opened(".ply"))
    whole.meshset.compute_scalar_by_function_per_vertex(q="1")
    with pytest.raises(meshlab_lowrank.InvalidMeshError, match="crashes when it reads CTM"):
        save_mesh(whole, Path(tmp_path / "rough.ctm"))
