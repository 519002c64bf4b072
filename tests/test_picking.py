"""Holes picked by number, by place, by size and by a selection, in arrays, filters and commands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank import InpaintParameters, batch, inpaint, measure_holes
from meshlab_lowrank.chains import load_chain
from meshlab_lowrank.cli import main
from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.folders.settings import parameter_texts
from meshlab_lowrank.picking import NOT_PICKED, reasons_to_skip
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from tests.test_boundary_loops import rotation

Mesh = tuple[np.ndarray, np.ndarray]
POLES = {0: [0.0, 0.0, -1.0], 1: [0.0, 1.0, 0.0], 2: [1.0, 0.0, 0.0]}


@pytest.fixture(scope="module")
def ball() -> Mesh:
    """A sphere with three round holes, the longest first in the order of the poles."""
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=4)
    vertices, faces = ms.current_mesh().vertex_matrix(), ms.current_mesh().face_matrix()
    middles = vertices[faces].mean(axis=1)
    for pole, height in zip(POLES.values(), (0.85, 0.9, 0.95), strict=True):
        kept = middles @ pole < height
        faces, middles = faces[kept], middles[kept]
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3).astype(np.int64)


@pytest.fixture
def scan(ball: Mesh, tmp_path: Path) -> Path:
    """That sphere in a file that keeps a selected face at hole 1."""
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(*ball))
    ms.compute_selection_by_condition_per_face(condselect="y0 > 0.85 && x0 > 0")
    ms.save_current_mesh(str(tmp_path / "scan.ply"), save_face_flag=True)
    return tmp_path / "scan.ply"


def filled(mesh: Mesh, *, detail: str = "none", **options: Any) -> list[int]:
    """Fill, and give the numbers of the holes that are no longer there."""
    sizes = ("maxholesize", "minholesize", "maxholelength", "minholelength", "closerim")
    values = {name: options.pop(name) for name in sizes if name in options}
    parameters = InpaintParameters(detail=detail, **values)
    result = inpaint(*mesh, parameters=parameters, **options)
    assert result.vertices[: len(mesh[0])].tobytes() == mesh[0].tobytes()
    assert result.faces[: len(mesh[1])].tobytes() == mesh[1].tobytes()
    before, after = measure_holes(*mesh), measure_holes(result.vertices, result.faces)
    closed = [i for i, vertex in enumerate(before["vertex"]) if vertex not in after["vertex"]]
    assert closed == [hole.id for hole in result.holes if hole.status == "filled"]
    return closed


def test_the_table_tells_where_the_gaps_are(ball: Mesh) -> None:
    turn, shift = rotation(3), np.array([5.0, 6.0, 7.0])
    table = measure_holes(2.0 * ball[0] @ turn.T + shift, ball[1])
    axes = np.array(list(POLES.values())) @ turn.T
    normals, centres = np.array(table["normal"]), np.array(table["centre"])
    np.testing.assert_allclose(normals, axes, atol=0.02)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    heights = ((centres - shift) * axes).sum(axis=1)
    np.testing.assert_allclose(heights, [1.7, 1.8, 1.9], atol=0.06)
    np.testing.assert_allclose(centres, shift + heights[:, None] * axes, atol=0.02)


def test_holes_are_picked_by_number(ball: Mesh) -> None:
    assert filled(ball, holes=[1]) == [1]
    assert filled(ball, holes=np.array([2, 0, 2])) == [0, 2]
    result = inpaint(*ball, parameters=InpaintParameters(detail="none"), holes=(0,))
    assert [hole.reason for hole in result.holes[1:]] == [NOT_PICKED] * 2


@pytest.mark.parametrize("number", POLES)
def test_the_hole_with_the_nearest_rim_is_picked(ball: Mesh, number: int) -> None:
    assert filled(ball, near=np.array(POLES[number]) * 1.5) == [number]


def test_the_rim_counts_and_not_the_centre_nor_its_vertices(sheet: Any) -> None:
    """A long slot, whose end is near and whose centre is far, beside a small round hole."""
    vertices, faces = sheet(13, 60, jitter=0.0)
    x, y = vertices[:, 0], vertices[:, 1]
    slot = (np.abs(y - 5.2) < 1.5) & (x > 4.0) & (x < 40.0)
    gone = slot | (np.hypot(x - 50.0, y - 5.2) < 1.2)
    mesh = vertices, faces[~gone[faces].any(axis=1)]
    table = measure_holes(*mesh)
    rim, long, small = range(3)
    assert table["is_rim"] == [True, False, False]
    assert filled(mesh, near=[42.0, 5.2, 0.0]) == [long]
    assert filled(mesh, near=[47.0, 5.2, 0.0]) == [small]
    far = [59.0, 5.2, 0.0]  # at the edge of the sheet
    assert filled(mesh, near=far) == [small]
    reasons = reasons_to_skip(
        vertices, boundary_loops(*mesh), InpaintParameters(closerim=True), near=far
    )
    assert [i for i, reason in enumerate(reasons) if not reason] == [rim]  # filling it takes long


def test_sizes_bound_from_both_sides_inclusively(ball: Mesh) -> None:
    table = measure_holes(*ball)
    edges, lengths = table["boundary_edges"], table["perimeter"]
    assert len(set(edges)) == 3
    assert filled(ball, minholesize=edges[1]) == [0, 1]
    assert filled(ball, minholesize=edges[1] + 1) == [0]
    assert filled(ball, minholesize=edges[1], maxholesize=edges[1]) == [1]
    assert filled(ball, minholelength=lengths[1]) == [0, 1]
    assert filled(ball, minholelength=lengths[1] * 1.0001) == [0]
    assert filled(ball, maxholelength=lengths[1]) == [1, 2]
    assert filled(ball, maxholelength=lengths[1] * 0.9999) == [2]
    doubled = 2.0 * ball[0], ball[1]
    assert filled(doubled, maxholelength=2.0 * lengths[1]) == [1, 2]
    assert filled(ball, minholesize=10_000) == []  # a size is no pick: other files may have some


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"holes": [3]}, "Parameter holes is 3, but the mesh has holes 0 to 2; see"),
        ({"holes": [1, -1]}, "Parameter holes is -1, but"),
        ({"holes": []}, r"Parameter holes is \[\]; give numbers"),
        ({"holes": "1"}, "Parameter holes is '1'; give numbers"),
        ({"holes": [1.0]}, r"Parameter holes is \[1.0\]; give numbers"),
        ({"holes": [True]}, r"Parameter holes is \[True\]; give numbers"),
        ({"near": [0.0, 1.0]}, r"Parameter near is \[0.0, 1.0\]; give three numbers"),
        ({"near": "abc"}, "Parameter near is 'abc'; give three"),
        ({"near": [0.0, np.nan, 0.0]}, "Parameter near is .*; give three"),
        (
            {"holes": [0], "near": [0.0, 9.0, 0.0]},
            r"holes is \[0\] and near is \(0.0, 9.0, 0.0\), but that leaves nothing",
        ),
        (
            {"holes": [0], "maxholesize": 5},
            r"holes is \[0\], but .*: hole 0: it has .* maxholesize 5",
        ),
        ({"minholesize": 9, "maxholesize": 8}, "minholesize is 9, more than maxholesize 8"),
        ({"minholelength": 9.0, "maxholelength": 8.5}, "minholelength is 9.0, more than max"),
        ({"maxholelength": -1.0}, "maxholelength is -1.0; give a number of at least 0"),
        ({"minholelength": float("inf")}, "minholelength is inf; give"),
        ({"minholesize": 1.5}, "minholesize is 1.5; give a whole number"),
    ],
)
def test_what_picks_nothing_is_refused(ball: Mesh, options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InvalidParameterError, match=sentence):
        filled(ball, **options)


def test_a_closed_mesh_has_no_hole_to_pick() -> None:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=1)
    mesh = ms.current_mesh().vertex_matrix(), ms.current_mesh().face_matrix()
    with pytest.raises(InvalidParameterError, match="but the mesh has no hole"):
        inpaint(*mesh, holes=[0])
    with pytest.raises(InvalidParameterError, match="there is no hole"):
        inpaint(*mesh, near=[0.0, 0.0, 0.0])


def test_the_outer_rim_must_be_asked_for(sheet: Any) -> None:
    mesh = sheet(6, 6)
    with pytest.raises(InvalidParameterError, match="hole 0: it is the outer rim of an open"):
        inpaint(*mesh, holes=[0])
    with pytest.raises(InvalidParameterError, match="no hole but outer rims; set closerim"):
        inpaint(*mesh, near=[0.0, 0.0, 0.0])


def test_the_filter_takes_picks(ball: Mesh) -> None:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(*ball))
    assert ms.get_hole_measures() == measure_holes(*ball)
    with pytest.raises(pymeshlab.PyMeshLabException, match=r"meshing_inpaint.*holes is 7"):
        ms.meshing_inpaint_lowrank(holes=[7])
    report = ms.meshing_inpaint_lowrank(holes=[1], detail="none")
    assert [hole["status"] for hole in report["holes"]] == ["skipped", "filled", "skipped"]
    report = ms.meshing_inpaint_lowrank(near=POLES[2], detail="none")
    assert [hole["status"] for hole in report["holes"]] == ["skipped", "filled"]
    assert ms.get_hole_measures()["boundary_edges"] == measure_holes(*ball)["boundary_edges"][:1]


def test_a_script_takes_picks(scan: Path, tmp_path: Path) -> None:
    path = tmp_path / "pick.mlx"
    for name, value in (("holes", "1"), ("holes", "0, 2"), ("near", "0,2,-0.5")):
        path.write_text(
            f'<FilterScript><filter name="meshing_inpaint_lowrank"><Param name="{name}" '
            f'value="{value}"/><Param name="detail" value="none"/></filter></FilterScript>'
        )
        ms = pymeshlab.MeshSet(verbose=False)
        ms.load_new_mesh(str(scan))
        (report,) = load_chain(path).run(ms)
        done = [hole["id"] for hole in report["holes"] if hole["status"] == "filled"]
        assert done == ([0, 2] if value == "0, 2" else [1])


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--holes", "0,2"], [0, 2]),
        (["--near", "-0.1,-0.2,-3"], [0]),
        (["--selected"], [1]),
        (["--minholelength", "3", "--maxholelength", "4"], [1]),
    ],
)
def test_the_command_takes_picks(
    scan: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    options: list[str],
    expected: list[int],
) -> None:
    call = ["inpaint", str(scan), str(tmp_path / "out.ply"), "--detail", "none", "--json"]
    assert main([*call, *options]) == 0
    document = json.loads(capfd.readouterr().out)
    done = [hole["id"] for hole in document["holes"] if hole["status"] == "filled"]
    assert done == expected


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--holes", "3,x"], "holes is '3,x'"),
        (["--near", "1,2"], "near is [1.0, 2.0]"),
        (["--holes", "9"], "holes is 9, but the mesh has holes 0 to 2"),
        (["--selected", "--holes", "2"], "no face at it is selected"),
    ],
)
def test_the_command_refuses_what_picks_nothing(
    scan: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    sentence: str,
) -> None:
    assert main(["inpaint", str(scan), str(tmp_path / "out.ply"), *options]) in (1, 2)
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "out.ply").exists()


def test_a_folder_takes_selections_but_no_numbers(scan: Path, ball: Mesh, tmp_path: Path) -> None:
    scans = tmp_path / "scans"
    scans.mkdir()
    scan.rename(scans / "a.ply")
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(*ball))
    ms.save_current_mesh(str(scans / "b.off"))
    options = {"detail": "none", "selected": True}
    one, two = batch(scans, tmp_path / "out", parameters=options, pictures=False).records
    assert [hole["status"] for hole in one.holes] == ["skipped", "filled", "skipped"]
    assert two.status == "failed"
    assert two.reason.startswith("No face is selected in b.off; only PLY files keep a selection")
    for name, value in (("holes", [1]), ("near", (0.0, 1.0, 0.0))):
        with pytest.raises(InvalidParameterError, match=f"{name} is .* not of a folder"):
            batch(scans, tmp_path / "out", parameters={name: value}, pictures=False)


def test_picks_become_text() -> None:
    texts = parameter_texts({"holes": np.array([3, 7]), "near": (-1.0, 2, 0.5), "selected": True})
    assert texts == {"holes": "3,7", "near": "-1.0,2,0.5", "selected": "true"}
    with pytest.raises(InvalidParameterError, match="selected is 1; give True or False"):
        parameter_texts({"selected": 1})


def test_bad_edges_elsewhere_do_not_spoil_a_pick(tmp_path: Path, ball: Mesh) -> None:
    vertices, faces = ball
    table = measure_holes(*ball)
    face = faces[(faces == table["vertex"][2]).any(axis=1)][0]
    flap = np.array([[face[0], face[1], len(vertices)]])
    ms = pymeshlab.MeshSet(verbose=False)
    apex = vertices[face].mean(axis=0) * 1.2
    ms.add_mesh(pymeshlab.Mesh(np.vstack([vertices, apex]), np.vstack([faces, flap])))
    ms.save_current_mesh(str(tmp_path / "a.ply"))
    call = ["inpaint", str(tmp_path / "a.ply"), str(tmp_path / "b.ply"), "--detail", "none"]
    assert main(call) == 1
    assert main([*call, "--holes", "0"]) == 0
