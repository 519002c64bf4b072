"""The lock that keeps a second run out of a folder of outputs, and of those above and below it.

A run holds the folder alone and shares those above with others. The locks are on the folders
themselves, so nothing that is written into one, or deleted there, opens it. Where folders can't be
locked (Windows, NFS) a file in each takes their place, which is worth as much as that file is kept.
"""

from __future__ import annotations

import contextlib
import os
import stat
import time
from collections.abc import Iterator
from pathlib import Path

from meshlab_lowrank.errors import LowrankError
from meshlab_lowrank.locking import lock_folder, same_file, try_lock

LOCK_NAME = ".manifest.lock"
_TRIES, _PAUSE = 5, 0.1  # seconds; others may hold a folder for a moment


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder of outputs.

    The lock belongs to the process and falls with it, however it ends.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    LowrankError
        If another run works on it, on a folder above or on one below.
    """
    folder = folder.resolve()
    with contextlib.ExitStack() as held:
        if not _lock_folders(folder, held):
            _lock_files(folder, held)
            yield
            return
        note = folder / LOCK_NAME
        _write_owner(note)
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                note.unlink()


def _lock_folders(folder: Path, held: contextlib.ExitStack) -> bool:
    """Lock a folder, and those above as shared; False if this one can't be locked."""
    try:
        if not _hold(folder, held, shared=False):
            raise _refusal(folder, _place_of_owner(folder))
    except OSError:
        return False
    for above in folder.parents:
        with contextlib.suppress(OSError):  # not ours to open, so no other run of ours works there
            if not _hold(above, held, shared=True):
                raise _refusal(folder, above)
    return True


def _hold(folder: Path, held: contextlib.ExitStack, *, shared: bool) -> bool:
    for attempt in range(_TRIES):
        time.sleep(_PAUSE if attempt else 0.0)
        descriptor = lock_folder(folder, shared=shared)
        if descriptor is not None:
            held.callback(os.close, descriptor)
            return True
    return False


def _lock_files(folder: Path, held: contextlib.ExitStack) -> None:
    """Hold the lock file of a folder; see that nobody holds one above or below."""
    own = folder / LOCK_NAME
    if not _hold_file(own, held):
        raise _refusal(folder, folder)
    _write_owner(own)
    held.callback(_write_owner, own, "")
    others = (*(above / LOCK_NAME for above in folder.parents), *folder.rglob(LOCK_NAME))
    for other in others:
        with contextlib.ExitStack() as probe:
            if other != own and other.is_file() and not _hold_file(other, probe):
                raise _refusal(folder, other.parent)


def _hold_file(path: Path, held: contextlib.ExitStack) -> bool:
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT)
    held.callback(os.close, descriptor)
    return try_lock(descriptor) and same_file(descriptor, path)


def _write_owner(path: Path, owner: str | None = None) -> None:
    """Note the number of this process, or nothing; it is only for a message."""
    flags = os.O_WRONLY | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with contextlib.suppress(OSError):
        descriptor = os.open(path, flags)
        try:
            if stat.S_ISREG(os.fstat(descriptor).st_mode):
                os.ftruncate(descriptor, 0)
                os.write(descriptor, (str(os.getpid()) if owner is None else owner).encode())
        finally:
            os.close(descriptor)


def _owner(folder: Path) -> str:
    path = folder / LOCK_NAME
    with contextlib.suppress(OSError):
        text = path.read_bytes()[:20].decode(errors="replace") if path.is_file() else ""
        if text.isascii() and text.isdigit():
            return text
    return ""


def _place_of_owner(folder: Path) -> Path:
    """Find the folder whose run holds this one: itself, or one below."""
    candidates = (folder, *(note.parent for note in folder.rglob(LOCK_NAME)))
    return next((place for place in candidates if _owner(place)), folder)


def _refusal(folder: Path, place: Path) -> LowrankError:
    working = f"Another run (process {_owner(place) or 'unknown'}) is working on {place}"
    if place == folder:
        return LowrankError(f"{working}; wait until it ends.")
    where = "in" if place.is_relative_to(folder) else "above"
    return LowrankError(
        f"{working}, which is {where} {folder}; wait until it ends or choose another output folder."
    )
