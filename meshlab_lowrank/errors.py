"""Exceptions of the package; each message is one plain sentence."""

from __future__ import annotations


class LowrankError(Exception):
    """Base class of everything that this package raises on purpose."""


class InvalidMeshError(LowrankError, ValueError):
    """The mesh can't be worked on; the message says why and what repairs it."""


class InvalidParameterError(LowrankError, ValueError):
    """A parameter has a wrong name, type or value."""


class StageError(LowrankError):
    """One hole can't be done; the message is the reason given in its record."""


class InpaintCancelledError(LowrankError):
    """The progress callback returned False; nothing was changed."""


class MissingExtraError(LowrankError, ImportError):
    """An optional dependency is missing; the message names the extra to install."""
