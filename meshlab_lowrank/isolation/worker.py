"""The process that opens mesh files, so that a crash in a loader or filter costs one file only.

It reads one JSON job a line from standard input and writes JSON events, one a line, to what was its
standard output. On Linux each job runs in a fork of this process: what jobs need is imported once,
yet each has a process of its own. Elsewhere the process ends after one job.

Anything that arrives on standard input while a job runs, its end above all, kills the job: nothing
goes on working for a parent that is gone.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import select
import signal
import sys
from typing import Any

_PR_SET_PDEATHSIG = 1  # of Linux, see prctl(2)

FORKS = sys.platform == "linux"


def main() -> None:
    """Serve jobs until standard input ends."""
    channel = os.dup(1)
    sink = os.open(os.devnull, os.O_WRONLY)
    os.dup2(sink, 1)
    os.dup2(sink, 2)
    from meshlab_lowrank.isolation import jobs  # noqa: PLC0415  after the output is redirected

    buffer = b""
    while chunk := os.read(0, 1 << 16):
        *lines, buffer = (buffer + chunk).split(b"\n")
        for line in filter(None, lines):
            job = json.loads(line)
            with contextlib.suppress(Exception):  # told by the job itself
                jobs.load_function(job)  # once for all forks
            _send(channel, {"event": "loaded"})
            if not FORKS:
                _send(channel, _result(jobs, job, channel))
                return
            _serve_in_fork(jobs, job, channel)


def _serve_in_fork(jobs: Any, job: dict[str, Any], channel: int) -> None:
    ended, end = os.pipe()
    child = os.fork()
    if child == 0:
        _prepare_child(job)
        _send(channel, _result(jobs, job, channel))
        os._exit(0)  # a damaged mesh may crash in its destructor
    os.close(end)
    ready, _, _ = select.select([0, ended], [], [])
    if ended not in ready:
        os.kill(child, signal.SIGKILL)
    os.close(ended)
    _, status, usage = os.wait4(child, 0)
    os.write(channel, b"\n")  # a killed job may have left half a line
    number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    _send(channel, {"event": "exit", "signal": number, "peak_memory": usage.ru_maxrss * 1024})


def _prepare_child(job: dict[str, Any]) -> None:
    """Die with the parent, limit the memory, be the first for the out-of-memory killer."""
    import resource  # noqa: PLC0415  not on Windows

    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    with contextlib.suppress(OSError):
        os.write(os.open("/proc/self/oom_score_adj", os.O_WRONLY), b"1000")
    if job.get("memory"):
        resource.setrlimit(resource.RLIMIT_DATA, (job["memory"], job["memory"]))


def _result(jobs: Any, job: dict[str, Any], channel: int) -> dict[str, Any]:
    return {"event": "report", **jobs.perform(job, lambda event: _send(channel, event))}


def _send(channel: int, event: dict[str, Any]) -> None:
    data = json.dumps(event).encode() + b"\n"
    while data:
        data = data[os.write(channel, data) :]
