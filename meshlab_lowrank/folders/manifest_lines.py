"""Lines of a manifest: which are records, and how the others are taken out."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from meshlab_lowrank.folders.file_run import FileRecord
from meshlab_lowrank.mesh_files import kind_of
from meshlab_lowrank.records import RecordError, checked, checked_hole, parsed_json
from meshlab_lowrank.scratch import written_whole

_LONGEST = 1 << 26  # bytes; the records of a hundred thousand holes


def read_lines(path: Path) -> Iterator[tuple[bytes, FileRecord | None]]:
    """Give each line that isn't empty, and the record that it holds.

    Parameters
    ----------
    path : Path

    Yields
    ------
    (bytes, FileRecord or None)
        Lines that are too long come in pieces.
    """
    with path.open("rb") as file:
        whole = True  # whether a line begins
        while line := file.readline(_LONGEST):
            begins, whole = whole, line.endswith(b"\n") or len(line) < _LONGEST
            if line.strip():
                yield line, _record(line) if begins and whole else None


def move_bad_lines(path: Path, aside: Path) -> None:
    """Append lines that are no records to another file, then take them out of theirs.

    Raises
    ------
    OSError
        If there is no room; then the file is as before.
    """
    if aside.is_symlink() or (aside.exists() and kind_of(aside)):
        msg = f"{aside.name} is no file"
        raise FileExistsError(0, msg, str(aside))
    with aside.open("ab") as file:
        for line in (line for line, record in read_lines(path) if record is None):
            ends = line.endswith(b"\n") or len(line) == _LONGEST
            file.write(line if ends else line + b"\n")
        file.flush()
        os.fsync(file.fileno())
    with written_whole(path) as kept:
        with kept.open("wb") as file:
            file.writelines(line for line, record in read_lines(path) if record)
        shutil.copymode(path, kept)


def _record(line: bytes) -> FileRecord | None:
    try:
        record = checked(parsed_json(line), FileRecord)
        holes = [checked_hole(hole) for hole in record.holes]
    except RecordError:
        return None
    times = (record.seconds, record.filter_seconds)
    return replace(record, holes=holes) if record.file and all(map(math.isfinite, times)) else None
