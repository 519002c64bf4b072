"""The command ``meshlab-lowrank``: it can be stopped in silence while the package loads."""

from __future__ import annotations

import os
import signal
from types import FrameType


def main() -> int:
    """Load the package and run it, see `meshlab_lowrank.cli.main`."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        defaults = (signal.SIG_DFL, signal.default_int_handler)
        if number is not None and signal.getsignal(number) in defaults:
            signal.signal(number, _leave)
    from meshlab_lowrank.cli import main as run  # noqa: PLC0415  it takes a second

    try:
        return run()
    except KeyboardInterrupt:  # before or after its work
        return 128 + signal.SIGINT


def _leave(number: int, _: FrameType | None) -> None:
    os._exit(128 + number)
