"""The filter script that MeshLab keeps of a MeshSet, without our filters."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pymeshlab

from meshlab_lowrank.filters.native_calls import METHODS

_STEP = "<filter "


@contextlib.contextmanager
def unrecorded(ms: pymeshlab.MeshSet) -> Iterator[None]:
    """Run filters that ``ms.save_filter_script`` shall not write.

    MeshLab records every filter, and our steps would replay on another mesh as nonsense. Whatever
    happens inside, the script of MeshLab's filters is afterwards as before.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    """
    with tempfile.TemporaryDirectory() as folder:
        before = _saved(ms, folder)
        try:
            yield
        finally:
            _load(ms, before)


def script_text(ms: pymeshlab.MeshSet) -> str:
    """Give the script of MeshLab's filters as XML."""
    with tempfile.TemporaryDirectory() as folder:
        return _saved(ms, folder).read_text(encoding="utf-8")


def set_script(ms: pymeshlab.MeshSet, text: str) -> None:
    """Make XML without our filters the script of MeshLab's filters, in silence."""
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder, "script.mlx")
        script.write_text(text, encoding="utf-8")
        _load(ms, script)


def _saved(ms: pymeshlab.MeshSet, folder: str) -> Path:
    script = Path(folder, "script.mlx")
    METHODS["save_filter_script"](ms, str(script))
    return script


def _load(ms: pymeshlab.MeshSet, script: Path) -> None:
    METHODS["clear_filter_script"](ms)
    if _STEP in script.read_text(encoding="utf-8"):
        with quiet(2):
            METHODS["load_filter_script"](ms, str(script))


def script_length(text: str) -> int:
    """Give the number of filters in a script."""
    return text.count(_STEP)  # values hold no < as it is


@contextlib.contextmanager
def quiet(stream: int) -> Iterator[None]:
    """Hide what MeshLab writes to the standard output (1) or error (2) of the process, always."""
    saved = os.dup(stream)
    try:
        with Path(os.devnull).open("wb") as sink:
            os.dup2(sink.fileno(), stream)
            yield
    finally:
        os.dup2(saved, stream)
        os.close(saved)
