"""PyMeshLab's calls on a MeshSet by the name of a filter, and on its script, that know ours too.

For MeshLab's own filters each hands over to PyMeshLab's call as it is.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.parsers import expat

import pymeshlab

from meshlab_lowrank.filters.filter_script import script_text, set_script
from meshlab_lowrank.filters.native_calls import METHODS
from meshlab_lowrank.filters.our_parameters import parameter_values
from meshlab_lowrank.filters.script_printing import print_script
from meshlab_lowrank.filters.script_steps import (
    OURS,
    OurStep,
    segments,
    set_steps,
    split_steps,
    steps_of,
    with_steps,
)


def apply_filter(ms: pymeshlab.MeshSet, /, filter_name: str, **kwargs: Any) -> Any:
    """Run the filters of meshlab_lowrank too."""
    if filter_name in OURS:
        return OURS[filter_name](ms, **kwargs)
    return METHODS["apply_filter"](ms, filter_name, **kwargs)


def filter_parameter_values(ms: pymeshlab.MeshSet, /, filter_name: str, **kwargs: Any) -> Any:
    """Knows the filters of meshlab_lowrank too."""
    if filter_name in OURS:
        return parameter_values(OURS[filter_name], kwargs)
    return METHODS["filter_parameter_values"](ms, filter_name, **kwargs)


def save_filter_script(ms: pymeshlab.MeshSet, filter_script_name: str) -> None:
    """Keep the filters of meshlab_lowrank, which only this package reads again, in their place."""
    if not steps_of(ms):
        METHODS["save_filter_script"](ms, filter_script_name)
        return
    text = with_steps(script_text(ms), steps_of(ms))
    try:
        Path(filter_script_name).write_text(text, encoding="utf-8")
    except OSError as error:
        msg = f"{filter_script_name} can't be written ({error.strerror})."
        raise pymeshlab.PyMeshLabException(msg) from error


def load_filter_script(ms: pymeshlab.MeshSet, filter_script_name: str) -> None:
    """Take the filters of meshlab_lowrank too, and refuse what they would refuse."""
    steps = _read(filter_script_name)
    if steps is not None:
        native, ours = steps
        set_script(ms, native)
        set_steps(ms, ours)
        return
    before = script_text(ms) if steps_of(ms) else ""
    METHODS["load_filter_script"](ms, filter_script_name)
    if before and (Path(filter_script_name).is_file() or script_text(ms) != before):
        set_steps(ms, ())


def apply_filter_script(ms: pymeshlab.MeshSet) -> None:
    """Run the filters of meshlab_lowrank too, in their place."""
    if not steps_of(ms):
        METHODS["apply_filter_script"](ms)
        return
    text, steps = script_text(ms), steps_of(ms)
    try:
        for part in segments(text, steps):
            if isinstance(part, OurStep):
                OURS[part.name](ms, **part.values)
            else:
                set_script(ms, part)
                METHODS["apply_filter_script"](ms)
    finally:
        set_script(ms, text)
        set_steps(ms, steps)


def clear_filter_script(ms: pymeshlab.MeshSet) -> None:
    """Clear it of the filters of meshlab_lowrank too."""
    METHODS["clear_filter_script"](ms)
    set_steps(ms, ())


def print_filter_script(ms: pymeshlab.MeshSet) -> None:
    """Show the filters of meshlab_lowrank in their place."""
    if not steps_of(ms):
        METHODS["print_filter_script"](ms)
        return
    print_script(ms, steps_of(ms))


def _read(path: str) -> tuple[str, list[OurStep]] | None:
    """Read a script with filters of ours; None if it has none, which is MeshLab's business."""
    try:
        native, steps = split_steps(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, expat.ExpatError, TypeError):
        return None
    if not steps:
        return None
    try:
        for step in steps:
            parameter_values(OURS[step.name], step.values)
    except pymeshlab.PyMeshLabException as error:
        msg = f"{path} was not loaded: {error}"
        raise pymeshlab.PyMeshLabException(msg) from error
    return native, steps


CALLS = (
    apply_filter,
    filter_parameter_values,
    save_filter_script,
    load_filter_script,
    apply_filter_script,
    clear_filter_script,
    print_filter_script,
)
