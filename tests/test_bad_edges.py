"""Edges with three faces and turned faces: holes elsewhere are filled as if they weren't there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.chains import load_chain, ready_chains
from meshlab_lowrank.cli import main
from meshlab_lowrank.folders.run import batch
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.topology import border_of
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops, find_boundary

NONE = InpaintParameters(detail="none")
KINDS = ("fin", "turned", "doubled")


def at(vertices: np.ndarray, faces: np.ndarray, place: tuple[float, float, float]) -> int:
    """Face nearest to a place."""
    return int(np.argmin(np.linalg.norm(vertices[faces].mean(axis=1) - place, axis=1)))


def spoilt(
    mesh: tuple[np.ndarray, np.ndarray], kind: str, place: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Put a fin on the face nearest to a place, turn it round, or add it once more."""
    vertices, faces = mesh
    face = at(vertices, faces, place)
    if kind == "turned":
        return vertices, np.concatenate(
            [faces[:face], faces[face : face + 1, ::-1], faces[face + 1 :]]
        )
    if kind == "doubled":
        return vertices, np.concatenate([faces, faces[face : face + 1]])
    tip = 1.02 * vertices[faces[face]].mean(axis=0)
    fin = [faces[face, 0], faces[face, 1], len(vertices)]
    return np.concatenate([vertices, [tip]]), np.concatenate([faces, [fin]])


@pytest.fixture
def equator() -> tuple[float, float, float]:
    return (0.0, 1.0, 0.0)


@pytest.mark.parametrize("kind", KINDS)
def test_holes_elsewhere_are_filled_to_the_same_bits(holed_sphere, equator, kind):
    clean = inpaint(*holed_sphere, parameters=NONE)
    vertices, faces = spoilt(holed_sphere, kind, equator)
    result = inpaint(vertices, faces, parameters=NONE)
    assert result.vertices[: len(vertices)].tobytes() == vertices.tobytes()
    assert np.array_equal(result.faces[: len(faces)], faces)
    assert result.vertices[result.new_vertices].tobytes() == (
        clean.vertices[clean.new_vertices].tobytes()
    )
    holes = [hole for hole in result.holes if hole.shape == "hole"]
    assert [hole.status for hole in holes] == [hole.status for hole in clean.holes]
    (note,) = result.notes
    assert "apply meshing_re" in note


@pytest.mark.parametrize("kind", KINDS)
def test_a_hole_beside_is_skipped_with_the_reason(holed_sphere, kind):
    vertices, faces = holed_sphere
    loop = find_boundary(vertices, faces).loops[0]
    place = tuple(vertices[faces[loop.faces[0]]].mean(axis=0))
    result = inpaint(*spoilt(holed_sphere, kind, place), parameters=NONE)
    shapes = {hole.shape: hole for hole in result.holes}
    beside = shapes["bad edges"]
    assert beside.status == "skipped"
    assert beside.reason.startswith("Bad edges lie at its rim: ")
    assert "apply meshing_re" in beside.reason
    assert [hole.status for hole in result.holes if hole.shape == "hole"] == ["filled"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_boundary_edge_is_accounted_for(holed_sphere, equator, kind):
    vertices, faces = spoilt(holed_sphere, kind, equator)
    found = find_boundary(vertices, faces)
    border = border_of(faces, len(vertices))
    corners = faces.ravel()
    tails = corners[border.half_edges]
    heads = corners[border.half_edges + np.where(border.half_edges % 3 == 2, -2, 1)]
    walked = [
        (b, a)
        for loop in found.loops
        if loop.shape == "hole"
        for a, b in zip(loop.vertices, np.roll(loop.vertices, -1), strict=True)
    ]
    loose = sum(len(loop.vertices) for loop in found.loops if loop.shape == "bad edges")
    assert set(walked) <= set(zip(tails, heads, strict=True))
    assert len(walked) + loose == len(border.half_edges)
    for loop in found.loops:
        assert all(v in faces[f] for v, f in zip(loop.vertices, loop.faces, strict=True))


def test_a_mesh_of_bad_edges_alone_has_nothing_to_fill(sheet):
    points, faces = sheet(4, 4)
    result = inpaint(points, np.concatenate([faces, faces]), parameters=NONE)
    assert len(result.faces) == 2 * len(faces)
    assert all(hole.status != "filled" for hole in result.holes)
    assert result.notes


def mesh_set(mesh: tuple[np.ndarray, np.ndarray], **attributes: Any) -> pymeshlab.MeshSet:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(*mesh, **attributes))
    return ms


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dress", ["vertices", "faces", "wedges", "charts"])
def test_the_filter_appends_in_place_and_keeps_attributes(holed_sphere, equator, kind, dress):
    vertices, faces = spoilt(holed_sphere, kind, equator)
    some = np.random.default_rng(0)
    attributes = {
        "vertices": {
            "v_scalar_array": some.random(len(vertices)),
            "v_color_matrix": some.integers(0, 256, (len(vertices), 4)) / 255.0,
        },
        "faces": {"f_scalar_array": some.random(len(faces))},
        "charts": {"v_tex_coords_matrix": some.random((len(vertices), 2)).astype(np.float32)},
        "wedges": {"w_tex_coords_matrix": some.random((3 * len(faces), 2)).astype(np.float32)},
    }[dress]
    ms = mesh_set((vertices, faces), **attributes)
    mesh = ms.current_mesh()
    read = {
        "vertices": lambda: (mesh.vertex_scalar_array(), mesh.vertex_color_matrix()),
        "faces": lambda: (mesh.face_scalar_array(),),
        "charts": lambda: (mesh.vertex_tex_coord_matrix(),),
        "wedges": lambda: (mesh.wedge_tex_coord_matrix(),),
    }[dress]
    before = read()
    expected = inpaint(vertices, faces, parameters=NONE)
    out = ms.meshing_inpaint_lowrank(detail="none")
    assert mesh.vertex_matrix().tobytes("C") == expected.vertices.tobytes()
    assert np.array_equal(mesh.face_matrix(), expected.faces)
    assert out["notes"] == list(expected.notes)
    for old, new in zip(before, read(), strict=True):
        assert np.array_equal(new[: len(old)], old)


def test_texture_coordinates_beside_a_seam_at_the_rim_stay(holed_sphere, equator):
    """The fill gets one texel there, but the measured rim keeps its own."""
    vertices, faces = spoilt(holed_sphere, "fin", equator)
    rim = boundary_loops(*holed_sphere)[0].vertices
    faces = faces.copy()
    row = np.flatnonzero((faces == rim[0]).any(axis=1))[0]
    faces[row] = np.where(faces[row] == rim[0], len(vertices), faces[row])
    vertices = np.concatenate([vertices, vertices[rim[:1]]])
    charts = np.random.default_rng(0).random((len(vertices), 2)).astype(np.float32)
    ms = mesh_set((vertices, faces), v_tex_coords_matrix=charts)
    out = ms.meshing_inpaint_lowrank(detail="none")
    assert out["closed_holes"] > 0
    after = ms.current_mesh().vertex_tex_coord_matrix()[: len(vertices)]
    assert np.array_equal(after, charts)


def test_quality_and_the_trust_of_an_earlier_run_stay(holed_sphere, equator):
    vertices, faces = spoilt(holed_sphere, "fin", equator)
    quality = np.where(np.arange(len(vertices)) % 5 == 0, np.inf, vertices[:, 0])
    ms = mesh_set((vertices, faces), v_scalar_array=quality)
    ms.compute_new_custom_scalar_attribute_per_vertex(name="inpaint_trust", expr="sin(vi)")
    trust = ms.current_mesh().vertex_custom_scalar_attribute_array("inpaint_trust")
    ms.meshing_inpaint_lowrank(detail="none")
    after = ms.current_mesh()
    n = len(vertices)
    assert np.array_equal(after.vertex_scalar_array()[:n], quality)
    assert np.array_equal(after.vertex_custom_scalar_attribute_array("inpaint_trust")[:n], trust)
    assert after.vertex_matrix()[:n].tobytes() == np.ascontiguousarray(vertices).tobytes()


def test_what_would_lose_attributes_is_refused_before_anything_changes(holed_sphere):
    ms = mesh_set(holed_sphere)
    ms.compute_curvature_principal_directions_per_vertex()
    ms.compute_selection_by_condition_per_face(condselect="fi == 0")
    ms.meshing_invert_face_orientation(forceflip=True, onlyselected=True)
    vertices, faces = ms.current_mesh().vertex_matrix(), ms.current_mesh().face_matrix()
    with pytest.raises(pymeshlab.PyMeshLabException, match="curvature directions"):
        ms.meshing_inpaint_lowrank(detail="none")
    assert ms.current_mesh().vertex_matrix().tobytes("A") == vertices.tobytes("A")
    assert np.array_equal(ms.current_mesh().face_matrix(), faces)


def saved(path: Path, mesh: tuple[np.ndarray, np.ndarray]) -> Path:
    mesh_set(mesh).save_current_mesh(str(path))
    return path


def test_the_command_line_repairs_when_asked(tmp_path, holed_sphere, capsys):
    vertices, faces = holed_sphere
    loop = find_boundary(vertices, faces).loops[0]
    place = tuple(vertices[faces[loop.faces[0]]].mean(axis=0))
    source = saved(tmp_path / "a.ply", spoilt(holed_sphere, "fin", place))
    call = ["inpaint", str(source), str(tmp_path / "b.ply"), "--detail", "none", "--json"]
    assert main(call) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["status"] == "partly filled"
    assert document["notes"][0].endswith("Or run again with --repair.")
    assert main([*call, "--repair"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["notes"] == ["Repaired: 0 vertices merged, 1 faces removed, 0 faces turned."]
    assert {hole["status"] for hole in document["holes"]} == {"filled"}
    chain = ["batch", str(tmp_path), str(tmp_path / "out"), "--chain", "meshlab-fill", "--repair"]
    assert main(chain) == 2


def test_turned_faces_are_counted(tmp_path, holed_sphere, equator, capsys):
    source = saved(tmp_path / "a.ply", spoilt(holed_sphere, "turned", equator))
    call = ["inpaint", str(source), str(tmp_path / "b.ply"), "--detail", "none", "--json"]
    assert main([*call, "--repair"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["notes"] == ["Repaired: 0 vertices merged, 0 faces removed, 1 faces turned."]


def test_a_batch_does_files_again_that_are_to_be_repaired(tmp_path, holed_sphere, equator):
    scans = tmp_path / "scans"
    scans.mkdir()
    saved(scans / "a.ply", spoilt(holed_sphere, "doubled", equator))
    options: dict[str, Any] = {"parameters": NONE, "pictures": False}
    first = batch(scans, tmp_path / "out", **options)
    again = batch(scans, tmp_path / "out", **options, repair=True)
    assert [r.status for r in first.records] == [r.status for r in again.records] == ["done"]
    assert not first.records[0].notes[0].startswith("Repaired")
    assert again.records[0].notes[0].startswith("Repaired")


@pytest.mark.parametrize("kind", KINDS)
def test_the_ready_chain_repairs_too(holed_sphere, equator, kind):
    ms = mesh_set(spoilt(holed_sphere, kind, equator))
    load_chain(ready_chains()["clean-and-inpaint"]).run(ms)
    mesh = ms.current_mesh()
    border = border_of(mesh.face_matrix().astype(np.int64), mesh.vertex_number())
    assert (len(border.half_edges), border.non_manifold, border.inconsistent) == (0, 0, 0)
