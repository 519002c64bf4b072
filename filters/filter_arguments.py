"""Check the parameters of a filter as MeshLab does, and turn them into `InpaintParameters`."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.parameters import InpaintParameters

METHOD_PARAMETERS = frozenset(field.name for field in fields(InpaintParameters))


def inpaint_parameters(
    filter_name: str, values: Mapping[str, Any], known: Collection[str]
) -> InpaintParameters:
    """Turn the parameters of a filter into those of the method.

    Parameters
    ----------
    filter_name : str
        For the messages.
    values : mapping
        Names and values as the user gave them.
    known : collection of str
        Names that the filter takes.

    Raises
    ------
    pymeshlab.PyMeshLabException
        Naming the filter and the parameter, if a name is unknown, a type wrong or a value out of
        range.
    """
    refuse_unknown(filter_name, values, known)
    plain = {name: _plain(value) for name, value in values.items()}
    try:
        return InpaintParameters.from_dict(plain)
    except InvalidParameterError as error:
        msg = f"Filter {filter_name}: {error}"
        raise pymeshlab.PyMeshLabException(msg) from error


def refuse_unknown(filter_name: str, values: Mapping[str, Any], known: Collection[str]) -> None:
    """Raise if a name is not among the known ones."""
    for name in values:
        if name not in known:
            choice = f"choose from {', '.join(sorted(known))}" if known else "it takes none"
            msg = f"Parameter {name} not found for filter {filter_name}; {choice}."
            raise pymeshlab.PyMeshLabException(msg)


def flag(filter_name: str, name: str, value: object) -> bool:
    """Give a boolean parameter."""
    plain = _plain(value)
    if not isinstance(plain, bool):
        msg = f"Filter {filter_name}: Parameter {name} is {value!r}; give True or False."
        raise pymeshlab.PyMeshLabException(msg)
    return plain


def _plain(value: object) -> Any:
    """Turn numbers of numpy into Python's own."""
    return value.item() if isinstance(value, np.generic) else value
