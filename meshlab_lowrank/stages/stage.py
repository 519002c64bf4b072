"""What all variants of a stage have in common: the copies that special runs ask for."""

from __future__ import annotations

from typing import TypeVar

_Own = TypeVar("_Own", bound="Stage")


class Stage:
    """Base of every variant; each is a frozen dataclass of its settings.

    The methods give the variant itself unless a variant says otherwise.
    """

    def for_trial(self: _Own) -> _Own:
        """Copy that costs less, for trials in fake holes."""
        return self

    def for_depth(self: _Own) -> _Own:
        """Copy that sees more of the pattern at once, for the first run in a deep hole."""
        return self

    def for_last(self: _Own) -> _Own:
        """Copy for the last pass, after which nothing is learnt from what was recovered."""
        return self

    def for_copying(self: _Own) -> _Own:
        """Copy that keeps the amplitude rather than the mean, for the last pass of full detail."""
        return self

    def for_even(self: _Own) -> _Own:
        """Copy that works on an even surface where the mesh itself is not quite even."""
        return self

    def for_finer(self: _Own) -> _Own:
        """Copy for the pass on a finer surface, from what a coarse one gave."""
        return self
