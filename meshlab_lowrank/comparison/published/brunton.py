"""Brunton, Wuhrer, Shu, Bose and Demaine: the rim unfolded into a plane, triangulated, embedded.

Written from the published idea, not the authors' code. The idea leaves the two energies open:

- The rim keeps its lengths in the plane; the sum of squared changes of its turns is least.
- The embedding bends least: of the quadratic bending energy over the edges of the flat
  triangulation, the measured faces at the rim, unfolded into the plane, among them.

References
----------
Brunton et al., Filling holes in triangular meshes by curve unfolding, 2009.
Bergou et al., A quadratic bending model for inextensible surfaces, 2006.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from meshlab_lowrank.comparison.published.holes import closed, rim_normals
from meshlab_lowrank.comparison.published.rim_unfolding import unfolded
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.polygons import triangulated
from meshlab_lowrank.mesh.topology import edges_of, half_edge_pairs
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1a_close_rim import local_lengths

_LEAST_SINE = 0.02  # of the angle in a triangle, below which it would rule the energy


def fill(region: Region) -> Region:
    """Fill the loop of a region.

    Raises
    ------
    StageError
        If the rim can't be unfolded, or not be triangulated in the plane.
    """
    rim = region.vertices[region.loop]
    k = len(rim)
    found = triangulated(
        unfolded(rim, rim_normals(region)), [np.arange(k)], float(local_lengths(region).mean())
    )
    if found is None:
        msg = f"This loop of {k} edges can't be triangulated in the plane that it is unfolded into."
        raise StageError(msg)
    flat, faces = found
    points = embedded(flat, faces, rim, outer_corners(region))
    return closed(region, points[k:], faces)


def embedded(flat: FloatArray, faces: IntArray, rim: FloatArray, outer: FloatArray) -> FloatArray:
    """Give the places (v, 3) in space where a flat triangulation bends least; see `bending_energy`.

    Those of the rim are as given, bit for bit.
    """
    v, k = len(flat), len(rim)
    values = np.concatenate([rim, np.zeros((v - k, 3)), outer])
    held = np.ones(len(values), dtype=np.bool_)
    held[k:v] = False
    energy = bending_energy(flat, faces, rim, outer)
    return minimise_with_fixed(energy, held, values)[:v]


def outer_corners(region: Region) -> FloatArray:
    """Corners (k, 3) of the measured faces opposite the edges of the loop."""
    n, faces = len(region.vertices), region.faces[region.known_faces]
    keys = (faces * n + np.roll(faces, -1, axis=1)).ravel()
    order = np.argsort(keys)
    wanted = np.roll(region.loop, -1) * n + region.loop
    rows, corner = np.divmod(order[np.searchsorted(keys, wanted, sorter=order)], 3)
    return np.asarray(region.vertices[faces[rows, (corner + 2) % 3]])


def bending_energy(
    flat: FloatArray, faces: IntArray, rim: FloatArray, outer: FloatArray
) -> sparse.csr_array:
    """Bending of a flat triangulation and the faces beyond its rim, as a quadratic form.

    Parameters
    ----------
    flat : (v, 2) float64
        The k of the rim first, in order.
    faces : (f, 3) int64
    rim : (k, 3) float64
        The rim in space.
    outer : (k, 3) float64
        The corner beyond each edge of the rim.

    Returns
    -------
    (v + k, v + k) csr_array of float64
        The corners beyond the rim come after the vertices; zero for all affine maps of the plane
        with these corners unfolded into it.
    """
    v, k = len(flat), len(rim)
    plane = np.concatenate([flat, _hinged(flat[:k], rim, outer)])
    after = np.roll(np.arange(k), -1)
    flaps = np.stack([after, np.arange(k), v + np.arange(k)], axis=1)
    together = np.concatenate([faces, flaps])
    pairs = half_edge_pairs(edges_of(together))
    tail, head = together.ravel(), np.roll(together, -1, axis=1).ravel()
    apex = np.roll(together, 1, axis=1).ravel()
    a, b, c, d = tail[pairs[0]], head[pairs[0]], apex[pairs[0]], apex[pairs[1]]
    at_a = _cotangent(plane, a, b, c) + _cotangent(plane, a, b, d)
    at_b = _cotangent(plane, b, a, c) + _cotangent(plane, b, a, d)
    at_c = -_cotangent(plane, a, b, c) - _cotangent(plane, b, a, c)
    at_d = -_cotangent(plane, a, b, d) - _cotangent(plane, b, a, d)
    areas = _area(plane, a, b, c) + _area(plane, a, b, d)
    rows = np.arange(len(a))
    hinge = sparse.csr_array(
        (
            np.concatenate([at_b, at_a, at_c, at_d]),
            (np.tile(rows, 4), np.concatenate([a, b, c, d])),
        ),
        shape=(len(rows), v + k),
    )
    return sparse.csr_array(hinge.T @ sparse.diags_array(3.0 / areas) @ hinge)


def _hinged(flat: FloatArray, rim: FloatArray, outer: FloatArray) -> FloatArray:
    """Places (k, 2) of the corners beyond the rim, as they are hinged about its edges."""
    side = np.roll(rim, -1, axis=0) - rim
    length = np.linalg.norm(side, axis=1, keepdims=True)
    reach = outer - rim
    along = np.einsum("ij,ij->i", reach, side)[:, None] / length
    away = np.sqrt(np.maximum((reach**2).sum(axis=1, keepdims=True) - along**2, 0.0))
    ahead = (np.roll(flat, -1, axis=0) - flat) / length
    right = np.stack([ahead[:, 1], -ahead[:, 0]], axis=1)
    return np.asarray(flat + along * ahead + away * right)


def _cotangent(plane: FloatArray, at: IntArray, one: IntArray, other: IntArray) -> FloatArray:
    u, w = plane[one] - plane[at], plane[other] - plane[at]
    dot = (u * w).sum(axis=1)
    size = np.linalg.norm(u, axis=1) * np.linalg.norm(w, axis=1)
    sine = np.abs(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])
    return np.asarray(dot / np.maximum(sine, _LEAST_SINE * size))


def _area(plane: FloatArray, a: IntArray, b: IntArray, c: IntArray) -> FloatArray:
    u, w = plane[b] - plane[a], plane[c] - plane[a]
    size = np.linalg.norm(u, axis=1) * np.linalg.norm(w, axis=1)
    sine = np.abs(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])
    return np.asarray(0.5 * np.maximum(sine, _LEAST_SINE * size))
