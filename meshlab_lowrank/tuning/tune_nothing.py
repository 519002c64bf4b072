"""Tuning: none, the settings are the user's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.tuning.tune import Attempt, Look, Tuned, Unquestioning


@dataclass(frozen=True)
class NoTuning(Unquestioning):
    """Nothing is tried out, so nothing is known of how right the detail is; see `Tune`."""

    def __call__(
        self,
        hole: Hole,
        look: Look,  # noqa: ARG002
        attempt: Attempt,  # noqa: ARG002
        report: Callable[[float], object],  # noqa: ARG002
    ) -> Tuned:
        """Give the hole back."""
        return Tuned(hole, None)
