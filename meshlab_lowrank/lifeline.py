"""How a process that was started by another ends with it, even if that is killed."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading

_PR_SET_PDEATHSIG = 1  # of Linux, see prctl(2)


def die_with_parent(parent: int) -> None:
    """Let the kernel kill this process when its parent ends; Linux only, does nothing elsewhere.

    Parameters
    ----------
    parent : int
        Its process number, by which a parent is noticed that has ended already.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)


def die_with_input() -> None:
    """End this process when anything comes on standard input, its end above all.

    For a pipe whose other end the parent holds. It works on every system, and where the parent is
    a thread that may end before its process, but not in a process that forks.
    """
    threading.Thread(target=_watch, daemon=True).start()


def die_with_group() -> None:
    """Kill this process and, if it leads a process group, everything that runs in that."""
    if sys.platform != "win32" and os.getpgrp() == os.getpid():
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


def _watch() -> None:
    os.read(0, 1)
    die_with_group()
