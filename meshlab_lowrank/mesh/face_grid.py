"""The faces of a mesh sorted into boxes, to find those in a part of space."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray

_PER_CELL = 30.0  # faces, if they were spread evenly


class FaceGrid:
    """Finds the faces in a box without looking at all of them.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    """

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        self._vertices, self._faces = vertices, faces
        self._low = vertices.min(axis=0)
        extent = vertices.max(axis=0) - self._low
        # a surface fills about the square of its cells a side, not the cube
        side = max(1, int(np.sqrt(len(faces) / _PER_CELL)))
        self._cell = float(max(extent.max() / side, np.finfo(np.float64).tiny))
        self._shape = 1 + np.floor(extent / self._cell).astype(np.int64)
        first = self._cells(vertices[faces[:, 0]])  # a face in a box has its first corner there
        key = (first[:, 0] * self._shape[1] + first[:, 1]) * self._shape[2] + first[:, 2]
        self._order = np.argsort(key, kind="stable")
        self._keys = key[self._order]

    def _cells(self, points: FloatArray) -> IntArray:
        cells = np.floor((points - self._low) / self._cell)
        return np.asarray(np.clip(cells, 0, self._shape - 1), dtype=np.int64)

    def within(self, low: FloatArray, high: FloatArray) -> IntArray:
        """Faces whose corners all lie in a box from ``low`` to ``high``, (3,) each, ascending."""
        first, last = self._cells(np.stack([low, high]))
        x, y = np.meshgrid(*(np.arange(first[i], last[i] + 1) for i in range(2)), indexing="ij")
        row = (x * self._shape[1] + y).ravel() * self._shape[2]
        start = np.searchsorted(self._keys, row + first[2])
        stop = np.searchsorted(self._keys, row + last[2], side="right")
        pieces = [self._order[i:j] for i, j in zip(start, stop, strict=True) if j > i]
        if not pieces:
            return np.zeros(0, dtype=np.int64)
        found = np.sort(np.concatenate(pieces))
        corners = self._vertices[self._faces[found]]
        inside = ((corners >= low) & (corners <= high)).all(axis=(1, 2))
        return np.asarray(found[inside])
