"""Names of files in a file of any format."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from meshlab_lowrank.mesh_files.names import IMAGE_SUFFIXES

_LONGEST = 4096  # bytes of a path
_RUN = re.compile(rb"""[^\0-\x1f"'<>|]{4,}""")  # shorter ones lead nowhere
_IMAGE = re.compile(
    rb"\.(?:" + "|".join(suffix[1:] for suffix in sorted(IMAGE_SUFFIXES)).encode() + rb")",
    re.IGNORECASE,
)
_AWAY = re.compile(rb"[/\\]|file:|[a-z]:[/\\]", re.IGNORECASE)


def paths_away(data: bytes) -> list[str]:
    """Find what may be a path that begins at a root or has a step up."""
    runs = (run for run in _runs(data) if b"/" in run or b"\\" in run)
    return _texts(run for run in runs if _AWAY.match(run) or b".." in run)


def image_names(data: bytes) -> list[str]:
    """Find what may be the name of an image."""
    found = ((run, match) for run in _runs(data) for match in _IMAGE.finditer(run))
    return _texts(run[: match.end()] for run, match in found)


def _runs(data: bytes) -> Iterator[bytes]:
    """Give what stands between characters that no name has, as a whole and between spaces."""
    for match in _RUN.finditer(data):
        run = match[0].strip()
        if len(run) <= _LONGEST:
            yield run
        if b" " in run:
            yield from (part for part in run.split() if len(part) <= _LONGEST)


def _texts(names: Iterable[bytes]) -> list[str]:
    return [name.decode(errors="surrogateescape") for name in dict.fromkeys(names)]
