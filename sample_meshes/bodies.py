"""Smooth closed bodies, sampled densely, with the coordinates that a pattern is laid out in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

HEXAGON = np.sqrt(3.0) / 2.0
"""Area per vertex of the regular triangulation with edge length 1."""


@dataclass(frozen=True)
class Body:
    """A smooth closed surface in units of the final mean edge length.

    Attributes
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        Oriented outwards.
    chart : (n, 2) float64 or None
        Arc-length coordinates along and around a tube; None on bodies without such a chart.
    periods : (float, float)
        Periods of the chart, 0 where it does not close.
    fade : (n,) float64
        Factor on the detail, below 1 where the chart shrinks to a pole.
    """

    vertices: FloatArray
    faces: IntArray
    chart: FloatArray | None = None
    periods: tuple[float, float] = (0.0, 0.0)
    fade: FloatArray = field(default_factory=lambda: np.ones(1))


def _grid_faces(rows: int, columns: int, *, close_rows: bool) -> IntArray:
    """Triangles of a grid that closes along its columns and, if asked, along its rows."""
    i, j = np.meshgrid(
        np.arange(rows if close_rows else rows - 1), np.arange(columns), indexing="ij"
    )
    odd_row = (i % 2).reshape(-1, 1) == 1
    up, right = (i + 1) % rows, (j + 1) % columns
    a, b = i * columns + j, i * columns + right
    c, d = up * columns + j, up * columns + right
    # Every second row is shifted by half a cell, so the diagonal alternates.
    even = np.stack([a, c, b, b, c, d], axis=-1).reshape(-1, 6)
    odd = np.stack([a, c, d, a, d, b], axis=-1).reshape(-1, 6)
    return np.where(odd_row, odd, even).reshape(-1, 3).astype(np.int64)


def _ring(
    curve: Callable[[FloatArray], FloatArray],
    tube_radius: Callable[[FloatArray], FloatArray],
    spacing: float,
) -> Body:
    """Sweep a circle along a closed curve, with a frame that closes without a twist."""
    fine = np.linspace(0.0, 1.0, 4001)
    points = curve(fine)
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    length = float(arc[-1])
    radius = float(tube_radius(fine).mean())
    rows = 2 * round(length / spacing / HEXAGON / 2)
    columns = round(2 * np.pi * radius / spacing)
    t = np.interp(np.arange(rows) / rows * length, arc, fine)
    centre = curve(t)
    tangent = curve(t + 1e-5) - curve(t - 1e-5)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    inward = np.cross([0.0, 0.0, 1.0], tangent)
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    up = np.cross(tangent, inward)
    angle = 2 * np.pi * (np.arange(columns)[None] + 0.5 * (np.arange(rows)[:, None] % 2)) / columns
    r = tube_radius(t)[:, None, None]
    around = np.cos(angle)[..., None] * inward[:, None] + np.sin(angle)[..., None] * up[:, None]
    chart = np.stack(
        [np.broadcast_to((np.arange(rows) / rows * length)[:, None], angle.shape), angle * radius],
        axis=-1,
    )
    return Body(
        vertices=(centre[:, None] + r * around).reshape(-1, 3),
        faces=_grid_faces(rows, columns, close_rows=True)[:, ::-1].copy(),
        chart=chart.reshape(-1, 2),
        periods=(length, 2 * np.pi * radius),
        fade=np.ones(rows * columns),
    )


def torus(count: int, spacing: float, ratio: float = 2.5) -> Body:
    """Torus whose area holds `count` vertices at edge length 1; `ratio` is R / r."""
    r = np.sqrt(HEXAGON * count / (4 * np.pi**2 * ratio))

    def curve(t: FloatArray) -> FloatArray:
        angle = 2 * np.pi * t
        circle = np.stack([np.cos(angle), np.sin(angle), 0 * t], axis=1)
        return np.asarray(ratio * r * circle)

    return _ring(curve, lambda t: np.full_like(t, r), spacing)


def ring(count: int, spacing: float, ratio: float = 2.6) -> Body:
    """A warped ring: the centre line leaves its plane and the tube swells and thins."""
    r = np.sqrt(HEXAGON * count / (4 * np.pi**2 * ratio * 1.1))

    def curve(t: FloatArray) -> FloatArray:
        angle = 2 * np.pi * t
        wide = 1 + 0.15 * np.cos(2 * angle)
        x, y, z = wide * np.cos(angle), wide * np.sin(angle), 0.3 * np.sin(2 * angle)
        return np.asarray(ratio * r * np.stack([x, y, z], axis=1))

    return _ring(curve, lambda t: r * (1 + 0.15 * np.sin(6 * np.pi * t)), spacing)


def capsule(count: int, spacing: float, ratio: float = 4.0, bend: float = 1.2) -> Body:
    """Cylinder of length `ratio` radii with round caps, bent by `bend` radians."""
    r = np.sqrt(HEXAGON * count / (2 * np.pi * ratio + 4 * np.pi))
    length = ratio * r
    total = length + np.pi * r
    rows = 2 * round(total / spacing / HEXAGON / 2) + 1
    columns = round(2 * np.pi * r / spacing)
    s = np.linspace(0.0, total, rows + 2)[1:-1]
    cap = np.pi * r / 2
    start, end = np.minimum(s / r, np.pi / 2), np.minimum((total - s) / r, np.pi / 2)
    rho = r * np.sin(np.minimum(start, end))
    z = np.where(s < cap, -r * np.cos(start), np.clip(s - cap, 0, length))
    z = np.where(s > total - cap, length + r * np.cos(end), z) - length / 2
    angle = 2 * np.pi * (np.arange(columns)[None] + 0.5 * (np.arange(rows)[:, None] % 2)) / columns
    x, y = rho[:, None] * np.cos(angle), rho[:, None] * np.sin(angle)
    poles = np.array([[0, 0, -length / 2 - r], [0, 0, length / 2 + r]])
    straight = np.concatenate(
        [np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=-1).reshape(-1, 3), poles]
    )
    # Bend the axis into an arc of the same length; the caps follow their end's tangent.
    arc = length / bend
    theta = np.clip(straight[:, 2], -length / 2, length / 2) / arc
    over = straight[:, 2] - theta * arc
    out = arc - straight[:, 0]
    vertices = np.stack(
        [
            arc - out * np.cos(theta) + over * np.sin(theta),
            straight[:, 1],
            out * np.sin(theta) + over * np.cos(theta),
        ],
        axis=1,
    )
    first, last = rows * columns, rows * columns + 1
    j = np.arange(columns)
    k = (j + 1) % columns
    top = (rows - 1) * columns
    faces = np.concatenate(
        [
            _grid_faces(rows, columns, close_rows=False)[:, ::-1],
            np.stack([k, j, np.full_like(j, first)], axis=1),
            np.stack([top + j, top + k, np.full_like(j, last)], axis=1),
        ]
    )
    chart = np.stack([np.broadcast_to(s[:, None], angle.shape), angle * r], axis=-1).reshape(-1, 2)
    chart = np.concatenate([chart, [[0.0, 0.0], [total, 0.0]]])
    fade = np.concatenate([np.repeat(np.clip((rho / r - 0.45) / 0.3, 0, 1), columns), [0.0, 0.0]])
    fade = fade**2 * (3 - 2 * fade)
    return Body(vertices, faces.astype(np.int64), chart, (0.0, 2 * np.pi * r), fade)


def _icosphere(frequency: int) -> tuple[FloatArray, IntArray]:
    """Icosahedron with every edge cut into `frequency` parts, pushed out to the unit sphere."""
    golden = (1 + np.sqrt(5.0)) / 2
    corners = np.array([[0, s, t * golden] for s in (-1, 1) for t in (-1, 1)], dtype=np.float64)
    corners = np.concatenate([corners, np.roll(corners, 1, axis=1), np.roll(corners, 2, axis=1)])
    gap = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    near = np.abs(gap - 2.0) < 1e-9
    sides = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    steps = [(i, j) for i in range(frequency + 1) for j in range(frequency + 1 - i)]
    index = {step: number for number, step in enumerate(steps)}
    up = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i, j in steps if i + j < frequency]
    down = [
        (index[i + 1, j], index[i + 1, j + 1], index[i, j + 1])
        for i, j in steps
        if i + j < frequency - 1
    ]
    triangles = np.array(up + down)
    grid = np.array(steps) / frequency
    vertices, faces = [], []
    for number, (i, j, k) in enumerate(sides):
        a, b, c = corners[i], corners[j], corners[k]
        if np.dot(np.cross(b - a, c - a), a) < 0:
            b, c = c, b
        vertices.append(a + grid[:, :1] * (b - a) + grid[:, 1:] * (c - a))
        faces.append(triangles + number * len(steps))
    points = np.concatenate(vertices)
    _, first, inverse = np.unique(
        np.round(points * 1e7).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    points = points[first]
    points /= np.linalg.norm(points, axis=1)[:, None]
    return points, inverse.reshape(-1)[np.concatenate(faces)].astype(np.int64)


def _star(count: int, spacing: float, shape: Callable[[FloatArray], FloatArray]) -> Body:
    """Image of the unit sphere under `shape`, scaled to the asked area."""
    sphere, faces = _icosphere(max(2, round(np.sqrt(count / spacing**2 / 10))))
    points = shape(sphere)
    a, b, c = (points[faces[:, i]] for i in range(3))
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    return Body(points * np.sqrt(HEXAGON * count / area), faces, fade=np.ones(len(points)))


def sphere(count: int, spacing: float) -> Body:
    """Sphere whose area holds `count` vertices at edge length 1."""
    return _star(count, spacing, lambda x: x)


def ellipsoid(count: int, spacing: float) -> Body:
    """Ellipsoid with axes 1.5 : 1.1 : 0.8."""
    return _star(count, spacing, lambda x: x * np.array([1.5, 1.1, 0.8]))


def blob(count: int, spacing: float) -> Body:
    """Lumpy star-shaped body of varying curvature."""
    rng = np.random.default_rng(7)
    axes = rng.normal(size=(6, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]

    def shape(x: FloatArray) -> FloatArray:
        lumps = np.exp(3.0 * (x @ axes.T - 1.0)) @ np.array([0.5, -0.25, 0.4, -0.2, 0.45, 0.3])
        return np.asarray(x * (1.0 + lumps)[:, None])

    return _star(count, spacing, shape)


BODIES: dict[str, Callable[[int, float], Body]] = {
    "torus": torus,
    "ring": ring,
    "capsule": capsule,
    "sphere": sphere,
    "ellipsoid": ellipsoid,
    "blob": blob,
}
