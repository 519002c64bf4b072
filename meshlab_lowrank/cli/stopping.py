"""Stopping a command by a signal: Ctrl-C, the end of a terminal, a request to end."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from types import FrameType

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # of which no system has all
_CLEARING_UP = 5.0  # seconds in which further signals don't disturb


class Stop:
    """Turns signals into a KeyboardInterrupt, under which everything clears up, as long as entered.

    Signals that are ignored, as under ``nohup``, stay so.

    Attributes
    ----------
    number : int
        Of the signal that came; 0 if none did.
    """

    def __init__(self) -> None:
        self.number = 0
        self._settled = False
        self._last = -_CLEARING_UP
        self._held = contextlib.ExitStack()

    def __enter__(self) -> Stop:
        """Begin to listen."""
        if threading.current_thread() is threading.main_thread():
            for number in (getattr(signal, name) for name in _NAMES if hasattr(signal, name)):
                before = signal.getsignal(number)
                if before is not signal.SIG_IGN:
                    signal.signal(number, self._stop)
                    self._held.callback(signal.signal, number, before)
        return self

    def __exit__(self, *_: object) -> None:
        """Leave signals to whom they were left before."""
        self._held.close()

    def settle(self) -> None:
        """Let signals that still come be noted only: all is done or cleared up."""
        self._settled = True

    def _stop(self, number: int, _: FrameType | None) -> None:
        self.number = self.number or number
        if not self._settled and time.monotonic() - self._last > _CLEARING_UP:
            self._last = time.monotonic()
            raise KeyboardInterrupt
