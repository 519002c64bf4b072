"""Text from outside, such as the name of a file, made safe to show."""

from __future__ import annotations

import unicodedata

_HARMFUL = frozenset(
    {"Cc", "Cf", "Cs", "Zl", "Zp"}
)  # control, bidirectional, half of a pair, breaks


def plain(text: str, keep: str = "") -> str:
    r"""Write characters that would steer a terminal or turn the text around as escapes.

    Parameters
    ----------
    text : str
    keep : str
        Characters that stay as they are, ``"\n"`` say.

    Returns
    -------
    str

    Examples
    --------
    >>> plain("scan\x1b[2J.ply")
    'scan\\x1b[2J.ply'
    """
    if text.isprintable():
        return text
    return "".join(_escaped(char) if _is_harmful(char, keep) else char for char in text)


def _is_harmful(char: str, keep: str) -> bool:
    return char not in keep and unicodedata.category(char) in _HARMFUL


def _escaped(char: str) -> str:
    return char.encode("unicode_escape").decode("ascii")


def gist_line(name: str, *parts: str) -> str:
    """Give what ``repr`` shows of a result: its name and gist, within 100 characters.

    Parameters
    ----------
    name : str
    *parts : str
        Empty ones are left out; what doesn't fit is cut off.
    """
    text = plain("; ".join(filter(None, parts)))
    most = 100 - len(f"<{name}: >")
    return f"<{name}: {text if len(text) <= most else text[: most - 1] + '…'}>"
