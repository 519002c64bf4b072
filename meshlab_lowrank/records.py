"""Records of holes and filters that come from outside: from a file, or from a user's function."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, TypeVar

import msgspec

from meshlab_lowrank.result import NOT_ALWAYS_KNOWN, HoleRecord

T = TypeVar("T")


class RecordError(ValueError):
    """A record is not what it should be; the message says where."""


class _FilterReport(msgspec.Struct):
    """What is read of the report of a filter."""

    closed_holes: int | None = None
    new_faces: int = 0
    untextured_faces: int = 0
    notes: list[str] = []
    texture_notes: list[str] = []
    holes: list[dict[str, Any]] = []


def checked(data: object, kind: type[T]) -> T:
    """Turn plain data into an object of a dataclass; what it doesn't know is left out.

    Parameters
    ----------
    data : object
        As from JSON.
    kind : type

    Returns
    -------
    object of that type

    Raises
    ------
    RecordError
        If something is missing or of another type.
    """
    try:
        return msgspec.convert(data, kind)
    except (msgspec.ValidationError, RecursionError) as error:
        raise RecordError(str(error)) from error


def checked_hole(data: object) -> dict[str, Any]:
    """Check the record of a hole and fill in what it leaves out; see `HoleRecord`.

    Raises
    ------
    RecordError
        If something is missing or of another type.
    """
    if isinstance(data, Mapping):
        unknown = {name: math.nan for name in NOT_ALWAYS_KNOWN if data.get(name, 0.0) is None}
        data = {**data, **unknown}
    return checked(data, HoleRecord).as_dict()


def checked_report(data: object) -> dict[str, Any]:
    """Check what a filter or a user's function gave, and keep what is read of it.

    Raises
    ------
    RecordError
        If it is no report.
    """
    if not isinstance(data, Mapping):
        msg = f"Expected a dict, got {type(data).__name__}"
        raise RecordError(msg)
    known = {name: data[name] for name in _FilterReport.__struct_fields__ if name in data}
    try:
        known = json.loads(json.dumps(known, default=_plain_number, allow_nan=False))
    except (TypeError, ValueError, RecursionError) as error:
        raise RecordError(str(error)) from error
    report = checked(known, _FilterReport)
    holes = [checked_hole(hole) for hole in report.holes]
    return {**known, **({"holes": holes} if "holes" in known else {})}


def parsed_json(line: bytes) -> Any:
    """Parse one JSON document in which each name stands once.

    Raises
    ------
    RecordError
        If it is none.
    """
    try:
        return json.loads(line.decode(), object_pairs_hook=_object)
    except (ValueError, RecursionError) as error:
        raise RecordError(str(error)) from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data = dict(pairs)
    if len(data) < len(pairs):
        msg = "a name stands twice in one object"
        raise ValueError(msg)
    return data


def _plain_number(value: Any) -> Any:
    """Turn a number of NumPy's into one of Python's."""
    if hasattr(value, "item"):
        return value.item()
    msg = f"{type(value).__name__} is no plain value"
    raise TypeError(msg)
