"""The command line that does what a batch run did."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path


def command_line(
    in_dir: str | Path,
    out_dir: str | Path,
    parameters: Mapping[str, str],
    *,
    chain: str | Path | None = None,
    repair: bool = False,
    suffix: str | None = None,
    workers: int | None = None,
    timeout: float | None = None,
    pictures: bool = True,
) -> str:
    """Write a call of ``meshlab-lowrank batch``, without what holds by default.

    Parameters
    ----------
    in_dir, out_dir : str or Path
    parameters : mapping of str to str
        See `parameter_texts`.
    chain, repair, suffix, workers, timeout, pictures
        As in `batch`.

    Returns
    -------
    str
        Quoted for a shell.
    """
    words = ["meshlab-lowrank", "batch", str(in_dir), str(out_dir)]
    options = {"chain": chain, "format": suffix and suffix.lstrip("."), "workers": workers}
    for name, value in {**options, "timeout": timeout, **parameters}.items():
        if value == "true":
            words.append(f"--{name}")
        elif value not in (None, "false"):
            words += [f"--{name}", f"{value:g}" if isinstance(value, float) else str(value)]
    words += ["--repair"] * repair + ["--no-pictures"] * (not pictures)
    return shlex.join(words)
