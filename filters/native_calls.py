"""PyMeshLab's own calls, as they were before ours were put around them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pymeshlab

ORIGINAL = "meshlab_lowrank_original"

_METHODS = (
    "apply_filter",
    "filter_parameter_values",
    "save_filter_script",
    "load_filter_script",
    "apply_filter_script",
    "clear_filter_script",
    "print_filter_script",
)
_FUNCTIONS = ("filter_list", "print_filter_list", "print_filter_parameter_list", "search")


def _original(call: Callable[..., Any]) -> Callable[..., Any]:
    """Look through a call of ours, put there when the package was imported before."""
    found: Callable[..., Any] = getattr(call, ORIGINAL, call)
    return found


METHODS = {name: _original(getattr(pymeshlab.MeshSet, name)) for name in _METHODS}
FUNCTIONS = {name: _original(getattr(pymeshlab, name)) for name in _FUNCTIONS}
