"""Progress of clusters of holes, which may be worked on at the same time."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any

import numpy as np

from meshlab_lowrank.errors import InpaintCancelledError
from meshlab_lowrank.pipeline import StageReport
from meshlab_lowrank.reporting import Reporter

FAIRED = 0.1  # part of the work that is done when all fills are smooth
_STOPPED = "The run was stopped; the mesh is as it was."


class Progress:
    """What is done of several clusters, which may be worked on at the same time.

    Parameters
    ----------
    reporter : Reporter
        Is called in the thread that made this, and in no other.
    sizes : sequence of int
        Number of holes of each cluster.
    """

    def __init__(self, reporter: Reporter, sizes: Sequence[int]) -> None:
        self._reporter, self._sizes = reporter, np.array(sizes, dtype=np.float64)
        self._parts = np.zeros(len(sizes))
        self._shared, self._stopped = False, threading.Event()
        self._events: queue.SimpleQueue[tuple[int, str, float]] = queue.SimpleQueue()

    def share(self) -> None:
        """Let other threads report."""
        self._shared = True

    def stop(self) -> None:
        """End the work of other threads at their next report."""
        self._stopped.set()

    def reports(self, number: int) -> StageReport:
        """Give the callback for the stages of one cluster."""

        def report(stage: str, part: float) -> None:
            if self._stopped.is_set():
                raise InpaintCancelledError(_STOPPED)
            if self._shared:
                self._events.put((number, stage, part))
            else:
                self._tell(number, stage, part)

        return report

    def done(self, number: int) -> None:
        """Say that a cluster is done."""
        self._parts[number] = 1.0
        self._reporter.done(int(self._sizes[number]))

    def as_completed(self, futures: Sequence[Future[Any]]) -> Iterator[int]:
        """Give the numbers of clusters as they end, and tell of the stages meanwhile."""
        for number, future in enumerate(futures):
            future.add_done_callback(self._ended(number))
        left = len(futures)
        while left:
            number, stage, part = self._events.get()
            if stage:
                self._tell(number, stage, part)
            else:
                left -= 1
                yield number

    def _ended(self, number: int) -> Callable[[Future[Any]], None]:
        return lambda _: self._events.put((number, "", 1.0))

    def _tell(self, number: int, stage: str, part: float) -> None:
        self._parts[number] = max(self._parts[number], part)
        share = float(self._parts @ self._sizes / self._sizes.sum())
        self._reporter.stage(stage, FAIRED + (1.0 - FAIRED) * share)
