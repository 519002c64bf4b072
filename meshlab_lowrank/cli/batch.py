"""``meshlab-lowrank batch IN_DIR OUT_DIR``: a folder of scans."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TimeRemainingColumn,
)

from meshlab_lowrank.chains import ready_chains
from meshlab_lowrank.cli import console
from meshlab_lowrank.cli.guide import guide
from meshlab_lowrank.cli.inpaint import add_parameters, add_quiet, add_repair, parameters_of
from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.folders.dask_engine import dask_executor
from meshlab_lowrank.folders.dispatch import BatchCallback, BatchEvent
from meshlab_lowrank.folders.run import BatchResult, batch
from meshlab_lowrank.folders.summary_page import PAGE_NAME
from meshlab_lowrank.plain_text import plain


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "batch",
        help="fill the holes of every mesh in a folder",
        description="Fill the holes of every mesh in a folder; run it again to go on.",
        **guide(
            [
                "batch scans filled",
                "batch scans filled --workers 4 --timeout 600 --maxholesize 400",
                "batch scans filled --chain clean-and-inpaint",
            ],
            done="every file is done, was done before or has nothing to fill",
            page="docs/batch.md",
        ),
    )
    add = parser.add_argument
    add("in_dir", type=Path, metavar="IN_DIR", help="folder of meshes, with those below it")
    add("out_dir", type=Path, metavar="OUT_DIR", help="folder to write to; run again to go on")
    names = ", ".join(ready_chains())
    add("--chain", help=f"run this chain instead of the filter: a file, or one of {names}")
    add(
        "--format",
        metavar="SUFFIX",
        help="format of the outputs (that of the inputs; PLY for those that MeshLab only reads)",
    )
    add(
        "--workers",
        type=int,
        metavar="COUNT",
        help="most files at a time (as many as cores)",
    )
    add("--timeout", type=float, metavar="SECONDS", help="give a file up after this time (never)")
    add("--dask", metavar="ADDRESS", help="work on the dask cluster with this scheduler")
    add("--no-pictures", action="store_true", help="leave the pictures out of the summary page")
    add("--json", action="store_true", help="write one JSON document")
    add_quiet(parser)
    add_repair(parser)
    add_parameters(parser)
    parser.set_defaults(
        run=run, going_on="Run the same command again to go on with the files that are left."
    )


def run(args: argparse.Namespace) -> int:
    """Work through the folder; see `meshlab_lowrank.cli.main` for the exit code."""
    parameters = parameters_of(args)
    if args.chain and parameters:
        msg = f"A chain sets its own parameters; leave out --{next(iter(parameters))} or --chain."
        raise InvalidParameterError(msg)
    if args.chain and args.repair:
        msg = "A chain has its own steps; leave out --repair or --chain."
        raise InvalidParameterError(msg)
    engine = dask_executor(args.dask) if args.dask else contextlib.nullcontext()
    with _display(quiet=args.quiet) as show, engine as executor:
        result = batch(
            args.in_dir,
            args.out_dir,
            parameters=parameters,
            chain=args.chain,
            repair=args.repair,
            suffix=args.format and f".{args.format.lower().lstrip('.')}",
            workers=args.workers,
            timeout=args.timeout,
            executor=executor,
            pictures=not args.no_pictures,
            progress=show,
        )
    _show_result(result, args)
    return 0 if result.complete else 1


def _show_result(result: BatchResult, args: argparse.Namespace) -> None:
    for sentence in (*result.notes, *result.problems):
        console.tell(sentence)
    if args.json:
        files = [record.as_dict() for record in result.records]
        counts, seconds = result.counts, round(result.seconds, 3)
        document = {"counts": counts, "seconds": seconds, "notes": result.notes}
        console.say_json({**document, "problems": result.problems, "files": files})
        return
    unfinished = [record for record in result.records if not record.complete]
    if unfinished:
        console.say_table(
            ("file", "status", "reason"), ((r.file, r.status, r.reason) for r in unfinished)
        )
    console.say_table(("status", "files"), result.counts.items())
    page = "" if result.problems else f"; see {args.out_dir / PAGE_NAME}"
    console.say(f"{result.seconds:.1f} s{page}")


@contextlib.contextmanager
def _display(*, quiet: bool) -> Iterator[BatchCallback]:
    """Show a line a worker and a bar with an estimate on a terminal, a line a file elsewhere."""
    screen = console.messages()
    if quiet:
        yield lambda _: None
        return
    if not screen.is_terminal:
        yield _line
        return
    columns = (
        console.description(),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=screen, transient=True) as progress:
        yield _LiveLines(progress).show


def _line(event: BatchEvent) -> None:
    if event.record:
        record = event.record
        detail = record.reason or f"{record.seconds:.1f} s"
        console.tell(f"[{event.done}/{event.total}] {record.file} {record.status}: {detail}")


class _LiveLines:
    """One bar for the folder, one for each file that is being worked on."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._all = progress.add_task("files", total=None)
        self._files: dict[str, TaskID] = {}

    def show(self, event: BatchEvent) -> None:
        """Take in one event, from any thread."""
        self._progress.update(self._all, completed=event.done, total=event.total)
        if event.record:
            if event.file in self._files:
                self._progress.remove_task(self._files.pop(event.file))
            return
        if event.file not in self._files:
            self._files[event.file] = self._progress.add_task(plain(event.file), total=100)
        text = plain(f"{event.file}: {event.stage}")
        completed = round(100 * event.fraction)
        self._progress.update(self._files[event.file], description=text, completed=completed)
