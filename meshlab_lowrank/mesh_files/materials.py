"""Material libraries of OBJ files (MTL): only what they say about materials is written again."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable

from meshlab_lowrank.plain_text import plain

_NUMBERS = ("Ns", "Ni", "d", "Tr", "illum", "sharpness", "Pr", "Pm", "Ps", "Pc", "Pcr")
_COLOURS = ("Ka", "Kd", "Ks", "Ke", "Tf")
_MAPS = (
    *(f"map_{word}" for word in ("Ka", "Kd", "Ks", "Ke", "Ns", "d", "bump", "Pr", "Pm")),
    *("bump", "disp", "decal", "refl", "norm"),
)
_SPELLING = {word.lower(): word for word in (*_NUMBERS, *_COLOURS, *_MAPS)}
_OPTION = re.compile("-(blend[uv]|bm|boost|cc|clamp|imfchan|mm|[ost]|texres|type)")
_ARGUMENT = re.compile(r"[-+]?[0-9.]+(e[-+]?[0-9]+)?|on|off|[rgbmlz]|sphere|cube_[a-z]+")
_LONGEST = 256  # characters of a material's name


def rewritten(
    lines: Iterable[str], texture: Callable[[str], str] = str, *, options: bool = True
) -> str:
    """Write a material library again from its parameters.

    Parameters
    ----------
    lines : iterable of str
        Of the library.
    texture : callable
        Takes the name of a texture, gives the one to write; empty for none.
    options : bool
        Whether to keep how a texture is laid on, which MeshLab takes for part of its name.

    Returns
    -------
    str
    """
    written = (_line(line.split(), texture, options=options) for line in lines)
    return "".join(f"{line}\n" for line in written if line)


def _line(words: list[str], texture: Callable[[str], str], *, options: bool) -> str:
    if len(words) < 2:
        return ""
    keyword, *values = words
    if keyword.lower() == "newmtl":
        return f"newmtl {' '.join(values)}" if _is_plain(values) else ""
    spelling = _SPELLING.get(keyword.lower(), "")
    if spelling in _MAPS:
        return _map(spelling, values, texture, options=options)
    numbers = _finite(values[:1] if spelling in _NUMBERS else values[:3])
    return " ".join((spelling, *numbers)) if spelling and numbers else ""


def _is_plain(words: list[str]) -> bool:
    text = " ".join(words)
    return len(text) <= _LONGEST and plain(text) == text


def _finite(values: list[str]) -> list[str]:
    """Give numbers in the usual writing; nothing if one of them is none."""
    try:
        numbers = [float(value) for value in values]
    except ValueError:
        return []
    return [f"{number:.9g}" for number in numbers] if all(map(math.isfinite, numbers)) else []


def _map(keyword: str, values: list[str], texture: Callable[[str], str], *, options: bool) -> str:
    first = 0
    while first < len(values) and _OPTION.fullmatch(values[first]):
        first += 1
        while first < len(values) and _ARGUMENT.fullmatch(values[first]):
            first += 1
    name = texture(" ".join(values[first:]))
    return " ".join((keyword, *(values[:first] if options else ()), name)) if name else ""
