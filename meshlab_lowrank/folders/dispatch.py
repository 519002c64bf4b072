"""Handing the files of a batch run to whoever works on them, and noting what became of each."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from meshlab_lowrank.errors import LowrankError
from meshlab_lowrank.folders.file_run import FileJob, FileRecord, run_file
from meshlab_lowrank.folders.manifest import Manifest
from meshlab_lowrank.isolation.pool import WorkerPool

_ATTEMPTS = 2  # a file is given up after its second crash
_LOOK = 0.5  # seconds after which a signal is seen that did not wake the main thread


@dataclass(frozen=True)
class BatchEvent:
    """Something that happened in a run.

    Attributes
    ----------
    file : str
    stage : str
        What its process does now; empty when the file ended.
    fraction : float
        Part of the file that is done, from 0 to 1.
    record : FileRecord or None
        What became of the file when it ended.
    done, total : int
        Files that ended, and all files.
    """

    file: str
    stage: str
    fraction: float
    record: FileRecord | None
    done: int
    total: int


BatchCallback: TypeAlias = Callable[[BatchEvent], object]


class Dispatch:
    """Hands out the jobs, takes in the records.

    Parameters
    ----------
    total : int
        Number of jobs.
    manifest : Manifest
    progress : callable or None

    Attributes
    ----------
    records : dict of str to FileRecord
        By the name of the file.
    problems : list of str
        What could not be noted.
    """

    def __init__(self, total: int, manifest: Manifest, progress: BatchCallback | None) -> None:
        self.records: dict[str, FileRecord] = {}
        self.problems: list[str] = []
        self._unsaved: list[FileRecord] = []
        self._total = total
        self._manifest = manifest
        self._progress = progress

    def go(
        self, executor: Executor, work: Callable[[FileJob], FileRecord], jobs: list[FileJob]
    ) -> None:
        """Work until every job has a record; crashed files get a second attempt at the end."""
        try:
            self._go(executor, work, jobs)
        except BrokenExecutor as error:
            reason = str(error).rstrip(".") or "The executor broke down"
            msg = f"{reason}; start the same run again, it goes on where it stopped."
            raise LowrankError(msg) from error
        finally:
            self._save()
        if self._unsaved:
            self.problems.append(
                f"{len(self._unsaved)} records are missing in {self._manifest.path}, which can't "
                "be written; make room and start the same run again."
            )

    def _go(
        self, executor: Executor, work: Callable[[FileJob], FileRecord], jobs: list[FileJob]
    ) -> None:
        pending = {_submit(executor, work, job): job for job in jobs}
        while pending:
            finished, _ = wait(pending, timeout=_LOOK, return_when=FIRST_COMPLETED)
            broken = {future for future in finished if _is_broken(future)}
            again = []
            for future in finished - broken:
                job = pending.pop(future)
                record = _record(future, job)
                if record.status == "crashed" and job.attempt < _ATTEMPTS:
                    again.append(replace(job, attempt=job.attempt + 1))
                else:
                    self._take(record)
            for future in broken:  # raises, now that all that is known is noted
                future.result()
            pending |= {_submit(executor, work, job): job for job in again}

    def go_here(self, workers: int, pool: WorkerPool, jobs: list[FileJob]) -> None:
        """Work in processes on this machine, which end with the run, however it ends."""
        threads = ThreadPoolExecutor(workers)
        try:
            self.go(threads, functools.partial(self._watched_file, pool=pool), jobs)
        except BaseException:
            threads.shutdown(wait=False, cancel_futures=True)
            pool.close()
            raise
        finally:
            threads.shutdown()

    def _watched_file(self, job: FileJob, *, pool: WorkerPool) -> FileRecord:
        """Do one file in a thread of this process and tell of its progress."""

        def on_event(event: dict[str, Any]) -> None:
            self._tell(job.name, event["stage"], event["fraction"], None)

        return run_file(job, pool=pool, on_event=on_event)

    def _take(self, record: FileRecord) -> None:
        self.records[record.file] = record
        if record.status != "skipped":
            self._unsaved.append(record)
        self._save()
        self._tell(record.file, "", 1.0, record)

    def _save(self) -> None:
        """Append what is not in the manifest yet; a full disk may have room again later."""
        with contextlib.suppress(OSError):
            while self._unsaved:
                self._manifest.append(self._unsaved[0].as_dict())
                del self._unsaved[0]

    def _tell(self, file: str, stage: str, fraction: float, record: FileRecord | None) -> None:
        if self._progress:
            done = len(self.records)
            self._progress(BatchEvent(file, stage, fraction, record, done, self._total))


def _submit(
    executor: Executor, work: Callable[[FileJob], FileRecord], job: FileJob
) -> Future[FileRecord]:
    """Hand a job out; one that a broken executor doesn't take ends like those that it had."""
    try:
        return executor.submit(work, job)
    except BrokenExecutor as error:
        refused: Future[FileRecord] = Future()
        refused.set_exception(error)
        return refused


def _is_broken(future: Future[FileRecord]) -> bool:
    return not future.cancelled() and isinstance(future.exception(), BrokenExecutor)


def _record(future: Future[FileRecord], job: FileJob) -> FileRecord:
    """Take the record of a job; an engine that lost the job has crashed on it."""
    try:
        return future.result()
    except (Exception, CancelledError) as error:  # noqa: BLE001  engines raise what they like
        reason = f"Its worker was lost ({type(error).__name__})."
        return FileRecord(file=job.name, status="crashed", reason=reason, attempts=job.attempt)
