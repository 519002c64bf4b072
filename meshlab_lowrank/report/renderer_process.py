"""The start of a renderer in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

_TIMEOUT = 900.0  # seconds


def run_renderer(module: str, job: Path) -> str:
    """Run a module that draws, and wait for its end.

    Parameters
    ----------
    module : str
        Takes the name of the job file and the number of this process.
    job : Path

    Returns
    -------
    str
        Why it failed, and what to do; empty if it didn't.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    ended, end = os.pipe()  # by whose end the renderer notices ours
    try:
        done = subprocess.run(  # noqa: S603  this package's own code
            [sys.executable, "-m", module, str(job), str(os.getpid())],
            stdin=ended,
            capture_output=True,
            text=True,
            env=environment,
            timeout=_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"The renderer was ended after {_TIMEOUT:g} s."
    finally:
        os.close(ended)
        os.close(end)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return (
            f"The renderer failed ({last}); it needs OpenGL in software or hardware, on Debian "
            "and Ubuntu: apt install libegl1 libgl1."
        )
    return ""
