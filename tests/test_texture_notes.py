"""Where a texture can't run on, the fill has one texel, and the note says why and what to do."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.cli import main
from meshlab_lowrank.mesh_files import load_mesh, save_mesh
from tests.test_attributes import disc, textured, write_png  # noqa: F401  a fixture

SIZE = 24
SPLIT = 12.0  # the place of the seam
REMEDY = "compute_color_from_texture_per_vertex"


def cut_sheet(*, jump: float, left_hole: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A sheet that is cut open along a line, with a hole across it: vertices, faces, coordinates.

    The vertices along the cut are doubled; beyond it the coordinates are some way off.
    """
    points, faces, _ = disc(SIZE)
    middle = points[faces].mean(axis=1)
    centre = [5.0 if left_hole else SPLIT, 12.0, 0.0]
    faces = faces[np.linalg.norm(middle - centre, axis=1) > 3.2]
    right = points[faces].mean(axis=1)[:, 0] > SPLIT
    shared = np.intersect1d(faces[right], faces[~right])
    double = np.arange(len(points))
    double[shared] = len(points) + np.arange(len(shared))
    faces = np.where(right[:, None], double[faces], faces)
    everything = np.vstack([points, points[shared]])
    coordinates = everything[:, :2] / SIZE
    beyond = np.zeros(len(everything), dtype=bool)
    beyond[faces[right]] = True
    return everything, faces, coordinates + np.outer(beyond, [jump, 0.0])


def fill(
    vertices: np.ndarray, faces: np.ndarray, coordinates: np.ndarray, *, of_wedges: bool
) -> tuple[dict, np.ndarray, np.ndarray]:
    """Fill: the report, and positions and coordinates at the corners of the new faces."""
    of = {"w_tex_coords_matrix": coordinates[faces].reshape(-1, 2)}
    of = of if of_wedges else {"v_tex_coords_matrix": coordinates}
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(vertices, faces, **of))
    mesh = ms.current_mesh()
    read = mesh.wedge_tex_coord_matrix if of_wedges else mesh.vertex_tex_coord_matrix
    before = read()
    report = ms.meshing_inpaint_lowrank(detail="none")
    new, after = mesh.face_matrix()[len(faces) :], read()
    assert np.array_equal(after[: len(before)], before)
    found = after[len(before) :] if of_wedges else after[new].reshape(-1, 2)
    return report, mesh.vertex_matrix()[new].reshape(-1, 3), found


def charts(report: dict) -> list[str]:
    return [note for note in report["texture_notes"] if "several charts" in note]


@pytest.mark.parametrize("of_wedges", [True, False])
def test_nothing_is_smeared_over_a_seam_that_is_cut_open(of_wedges: bool) -> None:
    sheet = cut_sheet(jump=0.4)
    report, positions, found = fill(*sheet, of_wedges=of_wedges)
    hole = next(hole for hole in report["holes"] if hole["status"] == "filled")
    new = np.ones(len(found), dtype=bool)
    if not of_wedges:  # measured vertices keep theirs, which the note tells
        new = (positions[:, None] != sheet[0]).any(axis=2).all(axis=1)
    assert new.any()
    assert (found[new] == found[new][0]).all()
    vertices_told = [
        "compute_texcoord_transfer_vertex_to_wedge" in n for n in report["texture_notes"]
    ]
    assert any(vertices_told) != of_wedges
    assert report["untextured_faces"] == report["new_faces"] == hole["new_faces"] > 0
    (note,) = charts(report)
    assert f"{hole['new_faces']} new faces of hole {hole['id']}, since its rim lies" in note
    assert REMEDY in note


@pytest.mark.parametrize("of_wedges", [True, False])
@pytest.mark.parametrize("options", [{"jump": 0.0}, {"jump": 0.4, "left_hole": True}])
def test_a_seam_elsewhere_or_without_a_jump_changes_nothing(options: dict, of_wedges: bool) -> None:
    report, positions, found = fill(*cut_sheet(**options), of_wedges=of_wedges)
    assert report["untextured_faces"] == 0 < report["new_faces"]
    assert charts(report) == []
    np.testing.assert_allclose(found, positions[:, :2] / SIZE, atol=2e-3)


def test_the_note_names_the_holes_and_its_remedy_helps(textured: pymeshlab.MeshSet) -> None:  # noqa: F811
    textured.compute_color_from_texture_per_vertex()
    report = textured.meshing_inpaint_lowrank(detail="none")
    between = [hole for hole in report["holes"] if hole["new_faces"] == report["untextured_faces"]]
    (note,) = report["texture_notes"]
    assert any(f"new faces of hole {hole['id']}, since its rim" in note for hole in between)
    mesh = textured.current_mesh()
    new = mesh.vertex_custom_scalar_attribute_array("inpainted") == 1
    colours, places = mesh.vertex_color_matrix()[new], mesh.vertex_matrix()[new]
    left = (places[:, 1] < 8) & (places[:, 0] < 11.4)
    right = (places[:, 1] < 8) & (places[:, 0] > 11.6)
    assert (colours[left, 0] > colours[left, 1]).all()  # red
    assert (colours[right, 1] > colours[right, 0]).all()  # green
    assert left.any()
    assert right.any()


def test_coordinates_without_an_image_are_told() -> None:
    report, _, _ = fill(*cut_sheet(jump=0.0), of_wedges=True)
    (note,) = report["texture_notes"]
    assert "names no image" in note
    assert "set_texture_per_mesh" in note


def test_a_mesh_without_coordinates_has_no_note(holed_set: object) -> None:
    assert holed_set().meshing_inpaint_lowrank(detail="none")["texture_notes"] == []  # type: ignore[operator]


def write_cut_sheet(folder: Path, *, of_wedges: bool) -> Path:
    vertices, faces, coordinates = cut_sheet(jump=0.4)
    of = {"w_tex_coords_matrix": coordinates[faces].reshape(-1, 2)}
    of = of if of_wedges else {"v_tex_coords_matrix": coordinates}
    write_png(folder / "a.png", (255, 0, 0))
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(vertices, faces, **of))
    ms.save_current_mesh(str(folder / "a.ply"))
    data = (folder / "a.ply").read_bytes()
    named = data.replace(b"\nelement vertex", b"\ncomment TextureFile a.png\nelement vertex", 1)
    (folder / "a.ply").write_bytes(named)
    return folder / "a.ply"


def test_the_document_of_a_file_has_the_notes(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = write_cut_sheet(tmp_path, of_wedges=True)
    call = ["inpaint", str(source), str(tmp_path / "b.ply"), "--detail", "none"]
    main([*call, "--json"])
    notes = json.loads(capfd.readouterr().out)["notes"]
    assert sum("several charts" in note and REMEDY in note for note in notes) == 1
    main(call)
    assert "several charts" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("suffix", "of_wedges", "lost"),
    [
        (".ply", True, ""),
        (".ply", False, ""),
        (".obj", True, ""),
        (".obj", False, "The OBJ file no longer names its texture image; write PLY to keep it."),
        (".off", True, "The OFF file has lost the texture coordinates; write PLY to keep them."),
        (".stl", True, "The STL file has lost the texture coordinates; write PLY to keep them."),
    ],
)
def test_formats_that_lose_a_texture_are_told(
    tmp_path: Path, suffix: str, of_wedges: bool, lost: str
) -> None:
    (tmp_path / "out").mkdir()
    loaded = load_mesh(write_cut_sheet(tmp_path, of_wedges=of_wedges))
    assert save_mesh(loaded, tmp_path / "out" / f"b{suffix}") == ((lost,) if lost else ())
