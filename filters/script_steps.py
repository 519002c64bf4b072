"""Our filters in the filter scripts of MeshSets, which hold only MeshLab's own.

What MeshLab keeps stays its own; beside it we remember after how many of its filters each of ours
was run.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar
from weakref import WeakKeyDictionary
from xml.parsers import expat
from xml.sax import saxutils

import pymeshlab

from meshlab_lowrank.filters.filter_script import script_length, script_text
from meshlab_lowrank.filters.text_values import filter_value, value_text

_Filter = TypeVar("_Filter", bound=Callable[..., Any])
_KINDS = {bool: "RichBool", int: "RichInt", float: "RichFloat"}


@dataclass(frozen=True)
class OurStep:
    """One run of a filter of ours.

    Attributes
    ----------
    after : int
        Number of MeshLab's filters before it in the script.
    name : str
    values : dict
        Parameters that were given by name, as they were given.
    """

    after: int
    name: str
    values: dict[str, Any]


OURS: dict[str, Callable[..., Any]] = {}
_STEPS: WeakKeyDictionary[pymeshlab.MeshSet, tuple[OurStep, ...]] = WeakKeyDictionary()


def steps_of(ms: pymeshlab.MeshSet) -> tuple[OurStep, ...]:
    """Give our steps in the script of a MeshSet, in their order."""
    return _STEPS.get(ms, ())


def set_steps(ms: pymeshlab.MeshSet, steps: Sequence[OurStep]) -> None:
    """Make these our steps in the script of a MeshSet."""
    _STEPS[ms] = tuple(steps)


def recorded(function: _Filter) -> _Filter:
    """Let a filter of ours stand in the script of the MeshSet on which it was run."""

    @functools.wraps(function)
    def run(ms: pymeshlab.MeshSet, **values: Any) -> Any:
        result = function(ms, **values)
        kept = {n: value for n, value in values.items() if n != "progress" and value is not None}
        step = OurStep(script_length(script_text(ms)), function.__name__, kept)
        set_steps(ms, (*steps_of(ms), step))
        return result

    OURS[function.__name__] = run
    return run  # type: ignore[return-value]


def with_steps(text: str, steps: Sequence[OurStep]) -> str:
    """Write our steps into the XML of a script.

    Raises
    ------
    pymeshlab.PyMeshLabException
        If one was run with a pipeline, which can't be written.
    """
    parts = _Parts(text)
    for number, step in enumerate(steps):
        if "pipeline" in step.values:
            msg = (
                f"{step.name} was run with a pipeline, which a filter script can't hold; write "
                "the chain as a Python file, or call clear_filter_script."
            )
            raise pymeshlab.PyMeshLabException(msg)
        parts.filters.insert(min(step.after, len(parts.filters) - number) + number, _xml(step))
    return parts.head + "".join(f" {part}\n" for part in parts.filters) + parts.tail


def split_steps(text: str) -> tuple[str, list[OurStep]]:
    """Take our steps out of the XML of a script.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
        The script of MeshLab's filters alone.
    list of OurStep

    Raises
    ------
    xml.parsers.expat.ExpatError
        If it is not well formed.
    """
    parts = _Parts(text)
    native: list[str] = []
    steps: list[OurStep] = []
    for part, (name, values) in zip(parts.filters, parts.calls, strict=True):
        if name in OURS:
            read = {n: filter_value(n, value) for n, value in values.items()}
            steps.append(OurStep(len(native), name, read))
        else:
            native.append(part)
    return parts.head + "".join(f" {part}\n" for part in native) + parts.tail, steps


def segments(text: str, steps: Sequence[OurStep]) -> list[str | OurStep]:
    """Give what a script does in its order: scripts of MeshLab's filters, and our steps."""
    parts = _Parts(text)
    found: list[str | OurStep] = []
    begin = 0
    for step in (*steps, None):
        end = len(parts.filters) if step is None else min(step.after, len(parts.filters))
        if end > begin:
            found.append("".join((parts.head, *parts.filters[begin:end], parts.tail)))
        begin = max(begin, end)
        if step is not None:
            found.append(step)
    return found


class _Parts:
    """A script taken apart: what stands before its filters, these, and what follows."""

    def __init__(self, text: str) -> None:
        self.head = "<!DOCTYPE FilterScript>\n<FilterScript>\n"
        self.tail = "</FilterScript>\n"
        self.filters: list[str] = []
        self.calls: list[tuple[str, dict[str, str]]] = []
        self._data, self._begin = text.encode(), 0
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.Parse(self._data, True)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if tag == "filter":
            self._begin = self._parser.CurrentByteIndex
            self.calls.append((attributes.get("name", ""), {}))
        elif tag == "Param" and self.calls and {"name", "value"} <= attributes.keys():
            self.calls[-1][1][attributes["name"]] = attributes["value"]

    def _end(self, tag: str) -> None:
        if tag == "filter":
            end = self._parser.CurrentByteIndex
            if self._data.startswith(b"</", end):  # else it is one tag, and this is behind it
                end = self._data.index(b">", end) + 1
            self.filters.append(self._data[self._begin : end].decode())


def _xml(step: OurStep) -> str:
    name = saxutils.quoteattr(step.name)
    if not step.values:
        return f"<filter name={name}/>"
    lines = (
        f"  <Param name={saxutils.quoteattr(n)} value={saxutils.quoteattr(value_text(value))}"
        f' type="{_KINDS.get(type(value), "RichString")}"/>\n'
        for n, value in step.values.items()
    )
    return f"<filter name={name}>\n{''.join(lines)} </filter>"
