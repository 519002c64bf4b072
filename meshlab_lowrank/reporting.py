"""Progress of a run over several holes, and its cancelling."""

from __future__ import annotations

from meshlab_lowrank.errors import InpaintCancelledError
from meshlab_lowrank.result import ProgressCallback, ProgressEvent


class Reporter:
    """Turns the stages of single holes into events of the whole run.

    Parameters
    ----------
    progress : callable or None
        Gets a `ProgressEvent`; returning False stops the run.
    holes : int
        Number of holes that are worked on.
    """

    def __init__(self, progress: ProgressCallback | None, holes: int) -> None:
        self._progress, self._holes, self._hole = progress, holes, 0

    def stage(self, name: str, fraction: float) -> None:
        """Say that a stage of the present hole begins.

        Parameters
        ----------
        name : str
        fraction : float
            Part of this hole that is done, from 0 to 1.

        Raises
        ------
        InpaintCancelledError
            If the callback returned False.
        """
        self._send(name, (self._hole + fraction) / self._holes)

    def next_hole(self) -> None:
        """Go on to the next hole; after the last one say that all is done."""
        self._hole += 1
        if self._hole == self._holes:
            self._send("done", 1.0)

    def _send(self, name: str, fraction: float) -> None:
        if self._progress is None:
            return
        hole = min(self._hole, self._holes - 1)
        if self._progress(ProgressEvent(hole, self._holes, name, fraction)) is False:
            msg = "The run was cancelled by its progress callback; the mesh is as it was."
            raise InpaintCancelledError(msg)
