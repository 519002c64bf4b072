"""Runs of the command that are to be killed: their processes, their outputs, what they leave."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import uuid
from collections.abc import Callable
from pathlib import Path

from meshlab_lowrank.scratch import SCRATCH_PREFIX

_MARK = "MESHLAB_LOWRANK_KILLS"  # in the environment of all that a case starts
_PROGRAM = """
import signal, sys
from meshlab_lowrank_command import main
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # ignored under nohup
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored behind a shell
sys.exit(main())
"""
_LIMIT = 120.0  # seconds that nothing takes unless it hangs


class Run:
    """One run of a command, with the processes that it starts.

    Parameters
    ----------
    call : callable
        Gives the arguments for a folder of outputs.
    modules : Path
        Folder of modules that come first.
    place : Path
        Gets the folders ``out`` and ``temporary``.
    """

    def __init__(self, call: Callable[[Path], list[str]], modules: Path, place: Path) -> None:
        self.out, self.temporary = place / "out", place / "temporary"
        for folder in (self.out, self.temporary):
            folder.mkdir(exist_ok=True)
        self._mark = f"{_MARK}={uuid.uuid4()}"
        name, _, value = self._mark.partition("=")
        self.process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, *call(self.out)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join([str(modules), *filter(None, sys.path)]),
                "TMPDIR": str(self.temporary),
                name: value,
            },
        )
        self.text = ""

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        for number in (*self.processes(), *([self.process.pid] if self.alive else [])):
            send(number, "SIGKILL")
        self.process.communicate()

    @property
    def alive(self) -> bool:
        """Whether the command itself still runs."""
        return self.process.poll() is None

    def wait(self) -> int:
        """Wait for the end and give the exit code, -signal if a signal ended it."""
        try:
            self.text, _ = self.process.communicate(timeout=_LIMIT)
        except subprocess.TimeoutExpired:
            return 1000
        return self.process.returncode

    def processes(self, kind: str = "") -> list[int]:
        """List the processes that the command started, all or those of a kind."""
        word = {"worker": b"isolation.worker", "renderer": b"report.rendering"}.get(kind, b"")
        mark, found = self._mark.encode(), []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != self.process.pid:
                try:
                    ours = mark in (entry / "environ").read_bytes().split(b"\0")
                    if ours and word in (entry / "cmdline").read_bytes():
                        found.append(int(entry.name))
                except OSError:  # it has just ended
                    continue
        return found

    def leftovers(self) -> list[str]:
        """List what is in the making, or was."""
        found = [*self.out.rglob(f"{SCRATCH_PREFIX}*"), *self.temporary.iterdir()]
        return [path.name for path in (*found, *self.out.glob(".manifest.lock"))]


def send(number: int, name: str) -> bool:
    """Send a signal by its name; False if the process is gone."""
    try:
        os.kill(number, getattr(signal, name))
    except ProcessLookupError:
        return False
    return True


def faults_of_files(wholes: Path, out: Path, *, exact: bool) -> list[str]:
    """Check that every file is as a run wrote it that nobody killed.

    Parameters
    ----------
    wholes, out : Path
        Folders of the outputs of the one and of the other.
    exact : bool
        Whether every filler must have filled.

    Returns
    -------
    list of str
        What is wrong.
    """
    wrong = []
    for path in sorted(out.iterdir()):
        whole = wholes / path.name
        if path.name.startswith("."):
            continue
        if not whole.exists():
            wrong.append(f"{path.name} is no output")
        elif path.suffix == ".ply" and path.read_bytes() != whole.read_bytes():
            wrong.append(f"{path.name} is another mesh")
        elif path.suffix == ".html" and not path.read_text(encoding="utf-8").rstrip().endswith(
            "</html>"
        ):
            wrong.append(f"{path.name} is cut short")
        elif path.suffix == ".csv" and _rows(path, exact=exact) != _rows(whole, exact=exact):
            wrong.append(f"{path.name} has other rows")
        elif path.suffix == ".jsonl":
            wrong += _faults_of_manifest(path, out)
    return wrong


def _faults_of_manifest(path: Path, out: Path) -> list[str]:
    lines = path.read_text(encoding="utf-8").splitlines()
    wrong = []
    for number, line in enumerate(lines):
        try:
            record = json.loads(line)
        except ValueError:
            if number + 1 < len(lines) and not lines[number + 1].startswith("{"):
                wrong.append(f"line {number + 1} of the manifest is cut short")
            continue
        if record["status"] == "done" and not (out / record["output"]).exists():
            wrong.append(f"{record['output']} is noted and not there")
    return wrong


def _rows(path: Path, *, exact: bool) -> list[tuple[str, ...]]:
    names = ("hole", "place", "filler", *(["status"] if exact else []))
    with path.open(newline="") as file:
        return [tuple(row[name] for name in names) for row in csv.DictReader(file)]
