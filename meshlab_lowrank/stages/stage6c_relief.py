"""Stage 6, relief: heights for surroundings whose detail doesn't predict itself.

Variants: `CopiedRelief`, `NoRelief`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.hole import Hole


class Relief(Protocol):
    """Gives a hole relief of the kind around it, in place of stages 1 (base) to 6."""

    def __call__(self, hole: Hole) -> Hole | None:
        """Put relief on the smooth fill.

        Parameters
        ----------
        hole : Hole
            Unknown vertices on a smooth fill.

        Returns
        -------
        Hole or None
            With new positions of the unknown vertices and the base that carries them; None where
            the surroundings have too little to go by.
        """
        ...

    def calmed(self, hole: Hole) -> Hole:
        """Take back what makes a fill that was recovered more crumpled than its surroundings.

        Parameters
        ----------
        hole : Hole
            Unknown vertices where the vertex update left them.

        Returns
        -------
        Hole
            The same where nothing is crumpled.
        """
        ...
