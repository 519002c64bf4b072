"""The edge length of fills in all ways in which it may be written."""

from __future__ import annotations

import math
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.mesh.geometry import FloatArray


@runtime_checkable
class LengthValue(Protocol):
    """A `pymeshlab.PercentageValue` or `pymeshlab.PureValue`, which need not be imported here."""

    def value(self) -> float:
        """Give its number."""


EdgeLength: TypeAlias = float | str | LengthValue


def checked_length(name: str, length: object) -> float | str:
    """Give a length as a number in the units of the mesh or as text like ``"1.0%"``.

    Parameters
    ----------
    name : str
        Of the parameter, for the message.
    length : float, str, pymeshlab.PercentageValue or pymeshlab.PureValue
        Percentages are of the diagonal of the bounding box.

    Raises
    ------
    InvalidParameterError
        If it is something else, or not greater than 0.
    """
    percent, number = False, length
    if isinstance(length, LengthValue):
        percent = type(length).__name__ == "PercentageValue"
        number = float(str(np.float32(length.value())))  # they keep 0.05 as 0.05000000074505806
    elif isinstance(length, str):
        percent = length.rstrip().endswith("%")
        try:
            number = float(length.rstrip().removesuffix("%"))
        except ValueError:
            number = None
    if isinstance(number, np.generic):
        number = number.item()
    if (
        not isinstance(number, int | float)
        or isinstance(number, bool)
        or not math.isfinite(number)
        or number <= 0
    ):
        shown = repr(length if number is length or isinstance(length, str) else number)
        msg = (
            f"Parameter {name} is {shown}; give a number greater than 0 in the units of the mesh, "
            "or text like '1%' for a part of the diagonal of its bounding box."
        )
        raise InvalidParameterError(msg)
    return f"{float(number)!r}%" if percent else number


def length_on(length: float | str, vertices: FloatArray) -> float:
    """Give the length on a mesh with these vertices (n, 3), from what `checked_length` gave."""
    if not isinstance(length, str):
        return float(length)
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return diagonal * float(length.removesuffix("%")) / 100.0
