"""What the auto preset makes of the sample meshes, against their truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pymeshlab
import pytest
from scipy.spatial import cKDTree

import sample_meshes
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.geometry import face_normals
from meshlab_lowrank.mesh.topology import border_of

FOLDER = Path(sample_meshes.__file__).parent
SUBDIVISION = 6


def load(name):
    mesh_set = pymeshlab.MeshSet(verbose=False)
    mesh_set.load_new_mesh(str(FOLDER / f"{name}.ply"))
    mesh = mesh_set.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def dense(vertices, faces):
    """Points all over the faces with the faces' normals."""
    i, j = np.mgrid[: SUBDIVISION + 1, : SUBDIVISION + 1]
    inside = i + j <= SUBDIVISION
    shares = np.stack([i[inside], j[inside], (SUBDIVISION - i - j)[inside]], 1) / SUBDIVISION
    points = np.einsum("sc,fcd->fsd", shares, vertices[faces]).reshape(-1, 3)
    return points, np.repeat(face_normals(vertices, faces), len(shares), axis=0)


def errors(name, holes=None):
    """RMS distance of the new vertices from the true mesh: of the smooth fill, and of auto."""
    vertices, faces = load(f"{name}_holes")
    points, normals = dense(*load(name))
    tree = cKDTree(points)
    found = []
    for detail in ("none", "calibrated"):
        result = inpaint(vertices, faces, holes=holes, detail=detail)
        filled = [hole.id for hole in result.holes if hole.status == "filled"]
        assert filled == (list(holes) if holes else [hole.id for hole in result.holes])
        assert result.vertices[: len(vertices)].tobytes() == vertices.tobytes()
        border = border_of(result.faces, len(result.vertices))
        assert border.non_manifold == border.inconsistent == 0
        assert (len(border.half_edges) == 0) == (holes is None)
        new = result.vertices[result.new_vertices]
        nearest = tree.query(new)[1]
        away = np.einsum("ij,ij->i", new - points[nearest], normals[nearest])
        found.append(float(np.sqrt(np.mean(away**2))))
    return found


@pytest.mark.parametrize(
    ("name", "holes"), [("bumps", (0,)), ("knurl", None), ("scales", None), ("weave", None)]
)
def test_repeated_detail_comes_back(name, holes):
    smooth, auto = errors(name, holes)
    assert auto < smooth / 3.0


def test_a_smooth_surface_is_filled_no_worse_than_smoothly():
    smooth, auto = errors("smooth")
    assert auto < 1.1 * smooth
