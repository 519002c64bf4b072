"""Running jobs in processes of their own, which are kept warm, lent out and ended together."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from meshlab_lowrank.errors import InpaintCancelledError, InvalidParameterError, LowrankError
from meshlab_lowrank.isolation.memory import MemoryGate
from meshlab_lowrank.isolation.process import EventCallback, IsolatedWorker
from meshlab_lowrank.scratch import scratch_folder, sweep

MOST_SECONDS = 1e9  # that a job may be given; timers take no more than about nine times that


def run_isolated(job: dict[str, Any], on_event: EventCallback | None = None) -> dict[str, Any]:
    """Run one job in a process that is started for it.

    Parameters
    ----------
    job : dict
        Ready for JSON; see `isolation.jobs`.
    on_event : callable or None
        Called with each progress event of the job.

    Returns
    -------
    dict
        The report of the job.

    Raises
    ------
    InvalidParameterError
        If the call is to blame.
    LowrankError
        If the job failed or its process died.
    """
    with contextlib.closing(WorkerPool()) as pool, pool.borrowed() as worker:
        ending = worker.run(job, on_event=on_event)
    if ending.report is None:
        raise LowrankError(ending.cause)
    if ending.report["status"] == "failed":
        wrong_call = ending.report["wrong_call"]
        raise (InvalidParameterError if wrong_call else LowrankError)(ending.report["reason"])
    return ending.report


class WorkerPool:
    """Isolated workers that threads borrow and give back.

    Parameters
    ----------
    memory : int
        Bytes that may be lent out with them; 0: no limit.
    """

    def __init__(self, memory: int = 0) -> None:
        self._gate = MemoryGate(memory)
        self._lock = threading.Lock()
        self._idle: list[IsolatedWorker] = []
        self._busy: list[IsolatedWorker] = []
        self._closed = False
        self._held = contextlib.ExitStack()
        self._temporary: Path | None = None

    @contextlib.contextmanager
    def borrowed(self, need: int = 0) -> Iterator[IsolatedWorker]:
        """Lend an idle worker, or a new one, as soon as there is the memory for its job.

        Parameters
        ----------
        need : int
            Bytes that the job may take.

        Raises
        ------
        InpaintCancelledError
            If the pool is closed.
        """
        with self._gate.admitted(need):
            worker = self._lend()
            try:
                yield worker
            except BaseException:
                worker.abandon()  # what it still does is nobody's
                raise
            finally:
                with self._lock:
                    self._busy.remove(worker)
                    if worker.alive:
                        self._idle.append(worker)

    def _lend(self) -> IsolatedWorker:
        with self._lock:
            if self._closed:
                msg = "The run was stopped."
                raise InpaintCancelledError(msg)
            worker = self._warm() or IsolatedWorker(self._temporary_folder())
            self._busy.append(worker)
        return worker

    def _warm(self) -> IsolatedWorker | None:
        """Take an idle worker that lives, if there is one."""
        while self._idle:
            worker = self._idle.pop()
            if worker.alive:
                return worker
            worker.close()
        return None

    def _temporary_folder(self) -> Path:
        if self._temporary is None:
            sweep()
            self._temporary = self._held.enter_context(scratch_folder())
        return self._temporary

    def close(self) -> None:
        """Kill every worker; those who wait for one see their job die."""
        with self._lock:
            self._closed = True
            for worker in (*self._idle, *self._busy):
                worker.close()
            self._held.close()
