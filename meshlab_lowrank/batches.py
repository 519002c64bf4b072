"""Batches of work on threads, of sizes that don't depend on the number of threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from typing import TypeVar

_Result = TypeVar("_Result")


def run_batches(
    function: Callable[[slice], _Result], count: int, size: int, executor: Executor | None
) -> list[_Result]:
    """Call a function with slices of a range, on the executor's threads where there is one.

    Parameters
    ----------
    function : callable
    count : int
        Length of the range.
    size : int
        Most items of a slice. Fixed by the caller: a product of matrices may round differently
        with the number of rows.
    executor : Executor or None
    """
    slices = [slice(start, min(start + size, count)) for start in range(0, count, size)]
    return list(executor.map(function, slices) if executor else map(function, slices))
