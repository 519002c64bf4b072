"""How a table fits a terminal: widths of columns, and blocks of them where all are too many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.cells import cell_len

GAP = 2  # between columns
_WORDS = 24  # a column whose cells are longer holds sentences, which wrap
_LEAST_WORDS = 20  # width at which they are still read
_NAME = 32  # of the first column, beyond which it is folded rather than others left out


@dataclass(frozen=True)
class Block:
    """Columns that stand side by side.

    Attributes
    ----------
    columns : tuple of int
        The first of the table leads each block.
    widths : tuple of int
    """

    columns: tuple[int, ...]
    widths: tuple[int, ...]


def blocks_of(headings: Sequence[str], cells: Sequence[Sequence[str]], width: int) -> list[Block]:
    """Lay the columns of a table out, in one block if they fit and else in several below.

    Parameters
    ----------
    headings : sequence of str
        May wrap between words.
    cells : sequence of sequences of str
        Rows; the cells of numbers and names are never wrapped.
    width : int
        Of the terminal.

    Returns
    -------
    list of Block
    """
    longest = [max((cell_len(row[j]) for row in cells), default=0) for j in range(len(headings))]
    wide = [max(cell_len(name), most) for name, most in zip(headings, longest, strict=True)]
    if _total(wide) <= width:
        return [Block(tuple(range(len(headings))), tuple(wide))]
    needed = [
        max(*(cell_len(word) for word in name.split()), min(most, _LEAST_WORDS))
        if j > 0 and most > _WORDS
        else max(*(cell_len(word) for word in name.split()), most, 1)
        for j, (name, most) in enumerate(zip(headings, longest, strict=True))
    ]
    if _total(needed) > width:
        needed[0] = min(needed[0], _NAME)
    groups: list[list[int]] = [[0]]
    for j in range(1, len(headings)):
        if len(groups[-1]) > 1 and _total([needed[i] for i in (*groups[-1], j)]) > width:
            groups.append([0])
        groups[-1].append(j)
    return [_block(group, needed, wide, width) for group in groups]


def _block(group: Sequence[int], needed: Sequence[int], wide: Sequence[int], width: int) -> Block:
    """Give what is left of the width to the columns that want it most."""
    widths = {j: needed[j] for j in group}
    left = width - _total(list(widths.values()))
    for j in sorted(group, key=lambda j: needed[j] - wide[j]):
        more = max(0, min(left, wide[j] - widths[j]))
        widths[j], left = widths[j] + more, left - more
    return Block(tuple(group), tuple(min(w, width) for w in widths.values()))


def _total(widths: Sequence[int]) -> int:
    return sum(widths) + GAP * (len(widths) - 1)
