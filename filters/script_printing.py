"""Print filter scripts and lists as PyMeshLab does, with our filters in their places."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence

import pymeshlab

from meshlab_lowrank.filters.native_calls import FUNCTIONS, METHODS
from meshlab_lowrank.filters.our_parameters import parameter_list
from meshlab_lowrank.filters.script_steps import OURS, OurStep
from meshlab_lowrank.filters.text_values import value_text
from meshlab_lowrank.mesh_files import captured_output

_NUMBERED = re.compile(r"^\d+: ", re.MULTILINE)


def print_script(ms: pymeshlab.MeshSet, steps: Sequence[OurStep]) -> None:
    """Print the script of a MeshSet in which steps of ours stand.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    steps : sequence of OurStep
    """
    with captured_output() as log:
        METHODS["print_filter_script"](ms)
    entries = [entry.strip("\n") for entry in _NUMBERED.split(log[0])[1:]]
    for number, step in enumerate(steps):
        place = min(step.after, len(entries) - number) + number
        lines = [f"\t{n} : {type(v).__name__} = {_shown(v)}" for n, v in step.values.items()]
        entries.insert(place, "\n".join((step.name, *lines)))
    text = "".join(f"{number}: {entry}\n\n" for number, entry in enumerate(entries))
    sys.stdout.write(f"Filter Script Size : {len(entries)}\n\n{text}")


def filter_list() -> list[str]:
    """Those of meshlab_lowrank are among them."""
    return sorted({*FUNCTIONS["filter_list"](), *OURS})


def print_filter_list() -> None:
    """Those of meshlab_lowrank are among them."""
    lines = "".join(f"\t{name}\n" for name in filter_list())
    sys.stdout.write(f"MeshSet class - list of filter names:\n{lines}")


def print_filter_parameter_list(filter_name: str) -> None:
    """Knows the filters of meshlab_lowrank too."""
    if filter_name in OURS:
        sys.stdout.write(parameter_list(OURS[filter_name]))
    else:
        FUNCTIONS["print_filter_parameter_list"](filter_name)


def search(keyword: str) -> None:
    """Look through the filters of meshlab_lowrank too."""
    FUNCTIONS["search"](keyword)
    words = re.findall(r"[^\W_]+", keyword.lower())
    texts = {n: f"{n} {(filter_.__doc__ or '').splitlines()[0]}" for n, filter_ in OURS.items()}
    names = [n for n, text in texts.items() if words and all(w in text.lower() for w in words)]
    if names:
        lines = (f"{name} : help(pymeshlab.MeshSet.{name})\n" for name in sorted(names))
        sys.stdout.write("\n" + "".join(lines))


def _shown(value: object) -> str:
    lengths = pymeshlab.PercentageValue | pymeshlab.PureValue
    return value_text(value) if isinstance(value, lengths) else repr(value)


CALLS = (filter_list, print_filter_list, print_filter_parameter_list, search)
