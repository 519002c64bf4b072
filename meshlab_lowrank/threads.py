"""Threads of one run: our own, with the linear algebra's held at one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager

from threadpoolctl import threadpool_limits

from meshlab_lowrank.errors import InvalidParameterError

THREADS_VARIABLE = "MESHLAB_LOWRANK_THREADS"  # of the environment; without it, one a core


def available_cores() -> int:
    """Count the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def thread_count() -> int:
    """Give the number of threads of a run, from the environment or one a core.

    Raises
    ------
    InvalidParameterError
        If the environment says anything but a whole number of at least 1.
    """
    text = os.environ.get(THREADS_VARIABLE, "").strip()
    if not text:
        return available_cores()
    if not (text.isascii() and text.isdigit() and int(text) >= 1):
        msg = (
            f"The environment variable {THREADS_VARIABLE} is {text!r}; give a whole number of at "
            "least 1, or leave it out for one thread a core."
        )
        raise InvalidParameterError(msg)
    return int(text)


@contextmanager
def worker_threads() -> Iterator[Executor]:
    """Give a pool of threads and hold BLAS at one thread meanwhile.

    A product that BLAS splits by itself may round differently with the number of threads; work
    that we split into fixed batches does not.

    Raises
    ------
    InvalidParameterError
        See `thread_count`.
    """
    count = thread_count()
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(count) as executor:
        yield executor
