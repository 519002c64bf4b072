"""Threads of one run: our own, with the linear algebra's held at one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def worker_threads() -> Iterator[Executor]:
    """Give a pool of threads, one a core, and hold BLAS at one thread meanwhile.

    A product that BLAS splits by itself may round differently with the number of threads; work
    that we split into fixed batches does not.
    """
    cores = os.cpu_count() or 1
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(cores) as executor:
        yield executor
