"""Parts with sharp edges, as machines have them: what lies across a hole is known exactly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from .bodies import FloatArray, IntArray
from .holes import BoolArray

_WIDTH = 2.6  # of a part, in radii of its hole, on either side of its middle
_MARGIN = 6.0  # edge lengths that it is wider than that
_APART = 0.62  # of points of a face from its creases, in edge lengths
_JITTER = 0.18


@dataclass(frozen=True)
class Part:
    """A part without its noise, and the hole in it.

    Attributes
    ----------
    name : str
    vertices : (n, 3) float64
        In edge lengths; the middle of the hole is the origin.
    faces : (m, 3) int64
    removed : (m,) bool
    creases : (c, 2) int64
        Edges along its creases.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    removed: BoolArray
    creases: IntArray

    def noisy(self, sigma: float, seed: int = 0) -> FloatArray:
        """Give the vertices with Gaussian noise, in edge lengths."""
        noise = np.random.default_rng(seed).normal(0.0, 1.0, self.vertices.shape)
        return self.vertices + sigma * noise


def _strip(
    corners: FloatArray, half: float, rng: np.random.Generator
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Triangulate the developed faces of a bent strip: width along x from corner to corner.

    Gives points (n, 2), faces and the points on the inner corners.
    """
    count = int(np.ceil(half))
    lines = np.stack(np.meshgrid(corners, np.linspace(-half, half, 2 * count + 1)), -1)
    sides = np.arange(corners[0] + 1.0, corners[-1])
    rows = np.concatenate(
        [np.stack([sides, np.full(len(sides), sign * half)], axis=1) for sign in (-1.0, 1.0)]
    )
    rows = rows[np.abs(rows[:, :1] - corners).min(axis=1) > _APART]
    j, i = np.mgrid[: int(2.0 * half / 0.866) + 1, : int(np.ptp(corners)) + 2]
    grid = np.stack([corners[0] + i + 0.5 * (j % 2), 0.866 * j - half], -1).reshape(-1, 2)
    grid += rng.uniform(-_JITTER, _JITTER, grid.shape)
    keep = np.abs(grid[:, :1] - corners).min(axis=1) > _APART
    keep &= (grid[:, 0] < corners[-1]) & (np.abs(grid[:, 1]) < half - _APART)
    points = np.concatenate([lines.reshape(-1, 2), rows, grid[keep]])
    faces = Delaunay(points).simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces[area < 0] = faces[area < 0][:, ::-1]
    on = np.zeros(len(points), dtype=np.bool_)
    inner = (lines[..., 0] > corners[0]) & (lines[..., 0] < corners[-1])
    on[: lines.shape[0] * lines.shape[1]] = inner.ravel()
    return points, faces[np.abs(area) > 1e-9], on


def _finished(
    name: str, vertices: FloatArray, faces: IntArray, on: BoolArray, radius: float
) -> Part:
    """Cut the hole around the origin."""
    inside = np.linalg.norm(vertices, axis=1) < radius
    removed = inside[faces].any(axis=1)
    count = np.bincount(faces[~removed].ravel(), minlength=len(vertices))
    lost = (count == 1) & (np.linalg.norm(vertices, axis=1) < radius + 2.0)
    removed |= lost[faces].any(axis=1)  # no ears at the rim
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    normals = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    both = edges[on[edges].all(axis=1)]
    sharp = []
    for a, b in both:
        at = np.flatnonzero((faces == a).any(axis=1) & (faces == b).any(axis=1))
        if len(at) == 2 and normals[at[0]] @ normals[at[1]] < np.cos(np.radians(30.0)):
            sharp.append((a, b))
    return Part(name, vertices, faces, removed, np.array(sharp, dtype=np.int64).reshape(-1, 2))


def _bent(
    name: str,
    radius: float,
    steps: list[tuple[float, float]],
    rng: np.random.Generator,
    curve: float = 0.0,
) -> Part:
    """Bend a strip: pairs of a length and the angle, in degrees, by which the next side turns.

    The first and the last length are made as long as the hole needs. The origin lies in the
    middle between the first and the last corner. With a curve, the strip runs around an axis at
    that distance.
    """
    reach = _WIDTH * radius + _MARGIN
    lengths = np.array([length for length, _ in steps])
    lengths[[0, -1]] = reach
    corners = np.concatenate([[0.0], np.cumsum(lengths)])
    angles = np.radians(np.concatenate([[0.0], np.cumsum([turn for _, turn in steps[:-1]])]))
    angles -= 0.5 * angles[-1]
    along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    profile = np.concatenate([np.zeros((1, 2)), np.cumsum(lengths[:, None] * along, axis=0)])
    profile -= 0.5 * (profile[1] + profile[-2])
    points, faces, on = _strip(corners, reach, rng)
    side = np.clip(np.searchsorted(corners, points[:, 0], side="right") - 1, 0, len(lengths) - 1)
    x, z = (profile[side] + (points[:, 0] - corners[side])[:, None] * along[side]).T
    if curve:
        turn = points[:, 1] / curve
        vertices = np.stack([(curve + x) * np.cos(turn) - curve, (curve + x) * np.sin(turn), z], 1)
    else:
        vertices = np.stack([x, points[:, 1], z], axis=1)
    return _finished(name, vertices, faces, on, radius)


def corner(radius: float, angles: tuple[float, float, float], seed: int = 0) -> Part:
    """Where three flat faces meet: angles in degrees between their edges.

    Parameters
    ----------
    radius : float
        Of the hole, in edge lengths.
    angles : tuple of three floats
        Between the first and the second edge, the second and the third, the third and the first.
    seed : int
    """
    a, b, c = np.cos(np.radians(angles))
    gram = np.array([[1.0, a, c], [a, 1.0, b], [c, b, 1.0]])
    edges = np.linalg.cholesky(gram)
    side = int(_WIDTH * radius + _MARGIN)
    rng = np.random.default_rng(seed)
    i, j = (each.ravel() for each in np.mgrid[: side + 1, : side + 1])
    inner = (i > 0) & (j > 0) & (i < side) & (j < side)
    first = np.arange(side)[:, None] * (side + 1) + np.arange(side)
    p = first.ravel()
    q, r = p + side + 1, p + 1
    quads = np.concatenate([np.stack([p, q, r], 1), np.stack([q, q + 1, r], 1)])
    pieces, triangles, ons = [], [], []
    for number in range(3):
        u, v = edges[number], edges[(number + 1) % 3]
        shift = np.where(inner[:, None], rng.uniform(-_JITTER, _JITTER, (len(i), 2)), 0.0)
        pieces.append((i + shift[:, 0])[:, None] * u + (j + shift[:, 1])[:, None] * v)
        triangles.append(quads + number * len(i))
        ons.append((i == 0) | (j == 0))
    points, on = np.concatenate(pieces), np.concatenate(ons)
    _, keep, place = np.unique(
        np.rint(points * 1e6), axis=0, return_index=True, return_inverse=True
    )
    faces = place.ravel()[np.concatenate(triangles)]
    return _finished("corner", points[keep], faces, on[keep], radius)


def cylinder_end(radius: float, bend: float, seed: int = 0) -> Part:
    """Where the side of a cylinder, of a radius of ``bend`` edge lengths, meets its flat end."""
    rng = np.random.default_rng(seed)
    count = round(2.0 * np.pi * bend)
    rings = [np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)]
    height = int(_WIDTH * radius + _MARGIN)
    points = []
    for row in range(height + 1):
        turn = rings[0] + (0.5 * (row % 2) + rng.uniform(-_JITTER, _JITTER, count) * (row > 0)) * (
            2.0 * np.pi / count
        )
        z = -0.866 * row + rng.uniform(-_JITTER, _JITTER, count) * (0 < row < height)
        points.append(np.stack([bend * np.cos(turn), bend * np.sin(turn), z + 0.0 * turn], 1))
    level, around = np.mgrid[:height, :count]
    a, b = level * count + around, level * count + (around + 1) % count
    c, d = a + count, b + count
    even = level % 2 == 0
    up = np.where(even[..., None], np.stack([a, c, b], -1), np.stack([a, c, d], -1))
    down = np.where(even[..., None], np.stack([b, c, d], -1), np.stack([a, d, b], -1))
    side = np.concatenate([up.reshape(-1, 3), down.reshape(-1, 3)])
    rim = points[0]
    row, column = np.mgrid[: int(2.4 * bend) + 2, : int(2.2 * bend) + 2]
    grid = np.stack([column + 0.5 * (row % 2), 0.866 * row], -1).reshape(-1, 2) - 1.05 * bend
    grid += rng.uniform(-_JITTER, _JITTER, grid.shape)
    grid = grid[np.linalg.norm(grid, axis=1) < bend - 0.7]
    flat = np.concatenate([rim[:, :2], grid])
    cap = Delaunay(flat).simplices.astype(np.int64)
    p, q, r = (flat[cap[:, k]] for k in range(3))
    area = (q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0]
    cap[area < 0] = cap[area < 0][:, ::-1]
    cap = cap[np.abs(area) > 1e-9]
    total = count * (height + 1)
    cap = np.where(cap < count, cap, cap - count + total)
    vertices = np.concatenate([*points, np.column_stack([grid, np.zeros(len(grid))])])
    vertices -= [bend, 0.0, 0.0]
    faces = np.concatenate([side, cap])
    on = np.arange(len(vertices)) < count
    return _finished("cylinder's end", vertices, faces, on, radius)


def edge(radius: float, angle: float, seed: int = 0) -> Part:
    """Two flat faces that meet at an edge, at which the surface turns by an angle in degrees."""
    return _bent("edge", radius, [(0.0, -angle), (0.0, 0.0)], np.random.default_rng(seed))


def curved_edge(radius: float, angle: float, bend: float, seed: int = 0) -> Part:
    """Two cones around one axis that meet at an edge ``bend`` edge lengths away from it."""
    steps = [(0.0, -angle), (0.0, 0.0)]
    return _bent("curved edge", radius, steps, np.random.default_rng(seed), curve=bend)


def stairs(radius: float, seed: int = 0) -> Part:
    """Three steps: treads and risers of three fifths of the radius of the hole."""
    step = max(round(0.6 * radius), 2)
    steps = [(0.0, 90.0), (step, -90.0), (step, 90.0), (step, -90.0), (0.0, 0.0)]
    return _bent("stairs", radius, steps, np.random.default_rng(seed))


def groove(radius: float, angle: float = 60.0, seed: int = 0) -> Part:
    """A groove with a flat bottom, whose walls stand at an angle in degrees."""
    wall = max(round(0.6 * radius), 2)
    steps = [(0.0, -angle), (wall, angle), (wall, angle), (wall, -angle), (0.0, 0.0)]
    return _bent("groove", radius, steps, np.random.default_rng(seed))


def chamfer(radius: float, seed: int = 0) -> Part:
    """The edge of a box, with a chamfer that is as wide as the radius of the hole."""
    steps = [(0.0, -45.0), (max(round(radius), 3), -45.0), (0.0, 0.0)]
    return _bent("chamfer", radius, steps, np.random.default_rng(seed))


def distances(part: Part, points: FloatArray) -> FloatArray:
    """Distance of points (p, 3) from the vertices along the creases of a part, (p,)."""
    a, b = part.vertices[part.creases[:, 0]], part.vertices[part.creases[:, 1]]
    steps = np.linspace(0.0, 1.0, 30)[:, None, None]
    return np.asarray(cKDTree((a + steps * (b - a)).reshape(-1, 3)).query(points)[0])


PARTS: dict[str, Callable[[float], Part]] = {
    "edge, 40 degrees": lambda radius: edge(radius, 40.0),
    "edge, 90 degrees": lambda radius: edge(radius, 90.0),
    "edge, 120 degrees": lambda radius: edge(radius, 120.0),
    "curved edge, 70 degrees": lambda radius: curved_edge(radius, 70.0, 3.0 * radius + 10.0),
    "box corner": lambda radius: corner(radius, (90.0, 90.0, 90.0)),
    "blunt corner": lambda radius: corner(radius, (100.0, 80.0, 105.0)),
    "cylinder's end": lambda radius: cylinder_end(radius, 1.5 * radius + 4.0),
    "stairs": stairs,
    "groove": groove,
    "chamfer": chamfer,
}
