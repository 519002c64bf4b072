"""The append-only record of a batch run."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

MANIFEST_NAME = "manifest.jsonl"


class Manifest:
    """JSON lines, one record a file and run; the last record of a file counts.

    Parameters
    ----------
    folder : Path
        The folder of the outputs.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / MANIFEST_NAME

    def last_records(self) -> dict[str, dict[str, Any]]:
        """Give the last whole record of each file by its name."""
        records = {}
        if self.path.exists():
            for line in self.path.read_bytes().splitlines():
                with contextlib.suppress(ValueError, KeyError, TypeError):  # cut short by a kill
                    record = json.loads(line)
                    records[record["file"]] = record
        return records

    def append(self, record: dict[str, Any]) -> None:
        """Add one record and see it onto the disk.

        Parameters
        ----------
        record : dict
            Ready for JSON, with the key "file".

        Raises
        ------
        OSError
            If the disk is full; then the file is as before.
        """
        line = json.dumps(record).encode() + b"\n"
        with self.path.open("ab+", buffering=0) as file:
            size = file.tell()
            if size:
                file.seek(-1, os.SEEK_END)
                if file.read(1) != b"\n":  # a kill cut the last line short
                    line = b"\n" + line
            try:
                while line:
                    line = line[file.write(line) :]
                os.fsync(file.fileno())
            except OSError:
                file.truncate(size)
                raise
