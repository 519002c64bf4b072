"""Meshes of other libraries go in and come out, with what they hold."""

import subprocess
import sys

import numpy as np
import pytest

import meshlab_lowrank
from meshlab_lowrank import HoleRecord, InpaintResult
from meshlab_lowrank.comparison.comparing import Comparison
from meshlab_lowrank.comparison.measuring import Row
from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.folders.file_run import FileRecord
from meshlab_lowrank.folders.run import BatchResult

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the libraries


@pytest.fixture(scope="module")
def expected(holed_sphere):
    return meshlab_lowrank.inpaint(*holed_sphere, detail="none")


def check_geometry(vertices, faces, expected):
    assert np.array_equal(vertices, expected.vertices)
    assert np.array_equal(faces, expected.faces)


def test_trimesh(holed_sphere, expected):
    trimesh = pytest.importorskip("trimesh")
    n, m = map(len, holed_sphere)
    colours = np.full((n, 4), 255, dtype=np.uint8)
    colours[:, 0] = 90
    mesh = trimesh.Trimesh(
        *holed_sphere,
        process=False,
        vertex_colors=colours,
        vertex_attributes={"height": holed_sphere[0][:, 2]},
        face_attributes={"part": np.arange(m)},
        metadata={"name": "scan"},
    )
    result = meshlab_lowrank.inpaint(mesh, detail="none")
    whole = result.mesh
    assert type(whole) is trimesh.Trimesh
    check_geometry(whole.vertices, whole.faces, expected)
    assert (whole.visual.vertex_colors == [90, 255, 255, 255]).all()
    height = whole.vertex_attributes["height"]
    assert np.array_equal(height[:n], holed_sphere[0][:, 2])
    assert height[n:].max() > 0.8
    assert np.isfinite(height).all()
    part = whole.face_attributes["part"]
    assert np.array_equal(part[:m], np.arange(m))
    assert np.isin(part[m:], part[:m]).all()
    assert np.array_equal(whole.vertex_attributes["inpainted"], expected.new_vertices)
    assert whole.metadata["name"] == "scan"
    assert len(mesh.vertices) == n

    uv = holed_sphere[0][:, :2]
    textured = trimesh.Trimesh(
        *holed_sphere, process=False, visual=trimesh.visual.TextureVisuals(uv=uv)
    )
    found = meshlab_lowrank.inpaint(textured, detail="none").mesh.visual.uv
    assert np.array_equal(found[:n], uv)
    assert len(found) == len(expected.vertices)


def test_pyvista(holed_sphere, expected):
    pyvista = pytest.importorskip("pyvista")
    n, m = map(len, holed_sphere)
    mesh = pyvista.PolyData.from_regular_faces(*holed_sphere)
    mesh.point_data["height"] = holed_sphere[0][:, 2]
    mesh.point_data["label"] = np.arange(n)
    mesh.cell_data["part"] = np.arange(m)
    mesh.field_data["author"] = ["me"]
    whole = meshlab_lowrank.inpaint(mesh, detail="none").mesh
    assert type(whole) is pyvista.PolyData
    check_geometry(whole.points, whole.regular_faces, expected)
    assert np.array_equal(whole.point_data["height"][:n], holed_sphere[0][:, 2])
    assert np.isin(whole.point_data["label"][n:], np.arange(n)).all()
    assert np.array_equal(whole.point_data["inpaint_trust"], expected.trust)
    assert np.array_equal(whole.cell_data["inpainted"], expected.new_faces)
    assert list(whole.field_data["author"]) == ["me"]
    with_normals = mesh.compute_normals(split_vertices=False)
    result = meshlab_lowrank.inpaint(with_normals, detail="none")
    assert "normals were left out" in result.notes[-1]
    assert "Normals" not in result.mesh.point_data
    with pytest.raises(InvalidMeshError, match="faces only"):
        meshlab_lowrank.inpaint(pyvista.Line())


def test_pyvista_squares_become_triangles():
    pyvista = pytest.importorskip("pyvista")
    mesh = pyvista.Plane(i_resolution=6, j_resolution=6).remove_cells([14, 15, 20, 21])
    result = meshlab_lowrank.inpaint(mesh, detail="none")
    assert [hole.status for hole in result.holes] == ["skipped", "filled"]
    assert result.mesh.is_all_triangles


def test_open3d(holed_sphere, expected):
    open3d = pytest.importorskip("open3d")
    vectors = open3d.utility
    mesh = open3d.geometry.TriangleMesh(
        vectors.Vector3dVector(holed_sphere[0]), vectors.Vector3iVector(holed_sphere[1])
    )
    mesh.paint_uniform_color([0.25, 0.5, 1.0])
    mesh.compute_vertex_normals()
    whole = meshlab_lowrank.inpaint(mesh, detail="none").mesh
    assert type(whole) is open3d.geometry.TriangleMesh
    check_geometry(np.asarray(whole.vertices), np.asarray(whole.triangles), expected)
    assert np.allclose(np.asarray(whole.vertex_colors), [0.25, 0.5, 1.0])
    assert whole.has_vertex_normals()
    uvs = vectors.Vector2dVector(np.zeros((3 * len(holed_sphere[1]), 2)))
    mesh.triangle_uvs = uvs
    assert "left out" in meshlab_lowrank.inpaint(mesh, detail="none").notes[-1]
    tensor = open3d.t.geometry.TriangleMesh.from_legacy(mesh)
    result = meshlab_lowrank.inpaint(tensor, detail="none")
    assert type(result.mesh) is open3d.t.geometry.TriangleMesh
    assert len(result.mesh.vertex.positions) == len(result.vertices)


def test_detail_is_restored_on_a_mesh(holed_sphere):
    trimesh = pytest.importorskip("trimesh")
    part = holed_sphere[0][:, 2] < -0.9
    mesh = trimesh.Trimesh(*holed_sphere, process=False)
    result = meshlab_lowrank.restore_detail(mesh, selected_vertices=part, detail="none")
    by_arrays = meshlab_lowrank.restore_detail(*holed_sphere, part, detail="none")
    assert np.array_equal(result.mesh.vertices, by_arrays.vertices)
    assert by_arrays.mesh is None


def test_what_is_no_mesh_is_refused():
    with pytest.raises(InvalidMeshError, match="A list alone is no mesh"):
        meshlab_lowrank.inpaint([[0.0, 0.0, 0.0]])


def test_no_library_is_imported_for_arrays():
    code = (
        "import sys, numpy, meshlab_lowrank; "
        "meshlab_lowrank.inpaint(numpy.eye(3), [[0, 1, 2]]); "
        "print(sorted({'trimesh', 'pyvista', 'open3d'} & set(sys.modules)))"
    )
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "[]\n")


def test_results_show_their_gist_on_a_line(expected):
    lost = HoleRecord(
        id=12,
        status="failed",
        reason="It is long and\nwinding. " * 20,
        boundary_edges=3000,
        perimeter=1.0,
        diameter=1.0,
    )
    many = BatchResult(records=(), seconds=1.0, problems=("The disk is full. " * 20,))
    comparison = Comparison(
        name="scan" * 40,
        vertices=1,
        faces=1,
        fillers={},
        cases=(),
        rows=(),
        scenes={},
        notes=(),
        settings={},
        seconds=2.0,
        truth_distance=None,
    )
    row = Row(
        hole=0,
        place=2,
        size=1.0,
        filler="lowrank",
        status="failed",
        reason="It is too long to tell. " * 9,
        seconds=1.0,
        cpu_seconds=1.0,
        memory=0,
        run_holes=1,
        kept=True,
        edge_length=1.0,
        diagonal=1.0,
        shape=None,
        error=None,
        hausdorff={},
    )
    record = FileRecord(file="scans/" * 30, status="failed", reason="It is no mesh.")
    for result in (expected, *expected.holes, lost, many, comparison, row, record):
        assert len(repr(result)) <= 100
        assert "\n" not in repr(result)
        assert repr(result).startswith(f"<{type(result).__name__}")
    assert isinstance(expected, InpaintResult)
    assert "2 of 2 holes filled" in repr(expected)
    assert "3000 edges failed; It is long" in repr(lost)


def test_dir_lists_the_public_names():
    names = [name for name in dir(meshlab_lowrank) if not name.startswith("__")]
    public = [name for name in meshlab_lowrank.__all__ if not name.startswith("__")]
    assert names == sorted(public)
