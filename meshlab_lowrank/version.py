"""The version of this package, which stands in ``pyproject.toml``."""

from __future__ import annotations

from importlib import metadata

try:
    __version__ = metadata.version("meshlab-lowrank")
except metadata.PackageNotFoundError:  # a checkout that isn't installed
    __version__ = "unknown"
