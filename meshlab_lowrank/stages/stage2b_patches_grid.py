"""Stage 2, patches: samples on a grid in the tangent plane, carried onto the base."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.sampling import spread_points
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2a_frames import Frames, turned
from meshlab_lowrank.stages.stage2a_frames_base import BaseFrames
from meshlab_lowrank.stages.stage2b_patches import REACH, Patches

_OUTSIDE = -0.7  # barycentric coordinate from which a sample counts as off the surface
_LEAF = 32  # points of a surface in a leaf of a tree, with which looking up is fastest
_BLOCK = 50_000  # points that are looked up in one go, for the memory that it takes
_OVERLAP = 4.0  # centres of targets along the radius of a patch


@dataclass(frozen=True)
class HexagonalGrid:
    """Sample points of a patch in its tangent plane.

    Attributes
    ----------
    offsets : (sp, 2) float64
        Points of a hexagonal lattice inside a disc, the centre first, in mean edge lengths.
    turns : (6, sp) int64
        ``offsets[turns[q]]`` is the grid turned by q times 60 degrees: a turn of a patch is a
        permutation of its samples.
    """

    offsets: FloatArray
    turns: IntArray

    @property
    def size(self) -> int:
        """Number of samples, the paper's sp."""
        return len(self.offsets)


def hexagonal_grid(radius: float, spacing: float) -> HexagonalGrid:
    """Fill a disc with a hexagonal lattice of the given spacing (same unit as the radius)."""
    reach = int(radius / spacing * 2.0 / np.sqrt(3.0)) + 1
    first, second = (axis.ravel() for axis in np.mgrid[-reach : reach + 1, -reach : reach + 1])
    points = spacing * np.stack([first + 0.5 * second, 0.5 * np.sqrt(3.0) * second], axis=1)
    squared = first * first + first * second + second * second
    angle = np.round(np.arctan2(points[:, 1], points[:, 0]), 9)
    order = np.lexsort((angle, squared))
    order = order[spacing * np.sqrt(squared[order]) <= radius * (1.0 + 1e-9)]
    lattice = np.stack([first[order], second[order]], axis=1)
    slot = {tuple(point): index for index, point in enumerate(lattice.tolist())}
    turns = []
    for _ in range(6):
        turns.append([slot[tuple(point)] for point in lattice.tolist()])
        lattice = np.stack([-lattice[:, 1], lattice[:, 0] + lattice[:, 1]], axis=1)
    return HexagonalGrid(points[order], np.asarray(turns, dtype=np.int64))


class SurfaceLocator:
    """Finds points near a surface as barycentric combinations of its vertices.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    """

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        n = len(vertices)
        used = np.unique(faces)
        self._used, self._tree = used, cKDTree(vertices[used], leafsize=_LEAF)
        self._centroids = cKDTree(vertices[faces].mean(axis=1), leafsize=_LEAF)
        self._count, self._faces = n, faces
        corners = faces.ravel()
        order = np.argsort(corners, kind="stable")
        valence = np.bincount(corners, minlength=n)
        first = np.cumsum(valence) - valence
        slot = np.arange(len(corners)) - np.repeat(first, valence)
        self._fans = np.full((n, valence.max()), -1, dtype=np.int64)  # faces around each vertex
        self._fans[corners[order], slot] = order // 3
        origins = vertices[faces[:, 0]]
        u = vertices[faces[:, 1]] - origins
        v = vertices[faces[:, 2]] - origins
        uu, uv, vv = (np.einsum("ij,ij->i", a, b) for a, b in ((u, u), (u, v), (v, v)))
        scale = 1.0 / np.maximum(uu * vv - uv * uv, 1e-30)
        second = scale[:, None] * (vv[:, None] * u - uv[:, None] * v)
        third = scale[:, None] * (uu[:, None] * v - uv[:, None] * u)
        # (m, 9): the first corner, and the gradients of the weights of the others
        self._planes = np.concatenate([origins, second, third], axis=1)

    def weights(self, points: FloatArray) -> sparse.csr_array:
        """Barycentric weights of the surface below points.

        Parameters
        ----------
        points : (s, 3) float64

        Returns
        -------
        (s, n) csr_array of float64
            Three weights a row, non-negative, sum 1, of the face that holds the point's
            projection: the one of the nearest centroid or else the best around the nearest
            vertex. All zero for points beyond the surface's border.
        """
        parts = [self._below(points[i : i + _BLOCK]) for i in range(0, max(len(points), 1), _BLOCK)]
        corners, weights = (np.concatenate([part[i].ravel() for part in parts]) for i in range(2))
        starts = np.arange(0, 3 * len(points) + 1, 3)
        return sparse.csr_array((weights, corners, starts), shape=(len(points), self._count))

    def _below(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Give the corners (s, 3) of the faces below points, and their weights (s, 3)."""
        face = np.asarray(self._centroids.query(points)[1], dtype=np.int64)
        coordinates = self._coordinates(points, face)
        least = _least(coordinates)
        missed = np.flatnonzero(least < 0.0)
        nearest = np.asarray(self._tree.query(points[missed])[1], dtype=np.int64)
        least[missed] = -np.inf
        for around in self._fans[self._used[nearest]].T:  # one face of each fan at a time
            exists = around >= 0
            rows, other = missed[exists], around[exists]
            found = self._coordinates(points[rows], other)
            depth = _least(found)
            better = depth > least[rows]
            rows = rows[better]
            face[rows], least[rows] = other[better], depth[better]
            coordinates[:, rows] = found[:, better]
        chosen = np.maximum(coordinates, 0.0)
        chosen *= (least > _OUTSIDE) / chosen.sum(axis=0)
        return self._faces[face], chosen.T

    def _coordinates(self, points: FloatArray, faces: IntArray) -> FloatArray:
        """Barycentric coordinates (3, s) of points (s, 3), each in its face (s,)."""
        plane = self._planes[faces].T
        x, y, z = points.T - plane[:3]
        second, third = (g[0] * x + g[1] * y + g[2] * z for g in (plane[3:6], plane[6:]))
        return np.stack([1.0 - (second + third), second, third])


def _least(coordinates: FloatArray) -> FloatArray:
    """Give the least of three coordinates, (s,)."""
    first, second, third = coordinates
    return np.asarray(np.minimum(np.minimum(first, second), third))


@dataclass(frozen=True)
class GridLayer:
    """Grid patches on the base of one pass; see `PatchLayer`.

    Parameters
    ----------
    hole : Hole
    grid : HexagonalGrid
    radius : float
        Of a patch, in mean edge lengths.
    frames : Frames
    """

    hole: Hole
    grid: HexagonalGrid
    radius: float
    frames: Frames
    locator: SurfaceLocator = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Index the base."""
        locator = SurfaceLocator(self.hole.base, self.hole.faces)
        object.__setattr__(self, "locator", locator)  # the dataclass is frozen

    @property
    def size(self) -> int:
        """Samples per patch."""
        return self.grid.size

    @property
    def distances(self) -> FloatArray:
        """Distance of each sample from the centre, in patch radii."""
        return np.asarray(np.linalg.norm(self.grid.offsets, axis=1) / self.radius)

    @property
    def turns(self) -> IntArray:
        """Turns by 60 degrees."""
        return self.grid.turns

    def at(self, centres: IntArray, angle: float = 0.0) -> Patches:
        """Lay the grid into the tangent plane of each centre and carry it onto the base.

        Parameters
        ----------
        centres : (w,) int64
        angle : float
            Turn of the grid about each normal, in radians.

        Returns
        -------
        Patches
            Empty rows for samples beyond the border.
        """
        frames = turned(self.frames(self.hole, centres, self.size), angle)
        plane = self.grid.offsets @ frames[:, :2]  # (w, sp, 3)
        points = self.hole.base[centres][:, None] + plane
        sampler = self.locator.weights(points.reshape(-1, 3))
        return Patches(centres, frames, sampler, self.size)


@dataclass(frozen=True)
class GridPatches(Stage):
    """Discs of a hexagonal grid, as large as the pattern asks; see `LayPatches`.

    Parameters
    ----------
    extent : float
        Radius of a patch, in wavelengths of the detail.
    across : float
        Samples along the radius of a patch, where they are not nearer than one edge length.
    spacing : float
        Least distance of the centres of the patches that are recovered, in mean edge lengths.
    frames : Frames
    """

    extent: float = 0.6
    across: float = 6.0
    spacing: float = 1.5
    frames: Frames = field(default_factory=BaseFrames)

    @property
    def rings(self) -> int:
        """None beyond what the reach of the region holds."""
        return 0

    def radius(self, hole: Hole) -> float:
        """Radius of a patch, in mean edge lengths."""
        return self.extent * hole.patch_wavelength

    def centres(self, hole: Hole) -> IntArray:
        """Choose evenly spread vertices in and around what is missing."""
        radius = self.radius(hole)
        away = cKDTree(hole.base[~hole.measured]).query(hole.base)[0]
        near = np.flatnonzero(away < REACH * radius)
        spread = spread_points(hole.base[near], max(self.spacing, radius / _OVERLAP))
        return near[spread]

    def layer(self, hole: Hole) -> GridLayer:
        """Lay the grid on the base."""
        radius = self.radius(hole)
        grid = hexagonal_grid(radius, max(1.0, radius / self.across))
        return GridLayer(hole, grid, radius, self.frames)

    def for_trial(self) -> GridPatches:
        """Fewer targets."""
        return replace(self, spacing=2.0)

    def for_depth(self) -> GridPatches:
        """Patches that see a whole repeat on each side."""
        return replace(self, extent=1.0)
