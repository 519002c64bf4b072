"""Comparison runs: our fill beside other hole fillers, in figures and pictures."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshlab_lowrank.comparison.comparing import Comparison, compare

__all__ = ["Comparison", "compare"]


def __getattr__(name: str) -> object:
    """Load what compares on first use: reports need no more than the page module."""
    if name not in __all__:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(importlib.import_module("meshlab_lowrank.comparison.comparing"), name)
