"""Hole filling for triangle meshes that brings the lost surface detail back.

Importing the package binds its filters to `pymeshlab.MeshSet`.
"""

from __future__ import annotations

import importlib
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

if not Path(__file__).with_name("filters").is_dir():  # in a checkout they lie beside the package
    __path__.append(str(Path(__file__).parents[1]))

from meshlab_lowrank.errors import (
    InpaintCancelledError,
    InvalidMeshError,
    InvalidParameterError,
    LowrankError,
    MissingExtraError,
)
from meshlab_lowrank.filters import register
from meshlab_lowrank.hole_table import measure_holes
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.restoring import restore_detail
from meshlab_lowrank.result import HoleRecord, InpaintResult, ProgressEvent
from meshlab_lowrank.version import __version__

if TYPE_CHECKING:
    from meshlab_lowrank.comparison import compare
    from meshlab_lowrank.folders import batch

__all__ = [
    "HoleRecord",
    "InpaintCancelledError",
    "InpaintParameters",
    "InpaintResult",
    "InvalidMeshError",
    "InvalidParameterError",
    "LowrankError",
    "MissingExtraError",
    "ProgressEvent",
    "__version__",
    "batch",
    "compare",
    "inpaint",
    "measure_holes",
    "register",
    "restore_detail",
]

_LAZY = {"compare": "meshlab_lowrank.comparison", "batch": "meshlab_lowrank.folders"}

logging.getLogger(__name__).addHandler(logging.NullHandler())  # silent unless asked
register()


def __getattr__(name: str) -> Any:
    """Load what only some callers need on first use."""
    if name not in _LAZY:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(importlib.import_module(_LAZY[name]), name)


def __dir__() -> list[str]:
    """List the public names."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
