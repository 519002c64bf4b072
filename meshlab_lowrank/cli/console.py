"""What the commands write: tables and sentences, one JSON document, progress."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from meshlab_lowrank.cli.table_layout import GAP, blocks_of
from meshlab_lowrank.errors import LowrankError
from meshlab_lowrank.isolation.process import EventCallback
from meshlab_lowrank.plain_text import plain

_PLAIN_WIDTH = 200  # for pipes and files, where nothing should be cut


def output() -> Console:
    """Give a console on standard output."""
    return _console(stderr=False)


def messages() -> Console:
    """Give a console on standard error."""
    return _console(stderr=True)


def say(text: str) -> None:
    """Write one line to standard output."""
    with _writing():
        output().print(plain(text), soft_wrap=True)


def tell(text: str) -> None:
    """Write one line to standard error, if anything can be written there."""
    with contextlib.suppress(OSError):
        messages().print(plain(text), soft_wrap=True)


def fail(sentence: str, code: int, *, as_json: bool) -> int:
    """Tell why a command failed and give its exit code."""
    tell(sentence)
    if as_json:
        with contextlib.suppress(LowrankError):
            say_json({"error": sentence})
            flush()
    return code


def say_json(document: Any) -> None:
    """Write the one JSON document of a command to standard output."""
    with _writing():
        sys.stdout.write(json.dumps(document, indent=2) + "\n")


def flush() -> None:
    """See all lines onto standard output.

    Raises
    ------
    LowrankError
        If it can't be written to.
    """
    with _writing():
        sys.stdout.flush()


def say_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table; floats get four digits.

    On a narrow terminal sentences wrap, and if that is not enough the columns stand in several
    blocks, one below the other, each led by the first column.

    Parameters
    ----------
    columns : sequence of str
    rows : iterable of sequences
        As long as ``columns``.
    """
    cells = [[_cell(value) for value in row] for row in rows]
    screen = output()
    blocks = blocks_of(columns, cells, screen.width)
    with _writing():
        for number, block in enumerate(blocks):
            table = Table(box=None, pad_edge=False, padding=(0, GAP, 0, 0))
            for j, width in zip(block.columns, block.widths, strict=True):
                table.add_column(columns[j], width=width, overflow="fold")
            for row in cells:
                table.add_row(*(row[j] for j in block.columns))
            if number:
                screen.print()
            screen.print(table)


@contextmanager
def file_progress(name: str, *, quiet: bool = False) -> Iterator[EventCallback]:
    """Show the progress of one file: a bar on a terminal, lines elsewhere, or nothing.

    Yields
    ------
    callable
        Takes the progress events of an isolated job.
    """
    screen = messages()
    if quiet:
        yield lambda _: None
        return
    if not screen.is_terminal:
        yield _lines()
        return
    columns = (SpinnerColumn(), description(), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=screen, transient=True) as progress:
        task = progress.add_task(plain(name), total=1.0)

        def show(event: dict[str, Any]) -> None:
            stage = plain(event["stage"])
            progress.update(task, description=stage, completed=event["fraction"])

        yield show


def description() -> TextColumn:
    """Give the column of a progress bar that names a task; brackets in it are only brackets."""
    return TextColumn("{task.description}", markup=False)


def _lines() -> EventCallback:
    last = ""

    def show(event: dict[str, Any]) -> None:
        nonlocal last
        if event["stage"] != last:
            last = event["stage"]
            tell(f"{event['fraction']:4.0%} {last}")

    return show


@contextmanager
def _writing() -> Iterator[None]:
    """Turn the failure to write to standard output into a sentence."""
    try:
        yield
    except OSError as error:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())  # or Python tries again at its end
        os.close(nowhere)
        msg = f"Standard output can't be written to ({error.strerror})."
        raise LowrankError(msg) from error


def _console(*, stderr: bool) -> Console:
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else _PLAIN_WIDTH
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False)


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else plain(str(value))
