"""What MeshLab writes and raises."""

from __future__ import annotations

import contextlib
import os
import re
import sys
import tempfile
from collections.abc import Iterator


def meshlab_reason(error: BaseException) -> str:
    """Give the part of MeshLab's message that says what is wrong, without a full stop."""
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return re.sub("^(Error )?[Dd]etails: ", "", lines[-1]).rstrip(".")


@contextlib.contextmanager
def captured_output() -> Iterator[list[str]]:
    """Catch what C++ code writes to the process's standard output and error.

    Yields
    ------
    list of str
        Empty inside the block; holds the whole text after it.
    """
    text: list[str] = []
    sys.stdout.flush()
    sys.stderr.flush()
    saved = os.dup(1), os.dup(2)
    with tempfile.TemporaryFile() as sink:
        os.dup2(sink.fileno(), 1)
        os.dup2(sink.fileno(), 2)
        try:
            yield text
        finally:
            for descriptor, copy in zip((1, 2), saved, strict=True):
                os.dup2(copy, descriptor)
                os.close(copy)
            sink.seek(0)
            text.append(sink.read().decode(errors="replace"))
