"""The append-only record of a batch run."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.folders.manifest_lines import move_bad_lines, read_lines
from meshlab_lowrank.mesh_files import kind_of

MANIFEST_NAME = "manifest.jsonl"
ASIDE_NAME = "manifest.set-aside"


class Manifest:
    """JSON lines, one record a file and run; the last record of a file counts.

    Parameters
    ----------
    folder : Path
        The folder of the outputs.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / MANIFEST_NAME

    def check(self) -> None:
        """Refuse what stands in the place of the manifest and is no file to append to.

        Raises
        ------
        InvalidParameterError
        """
        kind = "a link to nothing" if self.path.is_symlink() else ""
        with contextlib.suppress(FileNotFoundError):
            kind = kind_of(self.path)
        if kind:
            msg = f"{self.path} is {kind}; take it away or choose another output folder."
            raise InvalidParameterError(msg)

    def last_records(self) -> dict[str, dict[str, Any]]:
        """Give the last whole record of each file by its name."""
        if not self.path.exists():
            return {}
        found = (record for _, record in read_lines(self.path))
        return {record.file: record.as_dict() for record in found if record}

    def set_aside(self) -> str:
        """Move lines that are no records into a file beside, so that nobody trips over them again.

        Returns
        -------
        str
            A sentence on it; empty if there is none.
        """
        if not self.path.exists():
            return ""
        bad = sum(record is None for _, record in read_lines(self.path))
        if not bad:
            return ""
        aside = self.path.with_name(ASIDE_NAME)
        count = f"{bad} line{'s' * (bad > 1)} of {self.path} can't be read"
        try:
            move_bad_lines(self.path.resolve(), aside)
        except OSError as error:
            return f"{count} and could not be set aside ({error.strerror}); the others count."
        return f"{count}; what they told of is done again, and {aside.name} holds them."

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
