"""The lines of an OBJ file as loaders see them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO


def obj_lines(file: BinaryIO) -> Iterator[bytes]:
    r"""Give the lines without white space before them; one that ends in ``\`` goes on in the next.

    Parameters
    ----------
    file : binary file

    Yields
    ------
    bytes
    """
    begun = b""
    for line in file:
        end = line.rstrip(b"\r\n")
        if end.endswith(b"\\"):
            begun += end[:-1] + b" "
            continue
        yield (begun + line).lstrip() if begun else line.lstrip()
        begun = b""
    if begun:
        yield begun.lstrip()


def library_of(line: bytes) -> str | None:
    """Give the name of the material library that a line names; None if it is another line."""
    keyword, *words = line[:4096].split() or [b""]
    if keyword.lower() != b"mtllib":
        return None
    return b" ".join(words).decode(errors="surrogateescape")
