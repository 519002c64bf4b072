"""The command ``meshlab-lowrank``: exit code 0 done, 1 something not done, 2 wrong call.

Stopped by a signal, it is 128 and the number of the signal, as shells have it.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from typing import NoReturn

from meshlab_lowrank.cli import batch, compare, console, holes, inpaint, run
from meshlab_lowrank.cli.guide import guide
from meshlab_lowrank.cli.stopping import Stop
from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.plain_text import plain
from meshlab_lowrank.scratch import remove_all
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
        **guide(
            [
                "holes scan.ply",
                "inpaint scan.ply whole.ply",
                "batch scans filled",
                "run clean-and-inpaint scan.ply out.ply",
                "compare scan.ply --html report.html",
                "inpaint --help",
            ],
            done="all is done",
            page="README.md",
        ),
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_parser(subparsers)
    for subparser in subparsers.choices.values():
        if subparser.get_default("going_on") is None:
            subparser.set_defaults(going_on="Run the same command again to start over.")
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
        0 done; 1 something was not filled or not done; 2 the call was wrong; 128 and the number
        of the signal that stopped it.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # file names need not be text
    args = build_parser().parse_args(_joined(sys.argv[1:] if argv is None else argv))
    with Stop() as stop:
        code, reason = _do(args, stop)
    return console.fail(reason, code, as_json=args.json) if reason else code


def _joined(argv: Sequence[str]) -> list[str]:
    """Join places to their option: one that begins with a minus would be taken for an option."""
    joined: list[str] = []
    for word in argv:
        if joined and joined[-1] == "--near":
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _do(args: argparse.Namespace, stop: Stop) -> tuple[int, str]:
    """Run a command: its exit code, and the sentence that says why it failed."""
    code, reason = 1, ""
    try:
        code = int(args.run(args))
        console.flush()
    except InvalidParameterError as error:
        code, reason = 2, str(error)
    except LowrankError as error:
        reason = str(error)
    except OSError as error:
        place = f": {error.filename}" if error.filename else ""
        reason = f"{error.strerror or error}{place}."
    except KeyboardInterrupt:
        stop.number = stop.number or signal.SIGINT
    except Exception:
        if not stop.number:  # else it came of the stop
            raise
    stop.settle()
    if stop.number:
        remove_all()
        return 128 + stop.number, f"Stopped; no half file was left. {args.going_on}"
    return code, reason
