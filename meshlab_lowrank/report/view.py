"""Where a hole lies and how it is looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import (
    FloatArray,
    IntArray,
    edge_lengths,
    face_vectors,
    normalized,
)
from meshlab_lowrank.mesh.surface_part import SurfacePart

_AGREEMENT = 0.5  # of the faces around a loop, below which they tell no direction: ends of tubes
_MARGIN = 1.0  # width of the surroundings in a picture, in radii of the hole


@dataclass(frozen=True, kw_only=True)
class View:
    """One hole, seen from outside.

    Attributes
    ----------
    centre : (3,) float64
        Mean of the vertices of the loop.
    radius : float
        Largest distance of these from the centre.
    normal : (3,) float64
        Unit normal of the surface around the loop, or of the loop where that has none; looks out of
        the page in pictures.
    edge_length : float
        Mean edge length of the faces at the hole.
    """

    centre: FloatArray
    radius: float
    normal: FloatArray
    edge_length: float

    @classmethod
    def of_loop(cls, vertices: FloatArray, faces: IntArray, loop: IntArray) -> View:
        """Look at a loop (k,) of a mesh."""
        near = faces[np.isin(faces, loop).any(axis=1)]
        points = vertices[loop]
        centre = points.mean(axis=0)
        return View(
            centre=centre,
            radius=float(np.linalg.norm(points - centre, axis=1).max()),
            normal=_outward(face_vectors(vertices, near), points - centre),
            edge_length=float(edge_lengths(vertices, near).mean()),
        )

    def around(self, surface: SurfacePart, margin: float) -> SurfacePart:
        """Cut a surface down to a part and its surroundings, a margin in mesh units wide."""
        return surface.cut_out(self.centre, self.radius + margin)

    def scene(self, surface: SurfacePart) -> SurfacePart:
        """Cut a surface down to what a picture shows."""
        return self.around(surface, _MARGIN * self.radius)


def _outward(areas: FloatArray, spokes: FloatArray) -> FloatArray:
    """Give the direction in which a hole looks, (3,).

    Parameters
    ----------
    areas : (m, 3) float64
        Area vectors of the faces around it.
    spokes : (k, 3) float64
        From its centre to the vertices of its loop, in order.
    """
    total = areas.sum(axis=0)
    if np.linalg.norm(total) < _AGREEMENT * np.linalg.norm(areas, axis=1).sum():
        total = np.cross(spokes, np.roll(spokes, -1, axis=0)).sum(axis=0)
    return normalized(total) if total.any() else np.array([0.0, 0.0, 1.0])
