"""Keep the steps of a filter out of the filter script of its MeshSet."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pymeshlab


@contextlib.contextmanager
def unrecorded(ms: pymeshlab.MeshSet) -> Iterator[None]:
    """Run filters that ``ms.save_filter_script`` shall not write.

    MeshLab records every filter. Our steps would replay on another mesh as nonsense, and a filter
    written in Python can't be a step of a script.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    """
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "script.mlx"
        ms.save_filter_script(str(script))
        try:
            yield
        finally:
            ms.clear_filter_script()
            if "<filter " in script.read_text(encoding="utf-8"):
                with quiet(2):
                    ms.load_filter_script(str(script))


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
