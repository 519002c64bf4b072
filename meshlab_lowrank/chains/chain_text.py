"""The text of a chain."""

from __future__ import annotations

from pathlib import Path

from meshlab_lowrank.errors import InvalidParameterError


def chain_text(path: Path) -> str:
    """Read the file of a chain.

    Raises
    ------
    InvalidParameterError
        If it is not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        msg = f"{path.name} is not written in UTF-8; save it so."
        raise InvalidParameterError(msg) from error
