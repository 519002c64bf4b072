"""Stage 1, level: the surface on which the detail of a hole is recovered.

Variants: `EvenLevel`, `MeshItself`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.fading import faded
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.interpolation import interpolation
from meshlab_lowrank.mesh.topology import compacted, faces_at
from meshlab_lowrank.stages.stage0_region import Region

_RINGS = 2  # of known vertices around a fill, whose tangents it keeps
_FADING = 1.0  # edges of a level over which what its edges blur at the rim dies away


@dataclass(frozen=True)
class Level:
    """A hole on a surface of its own, about the same origin as its region.

    Attributes
    ----------
    hole : Hole
        On its smooth fill, in edge lengths of this surface.
    spacing : float
        That edge length, in the local units of the region.
    is_mesh : bool
        Whether the surface is the mesh itself.
    """

    hole: Hole
    spacing: float
    is_mesh: bool


class ChooseLevel(Protocol):
    """Gives a hole the surface to be worked on."""

    @property
    def coarsest(self) -> float:
        """Largest factor that `__call__` is asked for, on the spacing of the mesh."""
        ...

    def __call__(self, region: Region, factor: float, *, rim_normals: bool) -> Level:
        """Make a surface.

        Parameters
        ----------
        region : Region
            Closed and faired, cut out as wide as this level is to see.
        factor : float
            How many times coarser than the mesh.
        rim_normals : bool
            See `Hole`.

        Raises
        ------
        StageError
            If there is no such surface.
        """
        ...


def carried(region: Region, level: Level, solved: FloatArray) -> FloatArray:
    """Bring what was recovered on a level onto the fill of its region.

    The fill moves as the level's surface below it does, less what the known surface at the rim,
    which stays, would have had to move. That comes of what the level's edges blur, so it dies away
    over an edge of the level: its slope would move all of the fill otherwise.

    Parameters
    ----------
    region : Region
        Closed and faired.
    level : Level
    solved : (n, 3) float64
        What became of the positions of ``level.hole``.

    Returns
    -------
    (m, 3) float64
        Positions of the region; known ones bit for bit.
    """
    if level.is_mesh:
        return np.where(region.known_vertices[:, None], region.vertices, solved * level.spacing)
    return carried_onto(region.vertices, region.faces, region.known_vertices, level, solved)


def carried_onto(
    vertices: FloatArray, faces: IntArray, known: BoolArray, level: Level, solved: FloatArray
) -> FloatArray:
    """Bring what was recovered on a level onto another triangulation; see `carried`.

    Parameters
    ----------
    vertices : (m, 3) float64
        In the local units of the region, with the same smooth fill.
    faces : (f, 3) int64
    known : (m,) bool
    level : Level
    solved : (n, 3) float64

    Returns
    -------
    (m, 3) float64
    """
    start = level.hole.positions
    near = ~known
    for _ in range(_RINGS):
        near[faces[faces_at(near, faces)]] = True
    used, own = compacted(faces[faces_at(near, faces)], len(vertices))
    points = vertices[used]
    onto = interpolation(
        points / level.spacing,
        vertex_normals(vertices, faces)[used],
        start,
        vertex_normals(start, level.hole.faces),
    )
    moves = level.spacing * (onto @ (solved - start))
    fixed = known[used]
    moves -= faded(points, own, fixed, moves, length=_FADING * level.spacing)
    positions = vertices.copy()
    positions[used[~fixed]] += moves[~fixed]
    return positions
