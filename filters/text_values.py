"""Values of the parameters of our filters as text, as scripts and the command line have them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any

import pymeshlab

from meshlab_lowrank.edge_length import checked_length

WHOLE = re.compile(r"[+-]?\d{1,18}")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")

_LISTS: dict[str, Callable[[str], float]] = {
    "holes": lambda text: int(text) if WHOLE.fullmatch(text) else float(text),
    "near": float,
}
_TEXTS = ("marksfile",)  # a file may be called 12


def filter_value(name: str, text: str) -> Any:
    """Read the value of a parameter of one of our filters from text.

    Parameters
    ----------
    name : str
    text : str
        ``true``, ``12``, ``0.5``, ``2%``, ``3,7`` where it takes several, or a word.

    Returns
    -------
    bool, int, float, list, pymeshlab.PercentageValue, pymeshlab.PureValue or str
    """
    if name in _TEXTS:
        return text
    if name in _LISTS:
        items = [item.strip() for item in text.split(",")]
        return list(map(_LISTS[name], items)) if all(map(NUMBER.fullmatch, items)) else text
    return _plain_value(name, text)


def _plain_value(name: str, text: str) -> Any:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    if text.endswith("%") and NUMBER.fullmatch(text[:-1]):
        return pymeshlab.PercentageValue(float(text[:-1]))
    if name == "refineedgelen" and NUMBER.fullmatch(text):
        return pymeshlab.PureValue(float(text))
    if WHOLE.fullmatch(text):
        return int(text)
    return float(text) if NUMBER.fullmatch(text) else text


def value_text(value: object) -> str:
    """Write a value so that `filter_value` reads it again."""
    if isinstance(value, Iterable) and not isinstance(value, str):
        return ",".join(map(value_text, value))
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, pymeshlab.PercentageValue | pymeshlab.PureValue):
        return str(checked_length("refineedgelen", value))
    return str(value)
