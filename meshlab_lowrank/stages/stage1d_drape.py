"""Stage 1, drape: the fill laid onto the base that the surroundings foretell.

Variants: `ForetoldDrape`, `AsFaired`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.hole import Hole


class Drape(Protocol):
    """Moves the smooth fill of a hole before detail is recovered on it."""

    def __call__(self, hole: Hole) -> Hole:
        """Lay the fill.

        Parameters
        ----------
        hole : Hole
            Unknown vertices on the faired fill, with the wavelength of its detail.

        Returns
        -------
        Hole
            With new positions of the unknown vertices and ``draped``, or the same.
        """
        ...
