"""Stage 0: the boundary loops of a mesh, and which of them are outer rims."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from meshlab_lowrank.mesh.geometry import (
    FloatArray,
    IntArray,
    corner_angles,
    corner_sum,
    face_vectors,
)
from meshlab_lowrank.mesh.topology import border_of, vertex_components
from meshlab_lowrank.mesh.validation import check_manifold, check_mesh

_RIM = 0.8 * np.pi  # a hemisphere has pi, a closed box without its lid 0.4 pi
_FAR_POINTS = 1000
_SINGLE_FACE = "A single face has nothing to fill."


@dataclass(frozen=True, kw_only=True)
class BoundaryLoop:
    """One closed chain of edges that have a face on one side only.

    Attributes
    ----------
    id : int
        Place in the hole table.
    vertices : (k,) int64
        Each vertex once, in the order of a face that fills the hole (such a face runs from
        vertices[i] to vertices[i + 1]); the smallest index first.
    faces : (k,) int64
        The face at the edge from vertices[i] to vertices[i + 1].
    perimeter : float
        Length, in the units of the mesh.
    diameter : float
        Largest distance between two of its vertices (within a thousandth of the perimeter for
        loops of more than 1000 edges).
    area : float
        Area of the loop seen along its mean normal: that of a flat fill.
    planarity : float
        Root mean square distance of the vertices from their best plane, over the diameter.
    turning : float
        Sum over the vertices of pi minus the angle of the surface there: -2 pi for a hole in a
        plane, 0 for the end of a cylinder, 2 pi for the rim of a flat sheet.
    component : int
        Number of the connected component, the components ordered by their smallest vertex.
    is_rim : bool
        Whether it is the outer rim of an open sheet, which is left open unless asked otherwise.
    pinched : bool
        Whether other parts of the boundary meet one of its vertices.
    reason : str
        Why it can't be filled; empty if it can.
    """

    id: int
    vertices: IntArray
    faces: IntArray
    perimeter: float
    diameter: float
    area: float
    planarity: float
    turning: float
    component: int
    is_rim: bool
    pinched: bool
    reason: str


def boundary_loops(vertices: FloatArray, faces: IntArray) -> tuple[BoundaryLoop, ...]:
    """Find every boundary loop once.

    Half-edges are walked around the fan of faces at each vertex, so a vertex where two sheets
    touch keeps their rims apart; a chain that meets a vertex twice is split there into loops
    without repetition. Time is linear in the mesh but for one sort.

    A loop is an outer rim if (2 pi + turning) times its flat area is at least 0.8 pi times the
    area of its component. By the theorem of Gauss and Bonnet the first factor is the total
    curvature of the piece that is missing, however jagged its outline: about 0 for a hole in a
    sheet, 2 pi for the end of a cylinder and for half a sphere, 4 pi for the rim of a flat sheet.
    A statue's open base or the end of a tube, small beside the rest, thus counts as a hole.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64

    Returns
    -------
    tuple of BoundaryLoop
        Longest first (in edges); equally long ones by their smallest vertex index.

    Raises
    ------
    InvalidMeshError
        If an edge has more than two faces or two neighbouring faces are oriented against one
        another.
    """
    border = border_of(faces, len(vertices))
    check_manifold(border)
    if len(border.half_edges) == 0:
        return ()
    chains = _Chains(vertices, faces, border.half_edges)
    labels = _face_components(chains.faces)
    areas = np.bincount(labels, weights=np.linalg.norm(face_vectors(vertices, faces), axis=1))
    component = np.cumsum(np.bincount(labels) > 0) - 1  # vertices without faces don't count
    loops = []
    for i, loop in enumerate(chains.loops()):
        points = vertices[loop.vertices]
        area = _flat_area(points)
        diameter = _diameter(points)
        label = labels[loop.faces[0]]
        is_rim = (2.0 * np.pi + loop.turning) * area >= _RIM * areas[label]
        loops.append(
            BoundaryLoop(
                id=i,
                vertices=loop.vertices,
                faces=loop.faces,
                perimeter=float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum()),
                diameter=diameter,
                area=area,
                planarity=_planarity(points, diameter),
                turning=loop.turning,
                component=int(component[label]),
                is_rim=bool(is_rim),
                pinched=bool(chains.pinched[loop.vertices].any()),
                reason=_SINGLE_FACE if np.all(loop.faces == loop.faces[0]) else "",
            )
        )
    return tuple(loops)


def measure_holes(vertices: ArrayLike, faces: ArrayLike) -> dict[str, list[Any]]:
    """Tabulate the boundary loops of a mesh.

    Parameters
    ----------
    vertices : (n, 3) array
    faces : (m, 3) array of int

    Returns
    -------
    dict
        One list a column, one entry a boundary loop, in the order of `boundary_loops`: "id",
        "boundary_edges", "perimeter", "diameter", "area", "planarity", "component", "is_rim",
        "is_pinched", "fillable", "reason". See `BoundaryLoop` for their meaning and units.

    Raises
    ------
    InvalidMeshError
        If `check_mesh` refuses the mesh.
    """
    loops = boundary_loops(*check_mesh(vertices, faces))
    return {
        "id": [loop.id for loop in loops],
        "boundary_edges": [len(loop.vertices) for loop in loops],
        "perimeter": [loop.perimeter for loop in loops],
        "diameter": [loop.diameter for loop in loops],
        "area": [loop.area for loop in loops],
        "planarity": [loop.planarity for loop in loops],
        "component": [loop.component for loop in loops],
        "is_rim": [loop.is_rim for loop in loops],
        "is_pinched": [loop.pinched for loop in loops],
        "fillable": [not loop.reason for loop in loops],
        "reason": [loop.reason for loop in loops],
    }


class _Step(NamedTuple):
    """A half-edge on a path, and how its head is passed.

    Where a path meets a vertex again, the surface between the two fans is missing; both loops
    that are split there take half of the gap.
    """

    edge: int
    entered: float  # angle of the fan at which the head is entered
    left: float  # angle of the fan from which the head is left
    turning: float  # pi minus the angle of the surface at the head


@dataclass(frozen=True)
class _Loop:
    """A loop in the order of its hole, its faces, and its turning."""

    vertices: IntArray
    faces: IntArray
    turning: float


class _Chains:
    """The boundary half-edges of a mesh, walked with the surface on the left.

    Attributes
    ----------
    half_edges, tails, heads : (b,) int64
        Half-edge 3 f + i of face f, and the vertices it joins.
    following : (b,) int64
        Place of the half-edge that comes next around the fan of faces at the head.
    angles : (b,) float64
        Angle of that fan.
    pinched : (n,) bool
        Vertices with more than one fan.
    faces : (m, 3) int64
        The faces with a vertex of its own, from n on, for each fan at a pinched vertex.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, half_edges: IntArray) -> None:
        n = len(vertices)
        self.half_edges = half_edges
        self.tails = faces.ravel()[half_edges]
        self.heads = np.roll(faces, -1, axis=1).ravel()[half_edges]
        self.pinched = np.bincount(self.tails, minlength=n) > 1
        leaving = np.full(n, -1, dtype=np.int64)
        leaving[self.tails] = np.arange(len(half_edges))
        near = faces[np.any(leaving[faces] >= 0, axis=1)]
        fans = corner_sum(near, corner_angles(vertices, near).ravel(), n)
        self.following = leaving[self.heads]
        self.angles = fans[self.heads]
        self.faces = faces.copy()
        self._walk_fans(vertices)

    def _walk_fans(self, vertices: FloatArray) -> None:
        """Correct what follows, and the angle, where the head has more than one fan."""
        around = np.flatnonzero(np.any(self.pinched[self.faces], axis=1))
        faces = self.faces[around]
        angles = corner_angles(vertices, faces)
        turn = {}  # in a face with corners a, b, c: (a, b) to c, the angle at b and where b stands
        for i in range(3):
            a, b, c = np.roll(faces, 1 - i, axis=1).T.tolist()
            here = angles[:, i].tolist()
            where = (3 * around + i).tolist()
            turn.update({pair[:2]: pair[2:] for pair in zip(a, b, c, here, where, strict=True)})
        outgoing = np.flatnonzero(self.pinched[self.tails])
        ends = zip(self.tails[outgoing].tolist(), self.heads[outgoing].tolist(), strict=True)
        place = dict(zip(ends, outgoing.tolist(), strict=True))
        for fan, edge in enumerate(np.flatnonzero(self.pinched[self.heads])):
            spoke, hub = int(self.tails[edge]), int(self.heads[edge])
            total = 0.0
            corners = []
            while (hub, spoke) not in place:
                spoke, angle, corner = turn[spoke, hub]
                total += angle
                corners.append(corner)
            self.following[edge] = place[hub, spoke]
            self.angles[edge] = total
            self.faces.ravel()[corners] = len(vertices) + fan

    def loops(self) -> list[_Loop]:
        """Walk every chain and split it where it meets a vertex again; longest loops first."""
        found = []
        seen = [False] * len(self.following)
        following, heads, angles = (
            self.following.tolist(),
            self.heads.tolist(),
            self.angles.tolist(),
        )
        for start in range(len(seen)):
            edge = start
            path: list[_Step] = []
            at: dict[int, int] = {}  # vertex to its place on the path
            while not seen[edge]:
                seen[edge] = True
                vertex, angle = heads[edge], angles[edge]
                i = at.setdefault(vertex, len(path))
                path.append(_Step(edge, angle, angle, np.pi - angle))
                if i < len(path) - 1:
                    first = path[i]
                    inner = path[i + 1 : -1]
                    inner.append(_Step(edge, angle, first.left, -(first.left + angle) / 2))
                    found.append(self._loop(inner))
                    for step in inner[:-1]:
                        del at[heads[step.edge]]
                    del path[i:]
                    turning = -(first.entered + angle) / 2
                    path.append(_Step(first.edge, first.entered, angle, turning))
                edge = following[edge]
            if path:
                found.append(self._loop(path))
        found.sort(key=lambda loop: (-len(loop.vertices), *loop.vertices[:2].tolist()))
        return found

    def _loop(self, path: list[_Step]) -> _Loop:
        """Turn a closed path round, so that it runs as the faces of a fill would."""
        edges = np.array([step.edge for step in reversed(path)])
        vertices = self.heads[edges]
        edges = np.roll(edges, -int(np.argmin(vertices)))
        turning = sum(step.turning for step in path)
        return _Loop(self.heads[edges], self.half_edges[edges] // 3, turning)


def _face_components(faces: IntArray) -> IntArray:
    """Label of the component of each face, (m,)."""
    return vertex_components(faces, int(faces.max()) + 1)[faces[:, 0]]


def _flat_area(points: FloatArray) -> float:
    """Length of the vector area of a polygon (k, 3)."""
    spokes = points - points.mean(axis=0)
    return float(0.5 * np.linalg.norm(np.cross(spokes, np.roll(spokes, -1, axis=0)).sum(axis=0)))


def _diameter(points: FloatArray) -> float:
    """Largest distance between two points (k, 3), one of them among at most 1000."""
    return float(cdist(points[:: 1 + (len(points) - 1) // _FAR_POINTS], points).max())


def _planarity(points: FloatArray, diameter: float) -> float:
    """Root mean square distance of points (k, 3) from their best plane, over their diameter."""
    spokes = (points - points.mean(axis=0)) / (diameter or 1.0)
    least = np.linalg.eigvalsh(spokes.T @ spokes)[0]
    return float(np.sqrt(max(least, 0.0) / len(points)))
