"""What our filters take, told as PyMeshLab tells it of MeshLab's own."""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from meshlab_lowrank.edge_length import LengthValue
from meshlab_lowrank.filters.filter_arguments import inpaint_parameters, refuse_unknown
from meshlab_lowrank.parameters import InpaintParameters

_ONLY_IN_PYTHON = ("progress", "pipeline")


def parameter_values(function: Callable[..., Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Give the value that each parameter of a filter of ours would have.

    Parameters
    ----------
    function : callable
    given : mapping
        Values of some of them.

    Raises
    ------
    pymeshlab.PyMeshLabException
        If a name is unknown or a value wrong.
    """
    values = {p.name: p.default for p in _parameters(function)}
    refuse_unknown(function.__name__, given, values)
    method = {field.name for field in fields(InpaintParameters)} & set(values)
    if method:
        settings = inpaint_parameters(
            function.__name__, {n: given[n] for n in method & set(given)}, method
        )
        values |= {name: getattr(settings, name) for name in method}
    return {name: given.get(name, value) for name, value in values.items()}


def parameter_list(function: Callable[..., Any]) -> str:
    """List the parameters of a filter of ours as PyMeshLab prints them, a line each."""
    lines = [f"{function.__name__} filter - list of parameter names:"]
    lines += [f"\t{p.name} : {_kind(p.annotation)} = {p.default}" for p in _parameters(function)]
    return "\n".join(lines) + "\n"


def _parameters(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """Give those that can be written as text."""
    return [
        p
        for p in inspect.signature(function).parameters.values()
        if p.kind is p.KEYWORD_ONLY and p.name not in _ONLY_IN_PYTHON
    ]


def _kind(annotation: Any) -> str:
    """Name the type of a parameter as PyMeshLab does."""
    if isinstance(annotation, str):
        return annotation
    if annotation is LengthValue:
        return "PercentageValue or PureValue"
    origin = typing.get_origin(annotation)
    if origin is typing.Literal:
        return "str"
    if origin in (typing.Union, types.UnionType):
        kinds = [_kind(a) for a in typing.get_args(annotation) if a is not types.NoneType]
        return " or ".join(dict.fromkeys(kinds))
    return str(annotation.__name__)
