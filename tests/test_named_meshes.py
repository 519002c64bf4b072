"""Known combinatorics of the meshes that come with PyMeshLab, and what filling does to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.hole_table import measure_holes
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.topology import edges_of, vertex_components
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops

FOLDER = Path(pymeshlab.__file__).parent / "tests" / "sample_meshes"


def load(name):
    path = FOLDER / name
    if not path.exists():
        pytest.skip(f"this PyMeshLab has no {name}")
    ms = pymeshlab.MeshSet()
    ms.load_new_mesh(str(path))
    return ms


def arrays(ms):
    mesh = ms.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def euler(faces):
    """Vertices that are used, less edges, plus faces."""
    return len(np.unique(faces)) - len(edges_of(faces).vertices) + len(faces)


@pytest.mark.parametrize("name", ["bunny.obj", "bone.ply", "cow.obj", "airplane.obj"])
def test_loops_are_as_meshlab_counts_them(name):
    vertices, faces = arrays(load(name))
    fans = np.isin(faces, np.linspace(0, len(vertices) - 1, 7).astype(int)[1:-1]).any(axis=1)
    for kept in (faces, faces[~fans]):
        ms = pymeshlab.MeshSet()
        ms.add_mesh(pymeshlab.Mesh(vertices, kept))
        expected = ms.get_topological_measures()
        table = measure_holes(vertices, kept)
        assert sum(table["boundary_edges"]) == expected["boundary_edges"]
        assert len(table["id"]) == expected["number_holes"]
        used = np.unique(kept)
        pieces = vertex_components(kept, len(vertices))[used]
        assert len(np.unique(pieces)) == expected["connected_components_number"]
    assert expected["number_holes"] >= 3  # a fan is a disc; two that touch are one


@pytest.mark.parametrize("name", ["bunny.obj", "cow.obj"])
def test_closed_bodies_without_handles_have_the_characteristic_of_a_sphere(name):
    vertices, faces = arrays(load(name))
    assert boundary_loops(vertices, faces) == ()
    assert euler(faces) == 2


def test_a_cube_without_a_face_is_a_disc():
    ms = load("cube.obj")
    vertices, faces = arrays(ms)
    assert euler(faces) == 2  # of a sphere
    assert boundary_loops(vertices, faces) == ()
    assert euler(faces[:-2]) == 1


@pytest.fixture(scope="module")
def punctured():
    """The bunny with four more holes."""
    vertices, faces = arrays(load("bunny.obj"))
    before = len(boundary_loops(vertices, faces))
    gone = np.zeros(len(vertices), dtype=bool)
    for place in (2000, 9000, 15000, 21000):
        size = 0.04 * np.linalg.norm(np.ptp(vertices, axis=0))
        gone |= np.linalg.norm(vertices - vertices[place], axis=1) < size
    faces = faces[~gone[faces].any(axis=1)]
    assert len(boundary_loops(vertices, faces)) >= before + 4
    return vertices, faces


def test_each_fill_is_a_disc(punctured):
    vertices, faces = punctured
    result = inpaint(vertices, faces, parameters=InpaintParameters(detail="none"))
    filled = sum(hole.status == "filled" for hole in result.holes)
    assert filled >= 4
    # A disc has Euler characteristic 1, the loop along which it is glued 0.
    assert euler(result.faces) == euler(faces) + filled
    left = boundary_loops(result.vertices, result.faces)
    assert len(left) == len(result.holes) - filled
