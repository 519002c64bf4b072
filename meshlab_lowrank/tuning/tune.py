"""Tuning: what the surroundings of a hole tell before it is worked on.

Variants: `FakeHoleTuning`, `NoTuning`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.tuning.trust import Trust

Attempt: TypeAlias = Callable[[Hole, Hole], Hole | None]


@dataclass(frozen=True)
class Tuned:
    """A hole with the wavelength of its detail.

    Attributes
    ----------
    hole : Hole
    trust : Trust or None
        None if nothing tells how far recovered detail can be believed.
    """

    hole: Hole
    trust: Trust | None


class Tune(Protocol):
    """Finds out about the surroundings of a hole."""

    def __call__(self, hole: Hole, attempt: Attempt, report: Callable[[float], object]) -> Tuned:
        """Tune to a hole.

        Parameters
        ----------
        hole : Hole
            On its smooth fill.
        attempt : callable
            Recovers the parts of its first argument, with patches of the known surface of its
            second; None if there are too few.
        report : callable
            Called with the part of the tuning that is done.

        Returns
        -------
        Tuned
        """
        ...
