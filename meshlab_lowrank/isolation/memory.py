"""How much memory there is, how much a file may take, and who may start."""

from __future__ import annotations

import contextlib
import re
import threading
from collections import deque
from collections.abc import Iterator
from pathlib import Path

_BYTES_PER_FILE = 1_500_000_000  # libraries and the solver of a hole of ordinary size
_BYTES_PER_BYTE = 35  # of a mesh file, measured on a million vertices with a little to spare
_BYTES_PER_BYTE_OF = {".ctm": 200, ".obj": 10, ".off": 10, ".ply": 25}
_CGROUPS = (  # of version 2 and version 1: folder, controller, limit, usage
    (Path("/sys/fs/cgroup"), "", "memory.max", "memory.current"),
    (Path("/sys/fs/cgroup/memory"), "memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
)
_CACHE = re.compile(r"^(?:total_)?inactive_file (\d+)$", re.MULTILINE)


def available_memory() -> int:
    """Memory that can be taken without swapping, in bytes; 0 if not known.

    Limits on the process's control group, as Slurm and containers set them, count.
    """
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return 0
    fields = dict(line.split(":", 1) for line in lines)
    free = 1024 * int(fields.get("MemAvailable", "0").split()[0])
    return min([free, *_group_rooms()]) if free else 0


def estimated_memory(path: Path, size: int) -> int:
    """Memory that the work on a file may take.

    Parameters
    ----------
    path : Path
        Its suffix tells how closely the file is packed.
    size : int
        In bytes.

    Returns
    -------
    int
        In bytes.
    """
    factor = _BYTES_PER_BYTE_OF.get(path.suffix.lower(), _BYTES_PER_BYTE)
    return _BYTES_PER_FILE + factor * size


class MemoryGate:
    """Lets threads in, in the order of their arrival, while what they ask for fits.

    Who asks for more than there is gets in when nobody else is inside.

    Parameters
    ----------
    total : int
        Bytes to give away; 0: no limit.
    """

    def __init__(self, total: int) -> None:
        self._total = total
        self._taken = 0
        self._waiting: deque[object] = deque()
        self._changed = threading.Condition()

    @contextlib.contextmanager
    def admitted(self, need: int) -> Iterator[None]:
        """Wait until there is room, and hold it.

        Parameters
        ----------
        need : int
            In bytes.
        """
        share = min(need, self._total)
        ticket = object()
        with self._changed:
            self._waiting.append(ticket)
            self._changed.wait_for(
                lambda: self._waiting[0] is ticket and self._taken + share <= self._total
            )
            self._waiting.popleft()
            self._taken += share
            self._changed.notify_all()
        try:
            yield
        finally:
            with self._changed:
                self._taken -= share
                self._changed.notify_all()


def _group_rooms() -> list[int]:
    """Give what is left below each memory limit on the control groups of this process."""
    rooms = []
    try:
        lines = Path("/proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
    rows = (line.split(":", 2) for line in lines)
    paths = {name: path for _, names, path in rows for name in names.split(",")}
    for root, controller, limit, usage in _CGROUPS:
        inner = Path(paths.get(controller, "/").lstrip("/"))
        for group in (root / inner, *(root / parent for parent in inner.parents)):
            with contextlib.suppress(OSError, ValueError):  # no such file, or "max"
                room = int((group / limit).read_text()) - int((group / usage).read_text())
                cache = _CACHE.search((group / "memory.stat").read_text())
                rooms.append(max(1, room + (int(cache[1]) if cache else 0)))
    return rooms
