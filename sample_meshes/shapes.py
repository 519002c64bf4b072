"""Closed shapes with repeated surface detail, and discs cut out of them.

    from sample_meshes.holes import punch
    from sample_meshes.shapes import make_shape

    vertices, faces = make_shape("torus", "scales", count=8000, wavelength=10.0, seed=0)
    cut = punch(vertices, faces, place=1234, radius=8.0, outline="irregular", seed=1)
    cut.vertices, cut.faces          # the mesh with the hole
    faces[cut.removed_faces]         # the truth, in indices of the whole mesh

Lengths are in mean edge lengths h: `make_shape` returns meshes of mean edge length exactly 1 (about
`count` vertices), `punch` multiplies `radius` by the mean edge length of the mesh it is given.
Bodies are the keys of `bodies.BODIES`, details those of `details.DETAILS`; wave details (grooves,
ribs, rope, knurl, woven, bricks, chevrons, braid, eggbox, wrinkles) need a body with a chart
(torus, ring, capsule). The same arguments give the same bytes. Needs numpy, scipy, pymeshlab and
fast-simplification only.
"""

from __future__ import annotations

from typing import Literal

import fast_simplification
import numpy as np
import pymeshlab
from scipy.sparse import coo_array, csr_array, diags_array, eye_array
from scipy.spatial import KDTree

from .bodies import BODIES, FloatArray, IntArray
from .details import DETAILS
from .triangles import edges_of, mean_edge, vertex_normals

Triangulation = Literal["regular", "irregular"]

DENSITY = 2.3
"""Edges of the displaced mesh per edge of the final one."""


def _averaging(count: int, faces: IntArray) -> csr_array:
    """Row-stochastic one-ring mean that keeps half of the vertex's own value."""
    i, j = edges_of(faces).T
    adjacency = coo_array(
        (np.ones(2 * len(i)), (np.concatenate([i, j]), np.concatenate([j, i]))), (count, count)
    ).tocsr()
    ring = diags_array(1.0 / np.maximum(adjacency.sum(axis=1), 1.0)) @ adjacency
    return csr_array(0.5 * (ring + eye_array(count)))


def _remeshed(vertices: FloatArray, faces: IntArray, length: float) -> tuple[FloatArray, IntArray]:
    """Near-regular triangulation of the same surface by MeshLab's isotropic remeshing."""
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=8,
        adaptive=False,
        selectedonly=False,
        targetlen=pymeshlab.PureValue(length),
        featuredeg=180.0,
        checksurfdist=False,
        splitflag=True,
        collapseflag=True,
        swapflag=True,
        smoothflag=True,
        reprojectflag=True,
    )
    mesh = meshes.current_mesh()
    mesh.compact()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def _simplified(
    vertices: FloatArray, faces: IntArray, count: int, rng: np.random.Generator
) -> tuple[FloatArray, IntArray]:
    """Irregular triangulation of the same surface: quadric collapse, then a little relaxation."""
    normals, tree = vertex_normals(vertices, faces), KDTree(vertices)
    # Slid a little within the surface, or flat parts would keep the order of the dense mesh.
    i, j = edges_of(faces).T
    reach = np.full(len(vertices), np.inf)
    lengths = np.linalg.norm(vertices[i] - vertices[j], axis=1)
    np.minimum.at(reach, np.concatenate([i, j]), np.tile(lengths, 2))
    slide = 0.25 * reach[:, None] * rng.uniform(-1.0, 1.0, vertices.shape)
    slide -= np.einsum("nd,nd->n", slide, normals)[:, None] * normals
    simplified = fast_simplification.simplify(
        # Rounded, so that the last bit of a sine can't change which edges collapse.
        np.round(vertices + slide, 6),
        faces.astype(np.int32),
        target_count=2 * count,
        agg=5.0,
    )
    points, triangles = simplified[0].astype(np.float64), simplified[1].astype(np.int64)
    average = _averaging(len(points), triangles)
    for _ in range(4):
        points = average @ points
        nearest = tree.query(points)[1]
        off = np.einsum("nd,nd->n", points - vertices[nearest], normals[nearest])
        points = points - off[:, None] * normals[nearest]
    return points, triangles


def make_shape(
    body: str,
    detail: str,
    *,
    count: int = 8000,
    wavelength: float = 10.0,
    amplitude: float = 0.55,
    triangulation: Triangulation = "regular",
    seed: int = 0,
) -> tuple[FloatArray, IntArray]:
    """Make a closed shape with detail displaced along its normals.

    Parameters
    ----------
    body : str
        Key of `BODIES`.
    detail : str
        Key of `DETAILS`.
    count : int
        Vertices wanted, met within ten per cent.
    wavelength : float
        Period of the pattern in mean edge lengths; rounded so that the pattern closes.
    amplitude : float
        Root mean square of the displacement in mean edge lengths.
    triangulation : {"regular", "irregular"}
        Isotropic remeshing (valence mostly 6) or quadric collapse (valences 4 to 9).
    seed : int
        Seed of what is random in the detail and in the irregular triangulation.

    Returns
    -------
    vertices : (n, 3) float64
        Positions, mean edge length 1.
    faces : (m, 3) int64
        Closed, manifold, oriented outwards.
    """
    rng = np.random.default_rng(seed)
    dense = BODIES[body](count, 1.0 / DENSITY)
    height = DETAILS[detail].height(dense, wavelength, rng)
    average = _averaging(len(dense.vertices), dense.faces)
    for _ in range(4):
        height = average @ height
    height = (height - height.mean()) * dense.fade
    height *= amplitude / max(float(np.sqrt((height**2).mean())), 1e-12) if height.any() else 0.0
    normals = vertex_normals(dense.vertices, dense.faces)
    vertices, faces = dense.vertices + height[:, None] * normals, dense.faces
    if triangulation == "regular":
        vertices, faces = _remeshed(np.round(vertices, 6), faces, 1.015)
    else:
        vertices, faces = _simplified(vertices, faces, count, rng)
    return vertices / mean_edge(vertices, faces), faces
