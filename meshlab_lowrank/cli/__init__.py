"""The command ``meshlab-lowrank``: exit code 0 done, 1 something not done, 2 wrong call."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from typing import NoReturn

from meshlab_lowrank.cli import batch, compare, console, holes, inpaint, run
from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.plain_text import plain
from meshlab_lowrank.version import __version__

COMMANDS = (holes, inpaint, compare, batch, run)


class _Parser(argparse.ArgumentParser):
    """Tells what is wrong with a call without the control characters in it."""

    def error(self, message: str) -> NoReturn:
        super().error(plain(message))


def build_parser() -> argparse.ArgumentParser:
    """Build the parser of the whole command line."""
    parser = _Parser(
        prog="meshlab-lowrank",
        description="Fill the holes of triangle meshes and bring back the lost surface detail.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_parser(subparsers)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str or None
        Arguments; None takes those of the process.

    Returns
    -------
    int
        0 done; 1 something was not filled or not done; 2 the call was wrong.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # file names need not be text
    args = build_parser().parse_args(argv)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return int(args.run(args))
    except InvalidParameterError as error:
        return console.fail(str(error), 2, as_json=args.json)
    except LowrankError as error:
        return console.fail(str(error), 1, as_json=args.json)
    except OSError as error:
        place = f": {error.filename}" if error.filename else ""
        reason = f"{error.strerror or error}{place}."
        return console.fail(reason, 1, as_json=args.json)
    except KeyboardInterrupt:
        return console.fail("Stopped; no half file was left.", 1, as_json=args.json)
