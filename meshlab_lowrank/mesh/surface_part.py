"""A part of a surface, with what lies around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_vectors


@dataclass(frozen=True, eq=False)
class SurfacePart:
    """A part of a mesh: the fill of a hole, or what was removed from it.

    Attributes
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        The whole mesh, which gives the part its normals at the rim and its surroundings.
    part : (m,) bool
    """

    vertices: FloatArray
    faces: IntArray
    part: BoolArray

    @property
    def has_area(self) -> bool:
        """Whether the part has faces of more than no area."""
        return bool(face_vectors(self.vertices, self.faces[self.part]).any())

    def cut_out(self, centre: FloatArray, distance: float) -> SurfacePart:
        """Keep the part, and other faces with a corner within a distance of a point."""
        near = np.linalg.norm(self.vertices - centre, axis=1) < distance
        kept = self.part | near[self.faces].any(axis=1)
        used, local = np.unique(self.faces[kept], return_inverse=True)
        return SurfacePart(self.vertices[used], local.reshape(-1, 3), self.part[kept])
