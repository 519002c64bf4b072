"""One file from input to published output: hash, work in an isolated process, move into place."""

from __future__ import annotations

import atexit
import errno
import os
import threading
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from meshlab_lowrank.isolation.pool import WorkerPool
from meshlab_lowrank.isolation.process import Ending, EventCallback
from meshlab_lowrank.mesh_files import is_free, kind_of, marks_path, plain_name, sha256_of
from meshlab_lowrank.plain_text import gist_line
from meshlab_lowrank.scratch import scratch_folder
from meshlab_lowrank.version import __version__

_PROCESS = "meshlab_lowrank.folders.tasks:process"

_shared_pool: WorkerPool | None = None
_making = threading.Lock()


@dataclass(frozen=True, kw_only=True)
class FileJob:
    """What is to be done with one file; can be sent to another machine.

    Attributes
    ----------
    name : str
        The input relative to its folder, with forward slashes.
    source, target : str
        Absolute paths.
    output : str
        The target relative to its folder.
    parameters : dict
        Values of the filter as text.
    chain : str
        Absolute path of a chain to run instead of the filter; empty for none.
    repair : bool
        Whether the mesh is repaired first.
    picture : str
        Absolute path of a picture of the fills and their error bars; empty for none.
    note : str
        What is to be told in the record; empty for nothing.
    settings : str
        Hash of everything but the input that decides the output.
    timeout : float or None
        In seconds.
    memory : int
        Limit in bytes; 0 for none.
    need : int
        Bytes that it will probably take. After a crash it gets all there are.
    threads : int
        For the solver; 0: one a core.
    attempt : int
        From 1.
    previous : dict or None
        The last record of the file in the manifest.
    """

    name: str
    source: str
    target: str
    output: str
    parameters: dict[str, str] = field(default_factory=dict)
    chain: str = ""
    repair: bool = False
    picture: str = ""
    note: str = ""
    settings: str = ""
    timeout: float | None = None
    memory: int = 0
    need: int = 0
    threads: int = 0
    attempt: int = 1
    previous: dict[str, Any] | None = None


@dataclass(frozen=True, kw_only=True)
class FileRecord:
    """What became of one file: a line of the manifest.

    Attributes
    ----------
    file, output : str
        Input and output, relative to their folders; no output if none was written.
    status : str
        "done", "nothing to fill", "partly filled", "failed", "timed out", "crashed" or "skipped".
    reason : str
        Why, if the status is not "done".
    notes : list of str
        What the loader or a repair changed, and what is wrong with the mesh.
    input_sha256 : str
    parameters : dict
        Values of the filter as text.
    chain : str
        Path of the chain that ran instead of the filter; empty for none.
    settings : str
        Hash of parameters, text of the chain and format.
    version : str
        Of this package.
    started : str
        UTC, ISO 8601.
    seconds, filter_seconds : float
        Wall time of the whole file and of the filters alone.
    peak_memory : int
        In bytes; 0 if not known.
    output_bytes : int
    attempts : int
    holes : list of dict
        The records of the holes.
    traceback : str
        Of an error that nobody foresaw.
    """

    file: str
    output: str = ""
    status: str
    reason: str = ""
    notes: list[str] = field(default_factory=list)
    input_sha256: str = ""
    parameters: dict[str, str] = field(default_factory=dict)
    chain: str = ""
    settings: str = ""
    version: str = ""
    started: str = ""
    seconds: float = 0.0
    filter_seconds: float = 0.0
    peak_memory: int = 0
    output_bytes: int = 0
    attempts: int = 1
    holes: list[dict[str, Any]] = field(default_factory=list)
    traceback: str = ""

    def __repr__(self) -> str:
        """Tell the gist on a line."""
        gist = f"{self.status}, {len(self.holes)} holes, {self.seconds:.1f} s"
        return gist_line("FileRecord", gist, self.file, self.reason)

    @property
    def complete(self) -> bool:
        """Whether every hole that was to be filled is filled."""
        finished = self.status in ("done", "nothing to fill", "skipped")
        return finished and all(hole["status"] != "failed" for hole in self.holes)

    def as_dict(self) -> dict[str, Any]:
        """Give the record as a plain dictionary, ready for JSON."""
        return asdict(self)


def run_file(
    job: FileJob, *, pool: WorkerPool | None = None, on_event: EventCallback | None = None
) -> FileRecord:
    """Do one file, unless its last record says that it is done already.

    Parameters
    ----------
    job : FileJob
    pool : WorkerPool or None
        Lends the process; None: a pool of this process.
    on_event : callable or None
        Called with the progress events of the work.

    Returns
    -------
    FileRecord
        Never raises for what is wrong with the file, the disk or the mesh.
    """
    started = datetime.now(timezone.utc).isoformat(timespec="seconds")
    facts: dict[str, Any] = {"file": job.name, "started": started, "attempts": job.attempt}
    try:
        if kind := kind_of(Path(job.source)):
            reason = f"{Path(job.name).name} is {kind} and not a file; take it out of the folder."
            return FileRecord(**facts, status="failed", reason=reason)
        facts["input_sha256"] = sha256_of(Path(job.source))
        facts |= {"settings": job.settings, "version": __version__}
        facts |= {"parameters": job.parameters, "chain": job.chain}
        if job.previous and _is_done(job, facts):
            reason = f"Done already. {job.previous['reason']}".strip()  # what stayed open still is
            return FileRecord(**{**job.previous, "status": "skipped", "reason": reason})
        return _work(job, facts, pool or _own_pool(), on_event)
    except OSError as error:
        reason = f"{error.strerror or error}: {error.filename or job.target}."
        return FileRecord(**facts, status="failed", reason=reason)


def _work(
    job: FileJob, facts: dict[str, Any], pool: WorkerPool, on_event: EventCallback | None
) -> FileRecord:
    target = Path(job.target)
    target.parent.mkdir(parents=True, exist_ok=True)
    with scratch_folder(target.parent) as scratch:
        order = {
            "function": _PROCESS,
            "source": job.source,
            "target": str(scratch / target.name),
            "parameters": job.parameters,
            "chain": job.chain,
            "repair": job.repair,
            "picture": job.picture,
            "memory": job.memory,
            "threads": job.threads,
        }
        with pool.borrowed(job.need if job.attempt == 1 else job.memory) as worker:
            ending = worker.run(order, timeout=job.timeout, on_event=on_event)
        facts |= {"seconds": round(ending.seconds, 3), "peak_memory": ending.peak_memory}
        if ending.report is None:
            return FileRecord(**facts, **_death(ending, job))
        report = ending.report
        facts |= {"status": report["status"], "reason": report["reason"]}
        noted = [job.note] if job.note and report.get("written") else []
        facts |= {"notes": noted + report.get("notes", []), "holes": report.get("holes", [])}
        facts["traceback"] = report.get("traceback", "")
        facts["filter_seconds"] = round(report.get("filter_seconds", 0.0), 3)
        if report.get("written"):
            publish(scratch, target)
            facts |= {"output": job.output, "output_bytes": target.stat().st_size}
    return FileRecord(**facts)


def publish(scratch: Path, target: Path) -> None:
    """Move everything that was written into place, the mesh last; change nothing else there.

    Parameters
    ----------
    scratch : Path
        A folder on the same file system as the target that holds the mesh under the target's name
        and its companions (materials, textures, marks).
    target : Path

    Raises
    ------
    OSError
        If something can't be moved, or a companion would replace another file.
    """
    companions = [p for p in sorted(scratch.rglob("*")) if p.is_file()]
    companions.remove(scratch / target.name)
    own = {target.with_name(f"{plain_name(target.name)}.mtl"), marks_path(target)}
    places = [target.parent / path.relative_to(scratch) for path in companions]
    for path, place in zip(companions, places, strict=True):
        if place not in own and not is_free(place, path):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(place))
    for path, destination in zip(
        (*companions, scratch / target.name), (*places, target), strict=True
    ):
        destination.parent.mkdir(parents=True, exist_ok=True)
        with path.open("rb+") as file:
            os.fsync(file.fileno())
        path.replace(destination)


def _death(ending: Ending, job: FileJob) -> dict[str, Any]:
    if ending.timed_out:
        return {"status": "timed out", "reason": f"It took longer than {job.timeout:g} s."}
    return {"status": "crashed", "reason": ending.cause}


def _is_done(job: FileJob, facts: dict[str, Any]) -> bool:
    """Whether the last record has an output, made from the same input in the same way."""
    last = job.previous or {}
    target = Path(job.target)
    return bool(
        all(last.get(key) == facts[key] for key in ("input_sha256", "settings", "version"))
        and last.get("output") == job.output
        and target.is_file()
        and target.stat().st_size == last.get("output_bytes")
    )


def _own_pool() -> WorkerPool:
    global _shared_pool  # noqa: PLW0603  one pool a process, made when first needed
    with _making:  # by one of the threads of a dask worker
        if _shared_pool is None:
            _shared_pool = WorkerPool()
            atexit.register(_shared_pool.close)
        return _shared_pool
