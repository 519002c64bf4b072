"""The process that opens mesh files, so that a crash in a loader or filter costs one file only.

It reads one JSON job a line from standard input and writes JSON events, one a line, to what was its
standard output. On Linux each job runs in a fork of this process: what jobs need is imported once,
yet each has a process of its own. Elsewhere the process ends after one job.

Anything that arrives on standard input while a job runs, its end above all, kills the job, and at
the end everything that it started: nothing goes on working for a parent that is gone.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import sys
from typing import Any

from meshlab_lowrank import lifeline

FORKS = sys.platform == "linux"

_PULSE = 1.0  # seconds


def main() -> None:
    """Serve jobs until standard input ends."""
    channel = os.dup(1)
    sink = os.open(os.devnull, os.O_WRONLY)
    os.dup2(sink, 1)
    os.dup2(sink, 2)
    from meshlab_lowrank.isolation import jobs  # noqa: PLC0415  after the output is redirected

    try:
        _serve(jobs, channel)
    finally:
        lifeline.die_with_group()


def _serve(jobs: Any, channel: int) -> None:
    buffer = b""
    while chunk := os.read(0, 1 << 16):
        *lines, buffer = (buffer + chunk).split(b"\n")
        for line in filter(None, lines):
            job = json.loads(line)
            with contextlib.suppress(Exception):  # told by the job itself
                jobs.load_function(job)  # once for all forks
            _send(channel, {"event": "loaded"})
            if not FORKS:
                lifeline.die_with_input()
                _send(channel, _result(jobs, job, channel))
                return
            _serve_in_fork(jobs, job, channel)


def _serve_in_fork(jobs: Any, job: dict[str, Any], channel: int) -> None:
    ended, end = os.pipe()
    server = os.getpid()
    child = os.fork()
    if child == 0:
        lifeline.die_with_parent(server)
        _prepare_child(job)
        _send(channel, _result(jobs, job, channel))
        os._exit(0)  # a damaged mesh may crash in its destructor
    os.close(end)
    ready: list[int] = []
    while not ready and not _has_ended(child):
        ready, _, _ = select.select([0, ended], [], [], _PULSE)
    if 0 in ready and ended not in ready:
        os.kill(child, signal.SIGKILL)
    os.close(ended)
    _, status, usage = os.wait4(child, 0)
    os.write(channel, b"\n")  # a killed job may have left half a line
    number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    _send(channel, {"event": "exit", "signal": number, "peak_memory": usage.ru_maxrss * 1024})


def _has_ended(child: int) -> bool:
    """Whether a job is over whose pipe is still held by what it started and left running."""
    return os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None


def _prepare_child(job: dict[str, Any]) -> None:
    """Limit the memory, be the first for the out-of-memory killer."""
    import resource  # noqa: PLC0415  not on Windows

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
