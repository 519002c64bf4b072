"""Stage 6, relief: the angles at which faces meet, made those of the surroundings."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, face_normals
from meshlab_lowrank.mesh.topology import edges_of, vertex_adjacency
from meshlab_lowrank.stages.stage6c_relief_field import HeightField

_ROUNDS = 3
_TINY = 1e-12


class Crispness:
    """Scales the shortest waves of heights, those that an average over neighbours takes away.

    Parameters
    ----------
    field : HeightField
    each : (n,) float64, optional
        What the angles at each vertex count for its area; by default all alike.

    Attributes
    ----------
    wanted : (n,) float64
        Mean angle between faces expected around each vertex, in radians: that around the hole.
    """

    def __init__(self, field: HeightField, each: FloatArray | None = None) -> None:
        faces, known = field.hole.faces, field.hole.known_faces
        pairs = _face_pairs(faces)
        outside = pairs[known[pairs].all(axis=1)]
        self._field = field
        self._inside = pairs[~known[pairs].any(axis=1)]
        self.wanted = field.carried_on(_angles(field.hole.positions, faces, outside), each)
        around = vertex_adjacency(faces, len(field.heights)).astype(np.float64)
        degree = np.maximum(np.asarray(around.sum(axis=1)).ravel(), 1.0)
        self._average = sparse.csr_array(sparse.diags_array(1.0 / degree) @ around)

    def ratio(self, heights: FloatArray) -> float:
        """Mean angle at the unknown vertices with these heights (n,), over that expected."""
        unknown = self._field.hole.unknown
        return float(self._there(heights)[unknown].mean() / max(self.wanted[unknown].mean(), _TINY))

    def lack(self, heights: FloatArray, wanted: FloatArray) -> FloatArray:
        """By what factor angles wanted (n,) are larger, from place to place and in the mean."""
        field, faces = self._field, self._field.hole.faces
        positions = field.raised(heights)
        found = _pair_angles(positions, faces, self._inside).mean()
        overall = wanted[faces[self._inside]].mean() / max(found, _TINY)
        return np.asarray(np.sqrt(wanted / np.maximum(self._there(heights), _TINY) * overall))

    def scaled(self, heights: FloatArray, gain: FloatArray) -> FloatArray:
        """Multiply the shortest waves of the unknown heights (n,) by a gain (n,) three times.

        No vertex is let stand out of its neighbours further than any known one does.
        """
        field = self._field
        for _ in range(_ROUNDS):
            heights = self._changed(heights, (gain - 1.0) * self._short(heights))
        limit = np.abs(self._short(field.heights))[field.source].max()
        for _ in range(_ROUNDS):
            short = self._short(heights)
            heights = self._changed(heights, np.clip(short, -limit, limit) - short)
        return heights

    def matched(
        self, heights: FloatArray, share: float, *, least: float = 1.0, most: float = 1.0
    ) -> FloatArray:
        """Bring the angles from place to place to a share of those expected.

        Parameters
        ----------
        heights : (n,) float64
        share : float
        least, most : float
            By which the shortest waves are multiplied in each of three rounds.

        Returns
        -------
        (n,) float64
            Known heights as they were.
        """
        for _ in range(_ROUNDS):
            gain = share * self.wanted / np.maximum(self._there(heights), _TINY)
            change = (np.clip(gain, least, most) - 1.0) * self._short(heights)
            heights = self._changed(heights, change)
        return heights

    def _short(self, heights: FloatArray) -> FloatArray:
        return np.asarray(heights - self._average @ heights)

    def _changed(self, heights: FloatArray, change: FloatArray) -> FloatArray:
        return np.where(self._field.hole.unknown, heights + change, heights)

    def _there(self, heights: FloatArray) -> FloatArray:
        field = self._field
        angles = _angles(field.raised(heights), field.hole.faces, self._inside)
        return field.around(angles, field.hole.unknown)


def _face_pairs(faces: IntArray) -> IntArray:
    """Give the pairs of faces (p, 2) that share an edge."""
    edges = edges_of(faces)
    order = np.argsort(edges.face_edges.ravel(), kind="stable")
    edge = edges.face_edges.ravel()[order]
    same = np.flatnonzero((edge[1:] == edge[:-1]) & (edges.face_count[edge[1:]] == 2))
    return np.column_stack([order[same] // 3, order[same + 1] // 3])


def _angles(positions: FloatArray, faces: IntArray, pairs: IntArray) -> FloatArray:
    """Mean angle at each vertex (n,) between the faces of pairs, those of all that touch it."""
    angles = _pair_angles(positions, faces, pairs)
    corners = faces[pairs].reshape(-1)
    sums = np.bincount(corners, weights=np.repeat(angles, 6), minlength=len(positions))
    return sums / np.maximum(np.bincount(corners, minlength=len(positions)), 1)


def _pair_angles(positions: FloatArray, faces: IntArray, pairs: IntArray) -> FloatArray:
    """Angles (p,) between the faces of pairs, in radians."""
    one, other = face_normals(positions, faces)[pairs].transpose(1, 0, 2)
    return np.asarray(np.arccos(np.clip(np.einsum("ij,ij->i", one, other), -1.0, 1.0)))
