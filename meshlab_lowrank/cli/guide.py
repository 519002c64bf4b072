"""What stands below the options in the help of each command."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import metadata
from typing import Any

_EXIT_CODES = (
    ("1", "something was not filled or not done; the message says what"),
    ("2", "the call was wrong; nothing was done"),
    ("130", "Ctrl-C (143 and 129: SIGTERM and SIGHUP); no half file is left"),
)


def guide(
    examples: Sequence[str], *, done: str, page: str, more: Sequence[str] = ()
) -> dict[str, Any]:
    """Give the arguments of a parser for what stands below its options.

    Parameters
    ----------
    examples : sequence of str
        Calls, without the name of the program.
    done : str
        What the exit code 0 means.
    page : str
        Of the documentation.
    more : sequence of str
        Further lines, which come first.
    """
    codes = (("0", done), *_EXIT_CODES)
    lines = [
        *more,
        "examples:",
        *(f"  meshlab-lowrank {example}" for example in examples),
        "",
        "exit codes:",
        *(f"  {code:4} {meaning}" for code, meaning in codes),
        "",
        f"more: {', '.join((page, *_addresses()))}",
    ]
    return {
        "formatter_class": argparse.RawDescriptionHelpFormatter,
        "epilog": "\n".join(lines),
    }


def _addresses() -> list[str]:
    """Give the addresses of the project that the installed package names."""
    try:
        entries = metadata.metadata("meshlab-lowrank").get_all("Project-URL") or []
    except metadata.PackageNotFoundError:  # a checkout that isn't installed
        return []
    addresses = dict(entry.split(", ", 1) for entry in entries)
    wanted = ("Documentation", "Homepage", "Repository")
    return [addresses[name] for name in wanted if name in addresses][:1]
