"""A truth that is another surface, or lies elsewhere, is told of; the true one is not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.cli import main
from meshlab_lowrank.comparison.truth_check import truth_distance
from meshlab_lowrank.mesh.geometry import edge_lengths

Mesh: TypeAlias = "tuple[np.ndarray, np.ndarray]"
SAMPLES = Path(__file__).parents[1] / "sample_meshes"


def load(name: str) -> pymeshlab.MeshSet:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.load_new_mesh(str(SAMPLES / name))
    return ms


def arrays(ms: pymeshlab.MeshSet) -> Mesh:
    mesh = ms.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


@pytest.fixture(scope="module")
def whole() -> Mesh:
    return arrays(load("bumps.ply"))


@pytest.fixture(scope="module")
def holed() -> Mesh:
    return arrays(load("bumps_holes.ply"))


def remeshed(edges: float) -> Mesh:
    ms = load("bumps.ply")
    length = pymeshlab.PureValue(edges * edge_lengths(*arrays(ms)).mean())
    ms.meshing_isotropic_explicit_remeshing(targetlen=length)
    return arrays(ms)


def decimated(share: float) -> Mesh:
    ms = load("bumps.ply")
    ms.meshing_decimation_quadric_edge_collapse(targetperc=share)
    return arrays(ms)


def test_the_true_surface_is_the_same(holed: Mesh, whole: Mesh) -> None:
    found = truth_distance(holed, whole)
    assert found.same
    assert found.share_far == 0.0
    assert found.median_in_edges == pytest.approx(0.0, abs=1e-6)
    assert found.warning("a", "b") == ""


@pytest.mark.parametrize(
    "truth", [lambda: remeshed(1.0), lambda: remeshed(3.0), lambda: decimated(0.3)]
)
def test_other_triangles_are_no_other_surface(holed: Mesh, truth: Callable[[], Mesh]) -> None:
    assert truth_distance(holed, truth()).same


def test_a_scaled_truth_is_told_of(holed: Mesh, whole: Mesh) -> None:
    vertices, faces = whole
    assert not truth_distance(holed, (1.01 * vertices, faces)).same
    centre = vertices.mean(axis=0)
    inch = truth_distance(holed, ((vertices - centre) * 25.4 + centre, faces))
    assert not inch.same
    assert inch.share_far > 0.5


@pytest.mark.parametrize("edges", [0.15, 5.0])
def test_a_truth_that_was_moved_is_as_far_as_it_was_moved(edges: float) -> None:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_grid(numvertx=40, numverty=40, absscalex=39.0, absscaley=39.0)
    vertices, faces = arrays(ms)
    length = edge_lengths(vertices, faces).mean()
    moved = vertices + np.array([0.0, 0.0, edges * length])
    found = truth_distance((vertices, faces), (moved, faces))
    assert not found.same
    share = float(edges > found.limit)
    assert found.share_far == share
    assert found.median_in_edges == pytest.approx(edges)
    diagonal = np.linalg.norm(np.ptp(vertices, axis=0))
    assert found.median_over_diagonal == pytest.approx(edges * length / diagonal)
    words = found.warning("scan.ply", "truth.ply")
    assert f"{share:.0%} of the known surface" in words
    assert f"median distance is {edges:.2g}" in words


def test_a_part_of_the_truth_is_not_the_truth(holed: Mesh, whole: Mesh) -> None:
    vertices, faces = whole
    half = faces[vertices[faces][:, :, 0].mean(axis=1) > np.median(vertices[:, 0])]
    found = truth_distance(holed, (vertices, half))
    assert not found.same
    assert 0.2 < found.share_far < 0.7


def test_the_command_warns_of_another_mesh_and_not_of_the_truth(
    capsys: pytest.CaptureFixture[str],
) -> None:
    scan = str(SAMPLES / "bumps_holes.ply")
    call = ["compare", scan, "--fillers", "close", "--holes", "1", "--json"]
    main([*call, "--truth", str(SAMPLES / "bumps.ply")])
    told = capsys.readouterr()
    assert "is not the surface" not in told.err
    assert json.loads(told.out)["truth_distance"]["same"]
    main([*call, "--truth", str(SAMPLES / "knurl.ply")])
    told = capsys.readouterr()
    assert "The truth knurl.ply is not the surface of bumps_holes.ply" in told.err
    document = json.loads(told.out)
    assert not document["truth_distance"]["same"]
    assert any("knurl.ply" in note for note in document["notes"])
