"""Threads of one run: our own, with the linear algebra's held at one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager

from threadpoolctl import threadpool_limits

THREADS_VARIABLE = "MESHLAB_LOWRANK_THREADS"  # of the environment; without it, one a core


@contextmanager
def worker_threads() -> Iterator[Executor]:
    """Give a pool of threads and hold BLAS at one thread meanwhile.

    A product that BLAS splits by itself may round differently with the number of threads; work
    that we split into fixed batches does not.
    """
    count = int(os.environ.get(THREADS_VARIABLE) or os.cpu_count() or 1)
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(count) as executor:
        yield executor
