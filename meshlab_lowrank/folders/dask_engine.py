"""A dask cluster as the engine of a batch run, which goes on or ends whatever becomes of it."""

from __future__ import annotations

import contextlib
import importlib
import logging
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from typing import Any

from meshlab_lowrank.errors import InvalidParameterError, MissingExtraError

_PATIENCE = 10.0  # seconds to wait for an answer
_LOST_AFTER = 60.0  # seconds without a scheduler until it is given up
_DESERTED_AFTER = 120.0  # seconds without any worker until the cluster is
_PULSE = 1.0  # seconds between two looks at the cluster
_LOGGERS = ("distributed", "distributed.client")  # which tell of each lost connection at length


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Connect to a dask cluster.

    A file whose worker dies is given to another by the scheduler, and what a lost scheduler had is
    given to the one that comes back at its address. Where none comes, or no worker, the calls that
    are left end with `concurrent.futures.BrokenExecutor`.

    Parameters
    ----------
    address : str
        Of the scheduler, ``tcp://host:8786`` say.

    Yields
    ------
    concurrent.futures.Executor

    Raises
    ------
    MissingExtraError
        If dask.distributed is not installed.
    InvalidParameterError
        If nothing answers at the address.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        msg = "Dask is not installed; install meshlab-lowrank[dask]."
        raise MissingExtraError(msg) from error

    def connect() -> Any:
        return distributed.Client(address, timeout=_PATIENCE, set_as_default=False)

    with _silence():
        try:
            client = connect()
        except (OSError, ValueError) as error:
            msg = f"No dask scheduler answers at {address}; check the address."
            raise InvalidParameterError(msg) from error
        engine = _DaskEngine(address, client, connect)
        try:
            yield engine
        finally:
            engine.shutdown()


class _DaskEngine(Executor):
    """Hands calls to a cluster and watches over it.

    Parameters
    ----------
    address : str
        Of the scheduler, for messages.
    client : distributed.Client
    connect : callable
        Makes another client.
    """

    def __init__(self, address: str, client: Any, connect: Callable[[], Any]) -> None:
        self._address = address
        self._client = client
        self._connect = connect
        self._lock = threading.Lock()
        self._calls: dict[Future[Any], Callable[[Any], Any]] = {}
        self._sent: dict[Future[Any], Any] = {}
        self._broken = ""
        self._ended = False
        self._news = threading.Event()
        self._watch = threading.Thread(target=self._look_after, daemon=True)
        self._watch.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Let a worker call a function.

        Raises
        ------
        concurrent.futures.BrokenExecutor
            If the cluster is lost.
        """
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        with self._lock:
            if self._broken:
                raise BrokenExecutor(self._broken)
            self._calls[future] = lambda client: client.submit(fn, *args, pure=False, **kwargs)
        self._news.set()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """Take back what is not done yet and leave the cluster."""
        self._ended = True
        self._news.set()
        self._watch.join()
        self._give_up("The run has ended")
        _close(self._client)

    def _look_after(self) -> None:
        """Send calls, take in results, and see that there are a scheduler and workers."""
        heard = manned = time.monotonic()
        next_look = 0.0
        while not self._ended and not self._broken:
            self._send()
            self._receive()
            if time.monotonic() >= next_look:
                workers = self._count_workers()
                now = time.monotonic()
                next_look = now + _PULSE
                heard = now if workers is not None else heard
                manned = now if workers or workers is None else manned
                if now - heard > _LOST_AFTER:
                    self._give_up(f"The dask scheduler at {self._address} was lost")
                elif now - manned > _DESERTED_AFTER:
                    self._give_up(f"The dask scheduler at {self._address} has no workers any more")
            self._news.wait(_PULSE)
            self._news.clear()

    def _send(self) -> None:
        """Send what no scheduler has: new calls, and those that were lost with one."""
        if self._client.status != "running":
            return
        with self._lock:
            calls = list(self._calls.items())
        for future, call in calls:
            sent = self._sent.get(future)
            if sent is None or sent.status == "cancelled":
                self._sent[future] = sent = call(self._client)
                sent.add_done_callback(lambda _: self._news.set())

    def _receive(self) -> None:
        for future, sent in list(self._sent.items()):
            if sent.status not in ("finished", "error"):
                continue
            with contextlib.suppress(Exception):  # of a worker or scheduler lost meanwhile
                error = sent.exception(timeout=_PATIENCE)
                result = None if error else sent.result(timeout=_PATIENCE)
                with self._lock:
                    del self._calls[future], self._sent[future]
                if error:
                    future.set_exception(error)
                else:
                    future.set_result(result)

    def _count_workers(self) -> int | None:
        """Ask how many workers there are: None if nobody answers."""
        try:
            if self._client.status == "closed":  # it has given up
                self._client = self._connect()
                self._sent.clear()
            return len(self._client.sync(self._client.scheduler.ncores, callback_timeout=_PATIENCE))
        except Exception:  # noqa: BLE001  dask raises what it likes
            return None

    def _give_up(self, reason: str) -> None:
        with self._lock:
            self._broken = reason
            left = list(self._calls)
            self._calls.clear()
        for future in left:
            future.set_exception(BrokenExecutor(reason))


def _close(client: Any) -> None:
    """Leave a cluster, also one that doesn't answer."""
    with contextlib.suppress(Exception):
        client.close(timeout=_PATIENCE)


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    loggers = [logging.getLogger(name) for name in _LOGGERS]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
