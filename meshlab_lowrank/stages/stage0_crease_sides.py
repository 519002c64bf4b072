"""Stage 0: the known surface on either side of creases, and the smooth shape that it has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csgraph

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, face_vectors, normalized
from meshlab_lowrank.stages.stage0_creases import CreaseEnd
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage0_sharp_edges import SharpEdges

_RINGS = 9  # of faces from the rim
_ROUNDS = 4  # of a robust fit
_TOLERANT = 2.5  # times the median miss
_SIMPLER = 1.2  # how much worse a plane may fit than a quadric to be taken, ...
_ROUNDING = 0.002  # ... and by how many edge lengths
_FLAT = 0.1  # root mean square miss of a plane that tells where corners are
_LEAST_POINTS = 12  # for a quadric


def faces_of_arcs(region: Region, edges: SharpEdges, ends: Sequence[CreaseEnd]) -> list[IntArray]:
    """Share out the known faces among the parts of the rim between one crease and the next.

    Parameters
    ----------
    region : Region
        Open.
    edges : SharpEdges
        Of its faces; none is crossed.
    ends : sequence of CreaseEnd
        In the order of the loop.

    Returns
    -------
    list of (f,) int64
        For each crease the faces that lie nearest to the rim from it to the next one.

    Raises
    ------
    StageError
        If creases leave nothing of the rim between them.
    """
    count, m = len(region.loop), len(region.faces)
    tails = {int(vertex): i for i, vertex in enumerate(region.loop)}
    borrowed = {place for end in ends for place in end.borrowed}
    places = np.array([end.place for end in ends])
    arc_of = np.full(m, -1)
    for face, corners in enumerate(region.faces.tolist()):
        for head, tail in zip(corners, corners[1:] + corners[:1], strict=True):
            place = tails.get(tail, -2)
            if tails.get(head, -2) == (place + 1) % count and place >= 0 and place not in borrowed:
                arc_of[face] = (int(np.searchsorted(places, place, side="right")) - 1) % len(ends)
    sources = np.flatnonzero(arc_of >= 0)
    if len(np.unique(arc_of[sources])) < len(ends):
        msg = "Its creases leave no surface between them."
        raise StageError(msg)
    far, _, nearest = csgraph.dijkstra(
        edges.face_graph(edges.sharp, m),
        directed=False,
        indices=sources,
        unweighted=True,
        limit=float(2 * _RINGS),
        min_only=True,
        return_predecessors=True,
    )
    near = np.isfinite(far)
    arc_of[near] = arc_of[nearest[near]]
    return [np.flatnonzero(arc_of == number) for number in range(len(ends))]


@dataclass(frozen=True)
class SideShape:
    """A plane or a quadric over it, which continues the surface on one side of creases.

    Attributes
    ----------
    origin : (3,) float64
    frame : (3, 3) float64
        Two unit vectors in the plane and its normal, as rows.
    factors : (6,) float64
        Height over the plane: of 1, x, y, x x, x y, y y.
    miss : float
        Root mean square distance of the known surface.
    """

    origin: FloatArray
    frame: FloatArray
    factors: FloatArray
    miss: float

    def local(self, points: FloatArray) -> FloatArray:
        """Coordinates (p, 3) in the plane, and above it."""
        return np.asarray((points - self.origin) @ self.frame.T)

    def height(self, flat: FloatArray) -> FloatArray:
        """Height (p,) of the shape at places in the plane (p, 2 or more)."""
        return np.asarray(_powers(flat) @ self.factors)

    def lifted(self, flat: FloatArray, height: FloatArray) -> FloatArray:
        """Points (p, 3) at places in the plane (p, 2) and heights (p,)."""
        return np.asarray(np.column_stack([flat, height]) @ self.frame + self.origin)

    def plane(self) -> FloatArray | None:
        """Give its normal and offset (4,) where it is flat, else None."""
        if self.miss > _FLAT or np.any(self.factors[3:] != 0.0):
            return None
        slope = self.factors[1:3]
        normal = normalized(np.array([-slope[0], -slope[1], 1.0])) @ self.frame
        at = self.lifted(np.zeros((1, 2)), self.factors[:1])[0]
        return np.append(normal, normal @ at)


def shape_of(region: Region, faces: IntArray, curves: FloatArray) -> SideShape:
    """Fit a shape to the known surface on one side of creases.

    Parameters
    ----------
    region : Region
    faces : (f,) int64
        Rows of the known faces on this side.
    curves : (p, 3) float64
        Points of the joined creases that bound it, which count like known vertices.

    Raises
    ------
    StageError
        If the faces have no common direction.
    """
    corners = region.faces[faces]
    upright = face_vectors(region.vertices, corners).sum(axis=0)
    if np.linalg.norm(upright) == 0.0:
        msg = "The surface beside its creases has no direction."
        raise StageError(msg)
    frame = _frame(normalized(upright))
    points = np.concatenate([region.vertices[np.unique(corners)], curves])
    origin = points.mean(axis=0)
    flat = (points - origin) @ frame.T
    plane, miss = _fitted(flat, 3)
    if len(points) >= _LEAST_POINTS:
        quadric, closer = _fitted(flat, 6)
        if miss > _SIMPLER * closer + _ROUNDING:
            return SideShape(origin, frame, quadric, closer)
    return SideShape(origin, frame, np.append(plane, np.zeros(3)), miss)


def _powers(flat: FloatArray) -> FloatArray:
    x, y = flat[:, 0], flat[:, 1]
    return np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y], axis=1)


def _fitted(flat: FloatArray, terms: int) -> tuple[FloatArray, float]:
    """Fit heights by the first powers, robustly; give the factors and the miss."""
    design, height = _powers(flat)[:, :terms], flat[:, 2]
    size = np.maximum(np.abs(design).max(axis=0), 1e-12)
    weight = np.ones(len(flat))
    factors = np.zeros(terms)
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)
        factors = np.linalg.lstsq(design / size * root[:, None], height * root, rcond=1e-9)[0]
        gaps = np.abs(height - design / size @ factors)
        limit = _TOLERANT * float(np.median(gaps)) + 1e-9
        weight = np.minimum(1.0, limit / np.maximum(gaps, limit))
    return factors / size, float(np.sqrt(np.mean(gaps**2)))


def _frame(normal: FloatArray) -> FloatArray:
    """Two unit vectors in a plane and its unit normal, right-handed, as rows (3, 3)."""
    first = normalized(np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))]))
    return np.stack([first, np.cross(normal, first), normal])
