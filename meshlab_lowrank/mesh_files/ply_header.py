"""The header of a PLY file."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field
from pathlib import Path

from meshlab_lowrank.errors import InvalidMeshError

_LONGEST = 1 << 20  # bytes; beyond, it is no header
_SIZES = {
    **dict.fromkeys((b"short", b"ushort", b"int16", b"uint16"), 2),
    **dict.fromkeys((b"int", b"uint", b"int32", b"uint32", b"float", b"float32"), 4),
    **dict.fromkeys((b"double", b"float64", b"int64", b"uint64"), 8),
}


@dataclass
class PlyElement:
    """A kind of element that a PLY file holds.

    Attributes
    ----------
    name : str
    count : int
    properties : list of str
    size : int
        Bytes that one takes at least in a binary file; an empty list takes those of its count.
    """

    name: str
    count: int
    properties: list[str] = field(default_factory=list)
    size: int = 0


@dataclass
class PlyHeader:
    """A header as it stands in the file.

    Attributes
    ----------
    lines : list of bytes
        With their ends.
    elements : list of PlyElement
    binary : bool
    size : int
        In bytes; that of what was read if it has no end.
    """

    lines: list[bytes] = field(default_factory=list)
    elements: list[PlyElement] = field(default_factory=list)
    binary: bool = False
    size: int = 0

    @classmethod
    def read(cls, path: Path) -> PlyHeader:
        """Read it up to its end or that of the file.

        Raises
        ------
        InvalidMeshError
            If it has no end, or a count in it is none.
        """
        header = cls()
        with path.open("rb") as file:
            while line := file.readline(_LONGEST):
                header._take(path, line)
                if line.split()[:1] == [b"end_header"]:
                    return header
                if header.size >= _LONGEST:
                    break
        msg = f"{path.name} can't be read: it has no PLY header that ends."
        raise InvalidMeshError(msg)

    def least_bytes(self) -> int:
        """Bytes that the elements take at least."""
        if self.binary:
            return sum(element.count * element.size for element in self.elements)
        # a digit and a space or line end each
        values = sum(element.count * len(element.properties) for element in self.elements)
        return 2 * values - 1

    def _take(self, path: Path, line: bytes) -> None:
        self.lines.append(line)
        self.size += len(line)
        kind, *words = line.split() or [b""]
        if kind == b"format":
            self.binary = words[:1] != [b"ascii"]
        elif kind == b"element" and words:
            count = -1
            with contextlib.suppress(ValueError, IndexError):
                count = int(words[1])
            if count < 0:
                msg = f"{path.name} can't be read: it doesn't say how many elements it has."
                raise InvalidMeshError(msg)
            self.elements.append(PlyElement(words[0].decode(errors="replace"), count))
        elif kind == b"property" and words and self.elements:
            element = self.elements[-1]
            element.properties.append(words[-1].decode(errors="replace"))
            number = words[1] if words[0] == b"list" and len(words) > 1 else words[0]
            element.size += _SIZES.get(number, 1)
