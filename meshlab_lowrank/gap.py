"""A gap of a mesh: a hole with the pieces of surface that lie in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import IntArray
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop


@dataclass(frozen=True)
class Gap:
    """What one fill closes.

    Attributes
    ----------
    loop : BoundaryLoop
    islands : tuple of BoundaryLoop
        Rims of the pieces of surface within it.
    """

    loop: BoundaryLoop
    islands: tuple[BoundaryLoop, ...] = ()

    @property
    def loops(self) -> tuple[BoundaryLoop, ...]:
        """All its loops, the outer one first."""
        return (self.loop, *self.islands)

    @property
    def vertices(self) -> IntArray:
        """Vertices of its loops, one after the other."""
        return np.concatenate([each.vertices for each in self.loops])

    @property
    def following(self) -> IntArray:
        """The vertex that comes after each of them on its loop."""
        return np.concatenate([np.roll(each.vertices, -1) for each in self.loops])

    @property
    def faces(self) -> IntArray:
        """The face at each of their edges."""
        return np.concatenate([each.faces for each in self.loops])

    @property
    def starts(self) -> tuple[int, ...]:
        """Places at which the rims of islands begin in them."""
        return tuple(np.cumsum([len(each.vertices) for each in self.loops])[:-1].tolist())
