"""What a filler is, and the registry that holds them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

FillFunction: TypeAlias = Callable[[Any], object]


@dataclass(frozen=True)
class Filler:
    """One way to fill holes.

    Attributes
    ----------
    name : str
    explanation : str
        One line.
    run : callable
        Takes a pymeshlab.MeshSet; the current mesh afterwards is the result.
    packages : tuple of str
        Modules that must be importable besides the dependencies of this package.
    """

    name: str
    explanation: str
    run: FillFunction
    packages: tuple[str, ...] = ()


FILLERS: dict[str, Filler] = {}


def filler(name: str, explanation: str, *packages: str) -> Callable[[FillFunction], FillFunction]:
    """Enter the decorated function into the registry under a name.

    Parameters
    ----------
    name : str
    explanation : str
        One line.
    *packages : str
        Optional modules that the function needs.
    """

    def enter(run: FillFunction) -> FillFunction:
        FILLERS[name] = Filler(name, explanation, run, packages)
        return run

    return enter
