"""Running every filler on every job, each run in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshlab_lowrank.comparison.cases import Job
from meshlab_lowrank.comparison.task import FUNCTION
from meshlab_lowrank.isolation.pool import WorkerPool
from meshlab_lowrank.isolation.process import Ending
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.scratch import scratch_folder


@dataclass(frozen=True)
class Outcome:
    """What a filler made of a job.

    Attributes
    ----------
    filler : str
    job : Job
    status : {"filled", "not installed", "failed", "crashed", "timed out"}
    reason : str
        One sentence where it is not "filled".
    seconds, cpu_seconds : float
        Of the filler alone, without loading and starting; NaN where there is no result.
    memory : int
        Bytes at the peak beyond what the process held before; 0 if not known.
    mesh : (vertices, faces) or None
    bars : (n,) float64 or None
        Error bars of its vertices; None where the filler gives none.
    """

    filler: str
    job: Job
    status: str
    reason: str = ""
    seconds: float = float("nan")
    cpu_seconds: float = float("nan")
    memory: int = 0
    mesh: tuple[FloatArray, IntArray] | None = None
    bars: FloatArray | None = None


def run_fillers(
    jobs: Sequence[Job],
    fillers: Mapping[str, str],
    timeout: float,
    begin: Callable[[str, Job], object],
    pool: WorkerPool,
) -> Iterator[Outcome]:
    """Run fillers on jobs, one after the other, so that times can be compared.

    Parameters
    ----------
    jobs : sequence of Job
    fillers : dict of str to str
        For each name the text by which `find_filler` finds it.
    timeout : float
        Seconds after which a run is ended.
    begin : callable
        Called with the name of the filler and the job before each run.
    pool : WorkerPool

    Yields
    ------
    Outcome
    """
    with scratch_folder() as folder:
        target = folder / "result.npz"
        for number, job in enumerate(jobs):
            source = folder / f"job{number}.npz"
            np.savez(source, vertices=job.vertices, faces=job.faces, selected=job.selected)
            for filler, spec in fillers.items():
                begin(filler, job)
                target.unlink(missing_ok=True)
                call = {"filler": spec, "source": str(source), "target": str(target)}
                with pool.borrowed() as worker:
                    ending = worker.run({"function": FUNCTION, **call}, timeout=timeout)
                yield _outcome(filler, job, ending, target, timeout)


def _outcome(filler: str, job: Job, ending: Ending, target: Path, timeout: float) -> Outcome:
    if ending.timed_out:
        reason = f"It was ended after the time limit of {timeout:g} s."
        return Outcome(filler, job, "timed out", reason)
    if ending.report is None:
        return Outcome(filler, job, "crashed", ending.cause)
    report: dict[str, Any] = ending.report
    if report["status"] != "filled":
        return Outcome(filler, job, report["status"], report["reason"])
    with np.load(target) as arrays:
        mesh = arrays["vertices"], arrays["faces"]
        bars = arrays.get("bars")
    figures = report["seconds"], report["cpu_seconds"], report["memory"]
    return Outcome(filler, job, "filled", "", *figures, mesh, bars)
