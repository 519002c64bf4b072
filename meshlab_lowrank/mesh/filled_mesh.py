"""Which faces of a filled mesh fill which hole, whatever the filler did to the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.mesh.topology import edges_of

_SAME_PLACE = 1e-6  # of the bounding-box diagonal: single precision and no more
_KEPT = 0.9  # share of the known faces that must be found again


@dataclass(frozen=True)
class FilledMesh:
    """A filled mesh, and where its new faces are.

    Attributes
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        New faces that were put in inside out are turned.
    turned : (m,) bool
        The faces that were.
    loop : (m,) int64
        For each new face the number of the boundary loop that it fills; -1 for known faces.
    kept : bool
        Whether the known surface is still there, face by face. If not, new faces are those whose
        centre lies beyond the boundary of the known surface.
    closed : tuple of bool
        One a boundary loop: there are new faces and no edge of theirs or of the loop is open.
    """

    vertices: FloatArray
    faces: IntArray
    turned: BoolArray
    loop: IntArray
    kept: bool
    closed: tuple[bool, ...]

    def surface(self, loop: int) -> SurfacePart:
        """Give the mesh with the faces that fill a loop as its part."""
        return SurfacePart(self.vertices, self.faces, self.loop == loop)


class KnownSurface:
    """The mesh with holes, prepared for looking up what was added to it.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    loops : sequence of (k,) int64
        Vertices of every boundary loop, in order.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, loops: Sequence[IntArray]) -> None:
        self._vertices = vertices
        self._faces = faces
        self._loops = [np.asarray(loop) for loop in loops]
        self._tree = cKDTree(vertices)
        used = vertices[np.unique(faces)]
        self._tolerance = _SAME_PLACE * float(np.linalg.norm(np.ptp(used, axis=0)))
        self._loop_of = np.full(len(vertices), -1)
        for number, loop in enumerate(self._loops):
            self._loop_of[loop] = number

    def locate(self, vertices: FloatArray, faces: IntArray) -> FilledMesh:
        """Find the new faces of a filled mesh.

        Parameters
        ----------
        vertices : (n', 3) float64
        faces : (m', 3) int64
            In any order, with any numbering.

        Returns
        -------
        FilledMesh
        """
        gap, nearest = self._tree.query(vertices, workers=-1)
        origin = np.where(gap <= self._tolerance, nearest, -1)
        origin[: len(self._vertices)] = self._prefer_own_number(vertices, origin)
        known = _same_faces(origin[faces], self._faces)
        kept = int(known.sum()) >= _KEPT * len(self._faces)
        new = ~known if kept else self._beyond_the_boundary(vertices, faces)
        pieces = _edge_components(faces[new])
        loop = np.full(len(faces), -1)
        if self._loops:
            loop[new] = self._assign(vertices, faces[new], pieces, origin)
        closed = self._closed(faces, loop, origin, kept=kept)
        turned = np.zeros(len(faces), dtype=np.bool_)
        turned[new] = _inside_out(faces, new, pieces)
        righted = np.where(turned[:, None], faces[:, ::-1], faces)
        return FilledMesh(vertices, righted, turned, loop, kept, closed)

    def _prefer_own_number(self, vertices: FloatArray, origin: IntArray) -> IntArray:
        """Vertices that coincide with others keep their own number where they kept their place."""
        n = min(len(vertices), len(self._vertices))
        still = np.linalg.norm(vertices[:n] - self._vertices[:n], axis=1) <= self._tolerance
        own = origin[: len(self._vertices)].copy()
        own[:n][still] = np.flatnonzero(still)
        return own

    def _beyond_the_boundary(self, vertices: FloatArray, faces: IntArray) -> BoolArray:
        closest = TriangleIndex(self._vertices, self._faces).closest(vertices[faces].mean(axis=1))
        edges = edges_of(self._faces)
        open_edges = edges.face_count[edges.face_edges[closest.faces]] == 1  # (m', 3)
        opposite = np.roll(closest.barycentric, 1, axis=1)  # of edge i: corner i + 2
        return np.asarray((open_edges & (opposite <= 1e-9)).any(axis=1))

    def _assign(
        self, vertices: FloatArray, new_faces: IntArray, pieces: IntArray, origin: IntArray
    ) -> IntArray:
        """Give each new face the number of a loop: its piece's only loop, or else the nearest."""
        rim = np.concatenate(self._loops)
        _, nearest = cKDTree(self._vertices[rim]).query(vertices[new_faces].mean(axis=1))
        by_distance = self._loop_of[rim][nearest]
        touched = np.where(origin[new_faces] >= 0, self._loop_of[origin[new_faces]], -1)
        loop = by_distance.copy()
        for piece in np.unique(pieces):
            inside = pieces == piece
            candidates = np.unique(touched[inside])
            candidates = candidates[candidates >= 0]
            if len(candidates) == 1:
                loop[inside] = candidates[0]
            elif len(candidates) == 0:
                loop[inside] = np.bincount(by_distance[inside]).argmax()
        return loop

    def _closed(
        self, faces: IntArray, loop: IntArray, origin: IntArray, *, kept: bool
    ) -> tuple[bool, ...]:
        edges = edges_of(faces)
        open_faces = (edges.face_count[edges.face_edges] == 1).any(axis=1)
        open_ends = np.sort(origin[edges.vertices[edges.face_count == 1]], axis=1)
        still_open = {tuple(ends) for ends in open_ends.tolist()}
        states = []
        for number, rim in enumerate(self._loops):
            own = loop == number
            sides = np.sort(np.stack([rim, np.roll(rim, -1)], axis=1), axis=1).tolist()
            rim_open = kept and any(tuple(side) in still_open for side in sides)
            states.append(bool(own.any()) and not (open_faces & own).any() and not rim_open)
        return tuple(states)


def _same_faces(faces: IntArray, others: IntArray) -> BoolArray:
    """Mark the faces that are among others: same corners, same orientation."""
    both = np.concatenate([others, faces])
    row, first = np.arange(len(both)), both.argmin(axis=1)
    turned = np.stack([both[row, (first + i) % 3] for i in range(3)], axis=1)
    _, label = np.unique(turned, axis=0, return_inverse=True)
    label = label.ravel()
    return np.isin(label[len(others) :], label[: len(others)])


def _inside_out(faces: IntArray, new: BoolArray, pieces: IntArray) -> BoolArray:
    """Mark new faces whose piece mostly runs along the rim as the known faces do, not against."""
    edges = edges_of(faces)
    forward = faces < np.roll(faces, -1, axis=1)  # (m, 3), of each face's edge
    sides = np.where(forward, 1, -1)
    known = np.zeros(len(edges.vertices), dtype=np.int64)
    np.add.at(known, edges.face_edges[~new], sides[~new])
    known[edges.face_count != 2] = 0
    agreement = (sides[new] * known[edges.face_edges[new]]).clip(-1, 1)
    inner = np.zeros(len(edges.vertices), dtype=np.int64)
    np.add.at(inner, edges.face_edges[new], 1)
    agreement[inner[edges.face_edges[new]] != 1] = 0
    votes = np.bincount(pieces, weights=agreement.sum(axis=1))
    return np.asarray(votes[pieces] > 0)


def _edge_components(faces: IntArray) -> IntArray:
    """Label of the piece that each face belongs to, joined across edges, (m,) int64."""
    edges = edges_of(faces)
    m = len(faces)
    incidence = sparse.coo_array(
        (np.ones(3 * m), (np.repeat(np.arange(m), 3), edges.face_edges.ravel())),
        shape=(m, len(edges.vertices)),
    ).tocsr()
    _, labels = csgraph.connected_components(incidence @ incidence.T, directed=False)
    return np.asarray(labels, dtype=np.int64)
