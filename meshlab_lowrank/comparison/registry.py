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
    named_only : bool
        Whether it runs only where it is asked for by its name.
    """

    name: str
    explanation: str
    run: FillFunction
    packages: tuple[str, ...] = ()
    named_only: bool = False


FILLERS: dict[str, Filler] = {}


def usual_fillers() -> list[str]:
    """Give the names of the fillers that run where none is asked for."""
    return [filler.name for filler in FILLERS.values() if not filler.named_only]


def filler(
    name: str, explanation: str, *packages: str, named_only: bool = False
) -> Callable[[FillFunction], FillFunction]:
    """Enter the decorated function into the registry under a name.

    Parameters
    ----------
    name : str
    explanation : str
        One line.
    *packages : str
        Optional modules that the function needs.
    named_only : bool
        See `Filler`.
    """

    def enter(run: FillFunction) -> FillFunction:
        FILLERS[name] = Filler(name, explanation, run, packages, named_only)
        return run

    return enter
