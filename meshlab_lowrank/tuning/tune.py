"""Tuning: what the surroundings of a hole tell before it is worked on.

Variants: `FakeHoleTuning`, `NoTuning`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.tuning.judging import Evidence

NO_REPEAT = "The detail of the surroundings doesn't predict itself, so the fill is smooth."

Attempt: TypeAlias = Callable[[Hole, Hole], Hole | None]


@dataclass(frozen=True)
class Look:
    """What a quick look at the surroundings finds.

    Attributes
    ----------
    reason : str
        Why they have nothing to give; empty where they may have.
    strength : float
        How strongly their detail repeats; comparable between surfaces of one place.
    lengths : tuple of float
        Of a repeat, in mean edge lengths, as far as they are known.
    fineness : tuple of float
        How many times as many edges these are as are wanted to recover it.
    """

    reason: str
    strength: float
    lengths: tuple[float, ...] = ()
    fineness: tuple[float, ...] = ()


UNSEEN = Look("", 0.0)


@dataclass(frozen=True)
class Tuned:
    """A hole with the wavelength of its detail.

    Attributes
    ----------
    hole : Hole
    evidence : Evidence or None
        None if nothing tells how far recovered detail can be believed.
    """

    hole: Hole
    evidence: Evidence | None


@dataclass(frozen=True)
class Unquestioning(Stage):
    """Base of tunings that rule out nothing beforehand."""

    def rules_out(self, misfit: float, depth: float) -> str:  # noqa: ARG002
        """Rule out nothing."""
        return ""

    def look(self, hole: Hole) -> Look:  # noqa: ARG002
        """Take the surface as it is."""
        return Look("", 1.0, fineness=(1.0,))


class Tune(Protocol):
    """Finds out about the surroundings of a hole."""

    def rules_out(self, misfit: float, depth: float) -> str:
        """Say why a hole needs no detail, before anything is tried.

        Parameters
        ----------
        misfit : float
            See `FairRegion`.
        depth : float
            Largest distance of a missing vertex from the known ones, in mean edge lengths.

        Returns
        -------
        str
            Empty where it may need detail.
        """
        ...

    def look(self, hole: Hole) -> Look:
        """Look for a pattern in the surroundings, before detail is tried out."""
        ...

    def __call__(
        self, hole: Hole, look: Look, attempt: Attempt, report: Callable[[float], object]
    ) -> Tuned:
        """Tune to a hole.

        Parameters
        ----------
        hole : Hole
            On its smooth fill.
        look : Look
            At it.
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
