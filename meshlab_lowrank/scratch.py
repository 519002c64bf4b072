"""Folders for what is in the making: they go when it is done, and none stays of a killed run.

Each is locked by the process that made it. One that nobody has locked is what a killed process
left, and is swept away.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from meshlab_lowrank.locking import lock_folder, same_file

SCRATCH_PREFIX = ".meshlab-lowrank-"
_TRIES, _PAUSE = 10, 0.05  # seconds

_made: set[Path] = set()  # by this process, and not removed yet


@contextlib.contextmanager
def scratch_folder(parent: Path | None = None) -> Iterator[Path]:
    """Make a folder that is removed at the end.

    Parameters
    ----------
    parent : Path or None
        Where to make it; None: where temporary files go.

    Yields
    ------
    Path

    Raises
    ------
    OSError
        If it can't be made.
    """
    place = Path(tempfile.gettempdir()) if parent is None else parent.absolute()
    descriptor = None
    while descriptor is None:
        folder = place / f"{SCRATCH_PREFIX}{secrets.token_hex(6)}"
        _made.add(folder)  # before it is there: an interrupt may come at any moment
        try:
            folder.mkdir(mode=0o700)
            descriptor = _held(folder)
            if descriptor is not None:
                yield folder
        finally:
            _remove(folder)
            if descriptor is not None and descriptor >= 0:
                os.close(descriptor)


@contextlib.contextmanager
def written_whole(target: Path) -> Iterator[Path]:
    """Give a place to write a file to, which then takes its target's place at once or not at all.

    Parameters
    ----------
    target : Path
        What is not an ordinary file, a device or pipe say, is written to as it stands.

    Yields
    ------
    Path
        Where to write.

    Raises
    ------
    OSError
        If the disk is full, with the name of the target.
    """
    try:
        if target.exists() and not target.is_file():
            yield target
            return
        place = target.resolve()  # a link stays one
        sweep(place.parent)
        with scratch_folder(place.parent) as folder:
            path = folder / target.name
            yield path
            with path.open("rb+") as file:
                os.fsync(file.fileno())
            path.replace(place)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(target)) from error


def sweep(parent: Path | None = None, *, certain: bool = False) -> None:
    """Remove what killed processes left in a folder.

    Parameters
    ----------
    parent : Path or None
        None: where temporary files go.
    certain : bool
        Whether nobody can be at work there, so that folders go even where none can be locked.
    """
    place = Path(tempfile.gettempdir()) if parent is None else parent
    with contextlib.suppress(OSError):
        for folder in place.glob(f"{SCRATCH_PREFIX}*"):
            if folder.is_dir() and not folder.is_symlink():
                _sweep(folder, certain=certain)


def remove_all() -> None:
    """Remove what an interrupt kept this process from removing."""
    for folder in list(_made):
        _remove(folder)


atexit.register(remove_all)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_made.clear)  # they are the parent's


def _held(folder: Path) -> int | None:
    """Lock a new folder: a descriptor, -1 if folders can't be locked, None if it was swept away."""
    try:
        descriptor = lock_folder(folder)
    except FileNotFoundError:
        return None
    except OSError:
        return -1
    if descriptor is not None and not same_file(descriptor, folder):
        os.close(descriptor)
        return None
    return descriptor


def _sweep(folder: Path, *, certain: bool) -> None:
    descriptor = None
    try:
        descriptor = lock_folder(folder)
    except OSError:  # can't be locked here, so nothing tells whether it is in use
        if certain:
            shutil.rmtree(folder, ignore_errors=True)
        return
    if descriptor is not None:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(descriptor)


def _remove(folder: Path) -> None:
    for _ in range(_TRIES):
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            break
        time.sleep(_PAUSE)  # a process that was killed may be about to make its last file
    _made.discard(folder)
