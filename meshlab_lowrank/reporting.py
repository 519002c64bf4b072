"""Progress of a run over several holes, and its cancelling."""

from __future__ import annotations

from meshlab_lowrank.errors import InpaintCancelledError
from meshlab_lowrank.result import ProgressCallback, ProgressEvent


class Reporter:
    """Turns the stages of a run into events, and counts its holes.

    Parameters
    ----------
    progress : callable or None
        Gets a `ProgressEvent`; returning False stops the run.
    holes : int
        Number of holes that are worked on.
    """

    def __init__(self, progress: ProgressCallback | None, holes: int) -> None:
        self._progress, self._holes, self._done = progress, holes, 0

    def stage(self, name: str, fraction: float) -> None:
        """Say that a stage begins.

        Parameters
        ----------
        name : str
        fraction : float
            Part of the run that is done, from 0 to 1.

        Raises
        ------
        InpaintCancelledError
            If the callback returned False.
        """
        if self._progress is None:
            return
        event = ProgressEvent(min(self._done, self._holes - 1), self._holes, name, fraction)
        if self._progress(event) is False:
            msg = "The run was cancelled by its progress callback; the mesh is as it was."
            raise InpaintCancelledError(msg)

    def done(self, holes: int) -> None:
        """Count holes that are done; after the last one say so."""
        self._done += holes
        if holes and self._done == self._holes:
            self.stage("done", 1.0)
