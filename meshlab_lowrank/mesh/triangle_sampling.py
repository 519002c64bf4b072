"""Dense, even samples of a triangle surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, face_vectors, normalized

_PLASTIC = 1.3247179572447460  # root of x^3 = x + 1: the R2 low-discrepancy sequence


@dataclass(frozen=True)
class SurfaceSamples:
    """Points spread over a surface, each standing for the same area.

    Attributes
    ----------
    points : (p, 3) float64
    faces : (p,) int64
        Face that each point lies on.
    barycentric : (p, 3) float64
    """

    points: FloatArray
    faces: IntArray
    barycentric: FloatArray


def sample_surface(
    vertices: FloatArray, faces: IntArray, spacing: float, *, least: int = 1, most: int = 10**6
) -> SurfaceSamples:
    """Spread points evenly over a surface, about `spacing` apart.

    Points are taken at equal steps of the running sum of face areas, and within their faces along
    a low-discrepancy sequence, so the same surface gives the same points.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    spacing : float
        In the units of the vertices.
    least, most : int
        Bounds of the number of points; with no area at all there is none.

    Returns
    -------
    SurfaceSamples

    References
    ----------
    Roberts, The unreasonable effectiveness of quasirandom sequences, 2018.
    """
    areas = np.linalg.norm(face_vectors(vertices, faces), axis=1)
    total = float(areas.sum())
    if total <= 0.0:
        return SurfaceSamples(np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    number = int(np.clip(np.ceil(total / spacing**2), least, most))
    index = np.arange(number)
    steps = (index + 0.5) * (total / number)
    owner = np.searchsorted(np.cumsum(areas), steps).clip(max=len(faces) - 1)
    u = (0.5 + (index + 1) / _PLASTIC) % 1.0
    v = (0.5 + (index + 1) / _PLASTIC**2) % 1.0
    outside = u + v > 1.0
    u[outside], v[outside] = 1.0 - u[outside], 1.0 - v[outside]
    barycentric = np.stack([1.0 - u - v, u, v], axis=1)
    return SurfaceSamples(interpolate(vertices, faces[owner], barycentric), owner, barycentric)


def interpolate(values: FloatArray, faces: IntArray, barycentric: FloatArray) -> FloatArray:
    """Interpolate vertex values (n, d) at barycentric (p, 3) places of faces (p, 3)."""
    return np.asarray(np.einsum("pc,pcd->pd", barycentric, values[faces]))


def interpolate_normals(
    normals: FloatArray, faces: IntArray, barycentric: FloatArray
) -> FloatArray:
    """Interpolate vertex normals (n, 3) and bring them back to unit length, (p, 3)."""
    return normalized(interpolate(normals, faces, barycentric))


def cut_triangles(corners: FloatArray, limit: float) -> tuple[FloatArray, IntArray]:
    """Halve triangles across their longest edge until no edge is longer than a limit.

    Parameters
    ----------
    corners : (t, 3, 3) float64
    limit : float

    Returns
    -------
    corners : (p, 3, 3) float64
        The pieces, in the orientation of their triangles.
    owners : (p,) int64
        The triangle that each piece comes from.
    """
    owners = np.arange(len(corners))
    done_corners, done_owners = [], []
    while len(corners):
        lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        long = lengths.max(axis=1) > limit
        done_corners.append(corners[~long])
        done_owners.append(owners[~long])
        corners, owners, lengths = corners[long], owners[long], lengths[long]
        first = lengths.argmax(axis=1)
        row = np.arange(len(corners))
        a, b, c = (corners[row, (first + i) % 3] for i in range(3))
        middle = 0.5 * (a + b)
        corners = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        owners = np.concatenate([owners, owners])
    return np.concatenate(done_corners), np.concatenate(done_owners)
