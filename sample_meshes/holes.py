"""Discs cut out of a mesh, with what was cut out as the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.sparse.linalg import splu

from .bodies import FloatArray, IntArray
from .triangles import edges_of, mean_edge

Outline = Literal["round", "irregular"]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Punched:
    """A mesh with discs removed, and what was removed.

    Attributes
    ----------
    vertices : (n', 3) float64
    faces : (m', 3) int64
        The mesh with the holes, without unused vertices; order kept.
    vertex_ids : (n',) int64
        Index of each vertex in the whole mesh.
    removed_faces : (r,) int64
        Rows of the whole mesh's faces that were removed.
    """

    vertices: FloatArray
    faces: IntArray
    vertex_ids: IntArray
    removed_faces: IntArray


def _cotangent_laplacian(vertices: FloatArray, faces: IntArray) -> tuple[csr_array, FloatArray]:
    """Positive semidefinite cotangent Laplacian (n, n) and vertex areas (n,)."""
    count = len(vertices)
    rows, columns, weights = [], [], []
    double = np.zeros(len(faces))
    for i in range(3):
        j, k = faces[:, (i + 1) % 3], faces[:, (i + 2) % 3]
        u, w = vertices[j] - vertices[faces[:, i]], vertices[k] - vertices[faces[:, i]]
        double = np.linalg.norm(np.cross(u, w), axis=1)
        rows.append(j)
        columns.append(k)
        weights.append(np.einsum("md,md->m", u, w) / np.maximum(double, 1e-12) / 2)
    half = csr_array(
        (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), (count, count)
    )
    both = half + half.T
    areas = np.bincount(faces.ravel(), weights=np.repeat(double / 6, 3), minlength=count)
    return csr_array(diags_array(both.sum(axis=1)) - both), areas.astype(np.float64)


def geodesic_distance(vertices: FloatArray, faces: IntArray, source: int) -> FloatArray:
    """Distance from a vertex along the surface by the heat method, (n,).

    Crane, Weischedel and Wardetzky, "Geodesics in heat", ACM Transactions on Graphics 32 (2013).
    """
    stiffness, areas = _cotangent_laplacian(vertices, faces)
    time = 4.0 * mean_edge(vertices, faces) ** 2
    start = np.zeros(len(vertices))
    start[source] = 1.0
    heat = splu((diags_array(areas) + time * stiffness).tocsc()).solve(start)
    corners = [vertices[faces[:, i]] for i in range(3)]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    double = np.linalg.norm(normal, axis=1)[:, None]
    opposite = [corners[(i + 2) % 3] - corners[(i + 1) % 3] for i in range(3)]
    gradient = sum(
        heat[faces[:, i], None] * np.cross(normal / double, opposite[i]) for i in range(3)
    )
    gradient = -gradient / np.maximum(np.linalg.norm(gradient, axis=1), 1e-300)[:, None]
    divergence = np.zeros(len(vertices))
    for i in range(3):
        flux = np.einsum("md,md->m", gradient, np.cross(normal / double, opposite[i])) / 2
        divergence += np.bincount(faces[:, i], weights=flux, minlength=len(vertices))
    # The Laplacian is singular on closed meshes; a tiny mass fixes the free constant.
    distance = splu((stiffness + 1e-9 * diags_array(areas)).tocsc()).solve(divergence)
    return np.asarray(distance - distance[source])


def disc(
    vertices: FloatArray,
    faces: IntArray,
    place: int | FloatArray,
    radius: float,
    *,
    outline: Outline = "round",
    seed: int = 0,
) -> BoolArray:
    """Faces of a geodesic disc, bounded by one simple loop.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    place : int or (3,) float64
        Centre vertex, or a point whose nearest vertex is the centre.
    radius : float
        Mean radius in mean edge lengths of the mesh.
    outline : {"round", "irregular"}
        Irregular: the radius swings smoothly with the angle by 30 per cent either way.
    seed : int
        Seed of the irregular outline.

    Returns
    -------
    (m,) bool
        The faces of the disc.

    Raises
    ------
    ValueError
        When the disc meets itself or its complement falls apart.
    """
    reach = radius * mean_edge(vertices, faces)
    if isinstance(place, (int, np.integer)):
        centre = int(place)
    else:
        centre = int(np.linalg.norm(vertices - place, axis=1).argmin())
    a, b = edges_of(faces).T
    lengths = np.linalg.norm(vertices[a] - vertices[b], axis=1)
    graph = csr_array((lengths, (a, b)), (len(vertices), len(vertices)))
    near = np.isfinite(dijkstra(graph, directed=False, indices=np.array(centre), limit=2.5 * reach))
    local_faces = np.flatnonzero(near[faces].all(axis=1))
    ids, local = np.unique(faces[local_faces], return_inverse=True)
    local = local.reshape(-1, 3)
    points = vertices[ids]
    source = int(np.searchsorted(ids, centre))
    distance = geodesic_distance(points, local, source)
    if outline == "irregular":
        around = distance < reach
        frame = np.linalg.svd(points[around] - points[source], full_matrices=False)[2]
        x, y = ((points - points[source]) @ frame[:2].T).T
        angle = np.arctan2(y, x)
        rng = np.random.default_rng(seed)
        weights = rng.normal(size=(2, 4)) / np.sqrt(np.arange(1, 5))

        def swing(t: FloatArray) -> FloatArray:
            turns = np.arange(1, 5) * t[:, None]
            return np.asarray(np.cos(turns) @ weights[0] + np.sin(turns) @ weights[1])

        whole = swing(np.linspace(0, 2 * np.pi, 361))
        middle, spread = (whole.max() + whole.min()) / 2, (whole.max() - whole.min()) / 2
        distance = distance / (1 + 0.3 * (swing(angle) - middle) / spread)
    inside = np.zeros(len(faces), dtype=np.bool_)
    # All faces round the inner vertices: that reaches half an edge further and leaves no teeth.
    inside[local_faces] = (distance[local] < reach * (1 - 0.5 / radius)).any(axis=1)
    return _simple_disc(faces, inside, centre)


def _dual_part(faces: IntArray, mask: BoolArray, count: int) -> IntArray:
    """Edge-connected component number of each masked face, -1 elsewhere."""
    rows = np.flatnonzero(mask)
    sides = np.sort(faces[rows][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    key = sides[:, 0] * count + sides[:, 1]
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    i, j = order[:-1][same] // 3, order[1:][same] // 3
    graph = coo_array((np.ones(len(i)), (i, j)), (len(rows), len(rows)))
    label = np.full(len(faces), -1, dtype=np.int64)
    label[rows] = connected_components(graph, directed=False)[1]
    return label


def _simple_disc(faces: IntArray, inside: BoolArray, centre: int) -> BoolArray:
    """Grow the faces round a vertex until one simple loop bounds them."""
    count = int(faces.max()) + 1
    for _ in range(20):
        label = _dual_part(faces, inside, count)
        middle = (faces == centre).any(axis=1) & inside
        inside = inside & (label == label[middle][0])
        if inside.all():
            break
        rest = _dual_part(faces, ~inside, count)
        inside = inside | (rest != np.bincount(rest[rest >= 0]).argmax())
        inside = inside | _teeth(faces, inside)
        loop = boundary_edges(faces[inside])
        # A vertex with more than one outgoing boundary edge pinches the loop: take all round it.
        pinched = np.flatnonzero(np.bincount(loop[:, 0], minlength=count) > 1)
        if len(pinched) == 0:
            used = len(np.unique(faces[inside]))
            if used - len(edges_of(faces[inside])) + int(inside.sum()) != 1:
                break
            return inside
        inside = inside | np.isin(faces, pinched).any(axis=1)
    msg = f"the disc round vertex {centre} has no simple outline; choose a smaller radius"
    raise ValueError(msg)


def _teeth(faces: IntArray, inside: BoolArray) -> BoolArray:
    """Faces outside that share two edges or more with those inside."""
    count = int(faces.max()) + 1
    kept = np.flatnonzero(~inside)
    a, b = boundary_edges(faces[inside]).T
    directed = faces[kept][:, [[1, 0], [2, 1], [0, 2]]]
    shared = np.isin(directed[..., 0] * count + directed[..., 1], a * count + b).sum(axis=1)
    teeth = np.zeros(len(faces), dtype=np.bool_)
    teeth[kept[shared >= 2]] = True
    return teeth


def boundary_edges(faces: IntArray) -> IntArray:
    """Directed edges (k, 2) whose opposite is used by no face."""
    directed = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    count = int(faces.max()) + 1
    key, opposite = directed @ [count, 1], directed @ [1, count]
    return directed[~np.isin(key, opposite)]


def remove_faces(vertices: FloatArray, faces: IntArray, mask: BoolArray) -> Punched:
    """Remove the masked faces and the vertices that only they use."""
    kept = faces[~mask]
    ids = np.unique(kept)
    index = np.full(len(vertices), -1, dtype=np.int64)
    index[ids] = np.arange(len(ids))
    return Punched(vertices[ids], index[kept], ids, np.flatnonzero(mask))


def punch(
    vertices: FloatArray,
    faces: IntArray,
    place: int | FloatArray,
    radius: float,
    *,
    outline: Outline = "round",
    seed: int = 0,
) -> Punched:
    """Cut one disc out of a mesh; arguments as for `disc`."""
    return remove_faces(
        vertices, faces, disc(vertices, faces, place, radius, outline=outline, seed=seed)
    )
