"""Holes punched where the surface is known, with the size and outline of real ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    face_vectors,
    normalized,
    vertex_normals,
)
from meshlab_lowrank.mesh.topology import Edges, boundary_vertices, edges_of, vertex_adjacency

SHRINKING = 0.8
_LEAST_SIZE = 0.4
_TRIES = 200  # places looked at for each size
_CLEARANCE = 4.0  # least distance to the boundary and to other places, in mean edge lengths
_APART = 2.0  # least distance between two centres of one round, in radii


@dataclass(frozen=True)
class Outline:
    """The shape of a hole, flattened.

    Attributes
    ----------
    points : (k, 2) float64
        About their centre, in mesh units.
    """

    points: FloatArray

    @classmethod
    def of_loop(cls, points: FloatArray) -> Outline:
        """Flatten a boundary loop (k, 3) onto its mean plane, keeping distances from its centre."""
        centred = points - points.mean(axis=0)
        frame = _frame(np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0))
        flat = centred @ frame[:2].T
        return cls(np.linalg.norm(centred, axis=1, keepdims=True) * normalized(flat))

    @classmethod
    def disc(cls, radius: float) -> Outline:
        """Give a round outline."""
        angle = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
        return cls(radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))

    @property
    def mean_radius(self) -> float:
        """Mean distance from the centre."""
        return float(np.linalg.norm(self.points, axis=1).mean())

    @property
    def radius(self) -> float:
        """Largest distance from the centre."""
        return float(np.linalg.norm(self.points, axis=1).max())

    def scaled(self, factor: float) -> Outline:
        """Give the outline in another size."""
        return Outline(factor * self.points)

    def contains(self, points: FloatArray) -> BoolArray:
        """Mark the points (p, 2) inside the outline, by the parity of crossings."""
        x, y = points[:, :1], points[:, 1:]
        ax, ay = self.points.T
        bx, by = np.roll(self.points, -1, axis=0).T
        spans = (ay > y) != (by > y)
        rise = np.where(by == ay, 1.0, by - ay)
        crossing = spans & (x < ax + (y - ay) * (bx - ax) / rise)
        return np.asarray(crossing.sum(axis=1) % 2 == 1)


@dataclass(frozen=True)
class PunchedHole:
    """A piece that was taken out of a known surface.

    Attributes
    ----------
    centre : (3,) float64
    faces : (k,) int64
        Numbers of the faces taken out.
    size : float
        1 for the size of the real hole; less where that did not fit anywhere.
    """

    centre: FloatArray
    faces: IntArray
    size: float


class Puncher:
    """Finds places for holes on a surface.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    edge_length : float
        Mean edge length.
    seed : int
        Seed of the places and their rotations.
    """

    def __init__(
        self, vertices: FloatArray, faces: IntArray, edge_length: float, seed: int
    ) -> None:
        self._vertices = vertices
        self._faces = faces
        self._edge_length = edge_length
        self._centres = vertices[faces].mean(axis=1)
        self._tree = cKDTree(self._centres)
        self._normals = vertex_normals(vertices, faces)
        self._areas = np.linalg.norm(face_vectors(vertices, faces), axis=1)
        self._neighbours = _face_neighbours(edges_of(faces), len(faces))
        rim = vertices[boundary_vertices(faces, len(vertices))]
        self._rim = cKDTree(rim) if len(rim) else None
        self._random = np.random.default_rng(seed)

    def punch(self, outline: Outline, places: int) -> list[PunchedHole]:
        """Take an outline out at several places.

        The places are spread at random, turned at random, clear of the boundary and of each
        other. Where the outline doesn't fit, it is shrunk to 0.8, 0.64 and so on, down to 0.4.

        Parameters
        ----------
        outline : Outline
        places : int

        Returns
        -------
        list of PunchedHole
            Fewer than `places`, down to none, where there is no room.
        """
        found: list[PunchedHole] = []
        size = 1.0
        while len(found) < places and size >= _LEAST_SIZE:
            for hole in self._candidates(outline.scaled(size), size):
                if self._is_apart(hole, found, outline.radius):
                    found.append(hole)
                if len(found) == places:
                    break
            size *= SHRINKING
        return found

    def _is_apart(self, hole: PunchedHole, others: Sequence[PunchedHole], radius: float) -> bool:
        least = radius + _CLEARANCE * self._edge_length
        gaps = [float(np.linalg.norm(hole.centre - other.centre)) for other in others]
        return min(gaps, default=np.inf) > least

    def _candidates(self, outline: Outline, size: float) -> Iterator[PunchedHole]:
        clearance = outline.radius + _CLEARANCE * self._edge_length
        corners = np.unique(self._faces)
        for vertex in self._random.choice(corners, size=min(_TRIES, len(corners)), replace=False):
            angle = self._random.uniform(0.0, 2.0 * np.pi)
            centre = self._vertices[vertex]
            if self._rim is not None and self._rim.query(centre)[0] < clearance:
                continue
            inside = self._cut(vertex, outline, angle)
            if inside is not None:  # once more, corrected for the relief that it was laid over
                growth = outline.mean_radius / self._mean_radius(inside)
                inside = self._cut(vertex, outline.scaled(growth), angle)
            if inside is not None:
                yield PunchedHole(centre, inside, size)

    def _cut(self, vertex: int, outline: Outline, angle: float) -> IntArray | None:
        """Faces inside an outline laid around a vertex; None if they are no proper disc."""
        centre = self._vertices[vertex]
        reach = 1.2 * outline.radius + 2.0 * self._edge_length
        near = np.array(self._tree.query_ball_point(centre, reach), dtype=np.int64)
        near.sort()
        ids, local = np.unique(self._faces[near], return_inverse=True)
        offsets = self._vertices[ids] - centre
        distances = np.linalg.norm(offsets, axis=1)
        normal = self._normals[ids[distances <= 0.7 * outline.radius]].sum(axis=0)
        if vertex not in ids or not np.any(normal):
            return None
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        flat = normalized(offsets @ (turn @ _frame(normal)[:2]).T) * distances[:, None]
        inside = _connected(
            outline.contains(flat), local.reshape(-1, 3), int(np.searchsorted(ids, vertex))
        )
        removed = inside[local.reshape(-1, 3)].any(axis=1)
        faces = self._without_teeth(near[removed])
        return faces if self._is_disc(faces, outline) else None

    def _without_teeth(self, faces: IntArray) -> IntArray:
        """Take out, too, faces that would hang on by one edge."""
        mask = np.zeros(len(self._faces) + 1, dtype=np.bool_)  # the last for "no neighbour"
        mask[faces] = True
        for _ in range(3):
            around = np.unique(self._neighbours[mask[:-1]])
            hanging = mask[self._neighbours[around]].sum(axis=1) >= 2
            mask[around[(around >= 0) & hanging]] = True
        return np.flatnonzero(mask[:-1])

    def _mean_radius(self, faces: IntArray) -> float:
        edges = edges_of(self._faces[faces])
        rim = self._vertices[np.unique(edges.vertices[edges.face_count == 1])]
        return float(np.linalg.norm(rim - rim.mean(axis=0), axis=1).mean())

    def _is_disc(self, faces: IntArray, outline: Outline) -> bool:
        """Tell whether faces make one disc of about the outline's area, with a simple rim."""
        if len(faces) == 0:
            return False
        edges = edges_of(self._faces[faces])
        vertices = np.unique(edges.vertices)
        rim = edges.vertices[edges.face_count == 1]
        _, uses = np.unique(rim, return_counts=True)
        simple = edges.face_count.max() <= 2 and len(uses) == len(rim) and bool((uses == 2).all())
        euler = len(vertices) - len(edges.vertices) + len(faces)
        share = float(self._areas[faces].sum()) / _area(outline.points)
        return simple and euler == 1 and 0.6 < share < 2.5


def in_rounds(holes: Sequence[PunchedHole], radii: Sequence[float]) -> list[list[int]]:
    """Sort punched holes into rounds, so that those of one round lie well apart.

    Parameters
    ----------
    holes : sequence of PunchedHole
    radii : sequence of float
        Of their outlines, in mesh units.

    Returns
    -------
    list of list of int
        Numbers of the holes of each round.
    """
    rounds: list[list[int]] = []
    for number, (hole, radius) in enumerate(zip(holes, radii, strict=True)):
        for members in rounds:
            gaps = [np.linalg.norm(hole.centre - holes[other].centre) for other in members]
            least = [_APART * (radius + radii[other]) for other in members]
            if all(gap > bound for gap, bound in zip(gaps, least, strict=True)):
                members.append(number)
                break
        else:
            rounds.append([number])
    return rounds


def _face_neighbours(edges: Edges, number: int) -> IntArray:
    """Face across each edge of each face, (m, 3) int64; -1 at boundaries and where not manifold."""
    flat = edges.face_edges.ravel()
    order = np.argsort(flat, kind="stable")
    pairs = np.flatnonzero(flat[order[1:]] == flat[order[:-1]])
    pairs = pairs[edges.face_count[flat[order[pairs]]] == 2]
    across = np.full(3 * number, -1)
    across[order[pairs]] = order[pairs + 1] // 3
    across[order[pairs + 1]] = order[pairs] // 3
    return across.reshape(-1, 3)


def _connected(inside: BoolArray, faces: IntArray, start: int) -> BoolArray:
    """Keep the marked vertices (n,) that edges between marked ones join to a start."""
    adjacency = vertex_adjacency(faces, len(inside))
    chosen = np.flatnonzero(inside)
    _, labels = csgraph.connected_components(adjacency[chosen][:, chosen], directed=False)
    joined = np.zeros_like(inside)
    if inside[start]:
        joined[chosen[labels == labels[np.searchsorted(chosen, start)]]] = True
    return joined


def _frame(normal: FloatArray) -> FloatArray:
    """Rows: two tangents and the unit normal."""
    third = normalized(normal)
    first = normalized(np.cross(third, np.eye(3)[np.abs(third).argmin()]))
    return np.stack([first, np.cross(third, first), third])


def _area(points: FloatArray) -> float:
    x, y = points.T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
