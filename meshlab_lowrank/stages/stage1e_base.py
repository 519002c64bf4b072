"""Stage 1, base: the smooth surface below the detail, which carries the frames of the patches.

Variants: `LowPassBase`, `SurfaceItself`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.hole import Hole


class Base(Protocol):
    """Fits the base of a hole."""

    def __call__(self, hole: Hole, *, first: bool) -> Hole:
        """Fit the base.

        Parameters
        ----------
        hole : Hole
        first : bool
            Whether this is the first pass. Later ones fit to the completed surface, as the first
            one does if the hole is draped.

        Returns
        -------
        Hole
            With ``base`` and ``base_normals``.
        """
        ...
