"""Locks that belong to a process and fall with it, however it ends."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path

_FAR = 1 << 30  # Windows locks bytes, also against readers; this one no file here reaches


def lock_folder(folder: Path, *, shared: bool = False) -> int | None:
    """Try to lock a folder itself, whatever is in it.

    Parameters
    ----------
    folder : Path
    shared : bool
        Whether others may share the lock; else it is held alone.

    Returns
    -------
    int or None
        The descriptor that holds the lock until it is closed; None if another holds one against it.

    Raises
    ------
    OSError
        If the folder can't be opened, or the system or the file system (NFS, for locks that are
        held alone) doesn't lock folders.
    """
    if sys.platform == "win32":
        raise OSError(errno.ENOTSUP, os.strerror(errno.ENOTSUP), str(folder))
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    locked = False
    try:
        locked = try_lock(descriptor, shared=shared)
    finally:
        if not locked:
            os.close(descriptor)
    return descriptor if locked else None


def try_lock(descriptor: int, *, shared: bool = False) -> bool:
    """Try to lock an open file.

    Parameters
    ----------
    descriptor : int
    shared : bool
        Whether others may share the lock; on Windows none can.

    Returns
    -------
    bool
        False if another holds a lock against it.

    Raises
    ------
    OSError
        If the file system has no locks.
    """
    try:
        if sys.platform == "win32":
            import msvcrt  # noqa: PLC0415

            os.lseek(descriptor, _FAR, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl  # noqa: PLC0415

            kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
            fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):  # the latter on Windows
        return False
    return True


def same_file(descriptor: int, path: Path) -> bool:
    """Whether a path still names the open file or folder."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except OSError:
        return False
