"""A process that runs jobs one after the other: start, watch, time out, survive a crash."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from meshlab_lowrank.isolation.worker import FORKS, main

EventCallback: TypeAlias = Callable[[dict[str, Any]], object]

_PATIENCE = 10.0  # seconds for what was killed to be gone
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")


@dataclass(frozen=True)
class Ending:
    """How a job ended.

    Attributes
    ----------
    report : dict or None
        What its function returned; None if its process died first.
    signal : int
        Signal that ended the process; 0 if none did or it is not known.
    timed_out : bool
    stage : str
        Last stage that the job told of.
    peak_memory : int
        In bytes; 0 if not known.
    seconds : float
        Wall time.
    """

    report: dict[str, Any] | None
    signal: int
    timed_out: bool
    stage: str
    peak_memory: int
    seconds: float

    @property
    def cause(self) -> str:
        """Why there is no report, as a sentence."""
        name = f" ({signal.Signals(self.signal).name})" if self.signal else ""
        return f"MeshLab's process died{name} at the stage {self.stage!r}."


class IsolatedWorker:
    """One process, kept warm, that runs one job at a time (see `worker`).

    Parameters
    ----------
    temporary : Path
        Folder for what jobs write for a while.
    """

    def __init__(self, temporary: Path) -> None:
        path = os.pathsep.join(entry or str(Path.cwd()) for entry in sys.path)
        environment = {
            **os.environ,
            **dict.fromkeys(_ONE_THREAD, "1"),  # workers share the cores, BLAS must not
            **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(temporary)),
            "PYTHONPATH": path,
            "PYTHONSAFEPATH": "1",
        }
        self._process = subprocess.Popen(  # noqa: S603  this package's own code
            [sys.executable, "-c", f"from {main.__module__} import main; main()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,  # Ctrl-C reaches the parent only, which then ends its workers
        )
        self._end = threading.Thread(target=self._clear_up, daemon=True)
        self._end.start()

    def run(
        self,
        job: dict[str, Any],
        *,
        timeout: float | None = None,
        on_event: EventCallback | None = None,
    ) -> Ending:
        """Run one job to its end.

        Parameters
        ----------
        job : dict
            Ready for JSON; see `isolation.jobs`.
        timeout : float or None
            Seconds after which the job is killed.
        on_event : callable or None
            Called with each progress event of the job.

        Returns
        -------
        Ending
        """
        events = self._events()
        self._send(json.dumps(job).encode() + b"\n")
        any(event["event"] == "loaded" for event in events)  # imports don't count
        started = time.monotonic()
        expired = threading.Event()
        timer = threading.Timer(timeout or 0, self._expire, [expired])
        if timeout:
            timer.start()
        report: dict[str, Any] | None = None
        end: dict[str, Any] | None = None
        stage = "start"
        try:
            for event in events:
                if event["event"] == "exit":
                    end = event
                    break
                if event["event"] == "report":
                    report = event
                elif event["event"] == "progress":
                    stage = event["stage"]
                    if on_event:
                        on_event(event)
        finally:
            timer.cancel()
            if timeout:
                timer.join()  # a late kill must not meet the next job
        if end is None:
            self._end.join()
            self.close()
            end = {"signal": max(0, -self._process.returncode), "peak_memory": 0}
        return Ending(
            report=report,
            signal=end["signal"],
            timed_out=expired.is_set() and report is None,
            stage=stage,
            peak_memory=end["peak_memory"],
            seconds=time.monotonic() - started,
        )

    @property
    def alive(self) -> bool:
        """Whether another job can be given to it."""
        return self._end.is_alive()

    def close(self) -> None:
        """Kill the process and whatever job it runs."""
        self._kill()
        self._end.join()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()

    def abandon(self) -> None:
        """Kill the process in the midst of a job and wait until nothing of it runs any more."""
        self._kill()
        stream = self._process.stdout
        if stream is not None and sys.platform != "win32":
            until = time.monotonic() + _PATIENCE  # the end of the pipe is that of all who held it
            with contextlib.suppress(OSError, ValueError):
                while select.select([stream], [], [], max(0.0, until - time.monotonic()))[0]:
                    if not os.read(stream.fileno(), 1 << 16):
                        break
        self.close()

    def _kill(self) -> None:
        if self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                if sys.platform == "win32":
                    self._process.kill()
                else:
                    os.killpg(self._process.pid, signal.SIGKILL)

    def _clear_up(self) -> None:
        """Wait for the end of the process and kill what its job left running."""
        if hasattr(os, "waitid"):  # its number stays its own until it is waited for below
            with contextlib.suppress(ChildProcessError):  # somebody else has waited for it
                os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOWAIT)
                self._kill()
        self._process.wait()

    def _expire(self, expired: threading.Event) -> None:
        expired.set()
        if FORKS:
            self._send(b"\n")
        else:
            self._process.kill()

    def _send(self, data: bytes) -> None:
        stream = self._process.stdin
        if stream is not None:
            with contextlib.suppress(OSError, ValueError):  # its silence tells that it is dead
                stream.write(data)
                stream.flush()

    def _events(self) -> Iterator[dict[str, Any]]:
        stream = self._process.stdout
        with contextlib.suppress(ValueError):  # closed by another thread
            while stream is not None and (line := stream.readline()):
                with contextlib.suppress(json.JSONDecodeError):  # half a line of a killed job
                    yield json.loads(line)
