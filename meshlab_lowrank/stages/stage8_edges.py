"""Stage 8: which vertices of the final fill are joined by edges.

Variants: `AlongCreases`, `EdgesAsClosed`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray


class Edges(Protocol):
    """Gives the fill other triangles between the same vertices."""

    def __call__(self, positions: FloatArray, faces: IntArray, new: BoolArray) -> IntArray:
        """Give the final faces.

        Parameters
        ----------
        positions : (n, 3) float64
            Final, in mean edge lengths.
        faces : (m, 3) int64
        new : (m,) bool
            Faces that closed the hole; only edges between two of these may change.

        Returns
        -------
        (m, 3) int64
            As many, with the same border; those that are not new are the same.
        """
        ...
