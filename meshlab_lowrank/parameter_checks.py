"""Checks of single parameters; each names the parameter and its value."""

from __future__ import annotations

import math

from meshlab_lowrank.errors import InvalidParameterError


def check_choice(name: str, value: object, choices: tuple[str, ...]) -> None:
    """Refuse a value that is none of some."""
    if value not in choices:
        msg = f"Parameter {name} is {value!r}; choose one of {', '.join(map(repr, choices))}."
        raise InvalidParameterError(msg)


def check_bool(name: str, value: object) -> None:
    """Refuse a value that is not True or False."""
    if not isinstance(value, bool):
        msg = f"Parameter {name} is {value!r}; give True or False."
        raise InvalidParameterError(msg)


def check_int(name: str, value: object, least: int) -> None:
    """Refuse a value that is no whole number or below the least."""
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        msg = f"Parameter {name} is {value!r}; give a whole number of at least {least}."
        raise InvalidParameterError(msg)


def check_optional_int(name: str, value: object, least: int) -> None:
    """Refuse a value that is neither None nor such a whole number."""
    if value is not None:
        check_int(name, value, least)


def check_positive(name: str, value: object, *, least: str = "greater than") -> None:
    """Refuse a value that is no finite number above 0."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or value <= 0:  # type: ignore[arg-type, operator]
        msg = f"Parameter {name} is {value!r}; give a number {least} 0."
        raise InvalidParameterError(msg)


def check_length(name: str, value: object) -> None:
    """Refuse a value that is no finite number of at least 0."""
    if value != 0 or isinstance(value, bool):
        check_positive(name, value, least="of at least")


def check_range(least_name: str, least: float, most_name: str, most: float) -> None:
    """Refuse a least value above the greatest; 0 is no limit."""
    if most and least > most:
        msg = (
            f"Parameter {least_name} is {least!r}, more than {most_name} {most!r}, so that no hole "
            "is left; give a smaller one."
        )
        raise InvalidParameterError(msg)
