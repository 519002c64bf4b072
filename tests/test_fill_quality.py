"""What the record of a hole says of its fill: crossings, folds, angles at the rim, edge lengths."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.cli import main
from meshlab_lowrank.comparison.figures import rim_angle
from meshlab_lowrank.fill import Fill
from meshlab_lowrank.filling import Filler
from meshlab_lowrank.folders.file_run import FileRecord
from meshlab_lowrank.folders.manifest import Manifest
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.crossings import crossing_pairs
from meshlab_lowrank.mesh.geometry import edge_lengths
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.restoring import restore_detail
from meshlab_lowrank.result import InpaintResult
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import Region, cut_rings

NONE = InpaintParameters(detail="none")


def open_sphere(height: float = 0.7, *, turned: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Give a unit sphere without what lies above a height, or turned upside down."""
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=4)
    vertices, faces = ms.current_mesh().vertex_matrix(), ms.current_mesh().face_matrix()
    kept = faces[(vertices[faces, 2] <= height).any(axis=1)]
    return (vertices * [1.0, -1.0, -1.0] if turned else vertices), kept


def joined(*parts: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    faces = [faces + start for (_, faces), start in zip(parts, starts, strict=True)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def crossings(result: InpaintResult) -> int:
    """Count the pairs with a new face as the whole result has them, each once."""
    every = np.arange(len(result.faces))
    new = np.flatnonzero(result.new_faces)
    pairs = crossing_pairs(result.vertices, result.faces, new, every)
    return len(np.unique(np.sort(pairs, axis=1), axis=0))


def test_fills_that_cross_one_another_count_each_the_pairs() -> None:
    vertices, faces = open_sphere(turned=True)
    result = inpaint(
        *joined(open_sphere(), (vertices + np.array([0.05, 0.02, 1.8]), faces)), parameters=NONE
    )
    first, second = result.holes
    assert first.status == second.status == "filled"
    assert first.crossings == second.crossings == crossings(result) > 0


def test_what_a_mesh_has_of_crossings_is_counted() -> None:
    """A needle passes through the hole, without an end in it."""
    needle = np.array([[0.0, 0.05, -3.0], [0.05, -0.05, -3.0], [0.02, 0.0, 3.0]])
    result = inpaint(*joined(open_sphere(), (needle, np.array([[0, 1, 2]]))), parameters=NONE)
    hole = next(hole for hole in result.holes if hole.status == "filled")
    assert hole.crossings == crossings(result) > 0
    assert f"({hole.crossings} pairs of faces cross)" in hole.reason


def test_a_rim_is_counted_over_its_sheet(sheet: Callable[..., tuple[np.ndarray, ...]]) -> None:
    parameters = InpaintParameters(detail="none", closerim=True)
    result = inpaint(*sheet(5, 5), parameters=parameters)
    assert sum(hole.crossings for hole in result.holes) == crossings(result) > 0


def test_detail_is_counted_as_it_stays(holed_sphere: tuple[np.ndarray, np.ndarray]) -> None:
    result = inpaint(*holed_sphere, parameters=InpaintParameters(detail="full"))
    assert [hole.crossings for hole in result.holes] == [0, 0]
    assert crossings(result) == 0


@pytest.mark.parametrize(("detailed", "left"), [(2, 2), (5, 5), (6, 5)])
def test_detail_that_stays_is_counted_anew(detailed: int, left: int) -> None:
    """The smooth fill has five crossings; with more than that it comes back."""

    class Closer:
        def crossings(self, regions: list[Region]) -> list[np.ndarray]:
            return [np.zeros(detailed, dtype=np.int64) for _ in regions]

    vertices, faces = open_sphere()
    loop = boundary_loops(vertices, faces)[0]
    (region,) = cut_rings(vertices, faces, [loop.vertices], [loop.faces], rings=2)
    smooth = Fill(
        region, np.zeros((0, 3)), 0.0, "", trusts=np.zeros(0), errors=np.zeros(0), crossings=5
    )
    fills = {0: replace(smooth, trust=0.9)}
    clear = Filler._clear_of_others(None, Closer(), {0: smooth}, fills)
    assert clear[0].crossings == left
    assert clear[0].trust == (0.0 if detailed > 5 else 0.9)


def test_a_clean_fill_of_a_sphere() -> None:
    result = inpaint(*open_sphere(), parameters=NONE)
    (hole,) = result.holes
    assert (hole.crossings, hole.folded_edges, hole.flat_faces) == (0, 0, 0)
    part = SurfacePart(result.vertices, result.faces, result.new_faces)
    assert hole.rim_angle == pytest.approx(rim_angle(part), abs=1e-4)
    assert 0.0 < hole.rim_angle < 15.0
    assert 0.7 < hole.edge_ratio < 1.3


@pytest.mark.parametrize("height", [0.3, 0.6])
def test_the_angle_of_a_flat_cap_is_that_of_the_wall(height: float) -> None:
    vertices, faces = open_sphere(height)
    vertices = np.where(vertices[:, 2:] > height, vertices * [1, 1, 0] + [0, 0, height], vertices)
    flat = InpaintParameters(detail="none", continuity="flat")
    (hole,) = inpaint(vertices, faces, parameters=flat).holes
    steepness = np.degrees(np.arccos(height))
    assert hole.rim_angle == pytest.approx(steepness, abs=8.0)
    assert hole.folded_edges == 0


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_the_edge_ratio_follows_the_edge_length_that_is_asked_for(share: float) -> None:
    vertices, faces = open_sphere(0.3)
    around = edge_lengths(vertices, faces).mean()
    parameters = InpaintParameters(detail="none", refineedgelen=share * around)
    (hole,) = inpaint(vertices, faces, parameters=parameters).holes
    assert hole.edge_ratio == pytest.approx(share, rel=0.25)


def test_a_hole_that_stays_open_has_no_angle() -> None:
    (hole,) = inpaint(*open_sphere(), parameters=InpaintParameters(maxholesize=3)).holes
    assert hole.status == "skipped"
    known = hole.as_dict()
    assert (known["rim_angle"], known["edge_ratio"], known["crossings"]) == (None, None, 0)


def test_a_patch_has_them_too() -> None:
    vertices, faces = open_sphere(2.0)
    patch = vertices[:, 2] > 0.8
    (record,) = restore_detail(vertices, faces, patch, parameters=NONE).holes
    assert record.crossings == 0
    assert 0.0 < record.rim_angle < 10.0
    assert record.edge_ratio == pytest.approx(1.0, abs=0.1)
    through = np.array([[0.0, 0.05, -3.0], [0.05, -0.05, -3.0], [0.02, 0.0, 3.0]])
    points, triangles = joined((vertices, faces), (through, np.array([[0, 1, 2]])))
    chosen = np.append(patch, [False] * 3)
    (record,) = restore_detail(points, triangles, chosen, parameters=NONE).holes
    needle = [len(triangles) - 1]
    assert (
        record.crossings
        == len(
            crossing_pairs(
                points, triangles, np.array(needle), np.flatnonzero(patch[faces].any(axis=1))
            )
        )
        > 0
    )


def test_the_command_and_the_manifest_tell_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(*open_sphere()))
    ms.save_current_mesh(str(tmp_path / "scan.ply"))
    call = ["inpaint", str(tmp_path / "scan.ply"), str(tmp_path / "whole.ply"), "--json"]
    assert main([*call, "--detail", "none"]) == 0
    (hole,) = json.loads(capsys.readouterr().out)["holes"]
    assert hole["crossings"] == 0
    assert hole["rim_angle"] > 0.0
    assert hole["edge_ratio"] > 0.0
    unknown = {**hole, "status": "skipped", "rim_angle": None, "edge_ratio": None}
    record = FileRecord(file="scan.ply", status="done", holes=[hole, unknown])
    manifest = Manifest(tmp_path)
    manifest.append(record.as_dict())
    assert manifest.last_records()["scan.ply"]["holes"] == [hole, unknown]
