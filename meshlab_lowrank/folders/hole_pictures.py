"""Pictures of the worst holes of a batch run, made in an isolated process."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshlab_lowrank.folders.file_run import FileRecord
from meshlab_lowrank.isolation.pool import WorkerPool
from meshlab_lowrank.report.rendering import missing_renderer

SHOWN = 12
KINDS = ("before", "after", "bars")
SWITCHED_OFF = (
    "They were switched off. They are drawn by PyVista: pip install 'meshlab-lowrank[pictures]'."
)
_DRAWING = "meshlab_lowrank.folders.drawing:perform"
_TIMEOUT = 900.0  # seconds


@dataclass(frozen=True)
class HolePictures:
    """One hole, from one camera.

    Attributes
    ----------
    before, after, bars : bytes
        JPEG files; empty if there is none.
    reason : str
        Why one is missing.
    """

    before: bytes = b""
    after: bytes = b""
    bars: bytes = b""
    reason: str = ""


@dataclass(frozen=True)
class Album:
    """The pictures of a run.

    Attributes
    ----------
    holes : tuple of HolePictures
        Of the worst holes, in their order.
    missing : str
        Why there are none, and what to do; empty if there are.
    """

    holes: tuple[HolePictures, ...] = ()
    missing: str = ""


def draw_holes(
    holes: Sequence[tuple[FileRecord, dict[str, Any]]],
    source: Path,
    target: Path,
    pool: WorkerPool,
) -> Album:
    """Draw the first holes of a list; whatever goes wrong is told in the album.

    Parameters
    ----------
    holes : sequence of (FileRecord, dict)
        The record of the file and that of the hole, the worst first.
    source, target : Path
        Folders of the inputs and the outputs.
    pool : WorkerPool
        Lends the process in which the meshes are read again.

    Returns
    -------
    Album
    """
    if not holes:
        return Album()
    if missing := missing_renderer():
        return Album(missing=missing)
    items = [
        {
            "source": str(source / record.file),
            "target": str(target / record.output) if record.output else "",
            "hole": hole,
        }
        for record, hole in holes[:SHOWN]
    ]
    try:
        with pool.borrowed() as worker:
            ending = worker.run({"function": _DRAWING, "holes": items}, timeout=_TIMEOUT)
    except OSError as error:  # of a process that can't be started
        return Album(missing=f"{error.strerror or error}.")
    if ending.report is None:
        late = f"The drawing was ended after {_TIMEOUT:g} s."
        return Album(missing=late if ending.timed_out else ending.cause)
    drawn = (
        HolePictures(**{kind: _bytes(item[kind]) for kind in KINDS}, reason=item["reason"])
        for item in ending.report.get("pictures", ())
    )
    return Album(tuple(drawn), ending.report["reason"])


def _bytes(text: str) -> bytes:
    return base64.b64decode(text)
