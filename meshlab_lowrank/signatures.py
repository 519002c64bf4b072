"""Show functions that take the parameters of the method by name with each of these."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Collection
from dataclasses import fields
from typing import Any, TypeVar

from meshlab_lowrank.parameters import InpaintParameters

_Function = TypeVar("_Function", bound=Callable[..., Any])

ALL_PARAMETERS = tuple(field.name for field in fields(InpaintParameters))


def showing_parameters(names: Collection[str] = ALL_PARAMETERS) -> Callable[[_Function], _Function]:
    """Give a function a signature with parameters by name in place of its ``**parameters``.

    Parameters
    ----------
    names : collection of str
        Fields of `InpaintParameters`, shown with the values that they have by default.

    Returns
    -------
    callable
        A decorator that changes nothing but the signature.
    """
    hints = typing.get_type_hints(InpaintParameters)
    defaults = InpaintParameters()
    shown = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=getattr(defaults, name),
            annotation=hints[name],
        )
        for name in ALL_PARAMETERS
        if name in names
    ]

    def decorate(function: _Function) -> _Function:
        signature = inspect.signature(function)
        own = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
        positional = [p for p in own if p.kind is not p.KEYWORD_ONLY]
        named = [p for p in own if p.kind is p.KEYWORD_ONLY]
        parameters = [*positional, *shown, *named]
        vars(function)["__signature__"] = signature.replace(parameters=parameters)
        return function

    return decorate
