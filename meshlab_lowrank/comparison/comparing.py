"""The comparison: fillers on the real holes, and on holes punched where the surface is known."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from meshlab_lowrank.comparison.cases import ROUND, Case, Job, punched_jobs, real_job
from meshlab_lowrank.comparison.fillers import usual_fillers
from meshlab_lowrank.comparison.loading import find_filler
from meshlab_lowrank.comparison.measuring import (
    Row,
    hausdorff_figures,
    measure,
    spread_over_places,
)
from meshlab_lowrank.comparison.punching import Outline
from meshlab_lowrank.comparison.running import Outcome, run_fillers
from meshlab_lowrank.comparison.sources import MeshSource, mesh_name, read_mesh
from meshlab_lowrank.comparison.truth_check import TruthDistance, truth_distance
from meshlab_lowrank.errors import (
    InpaintCancelledError,
    InvalidMeshError,
    InvalidParameterError,
)
from meshlab_lowrank.isolation.pool import MOST_SECONDS, WorkerPool
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, edge_lengths
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.plain_text import gist_line
from meshlab_lowrank.report.pictures import ErrorMap, bar_map
from meshlab_lowrank.result import ProgressCallback, ProgressEvent
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop, boundary_loops

_PLACES = 3


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """All figures of a comparison.

    Attributes
    ----------
    name : str
        Of the mesh.
    vertices, faces : int
        Their number in the mesh.
    fillers : dict of str to str
        Names and explanations, in the order of the call.
    cases : tuple of Case
        The real holes first, then the punched ones.
    rows : tuple of Row
        One a case and filler.
    scenes : dict of (name of case, filler) to SurfacePart
        Cut-outs of the results for the pictures; the filler "" is the mesh with the hole.
    bars : dict of (name of case, filler) to ErrorMap
        Error bars of fills that carry them, for the pictures.
    notes : tuple of str
        Sentences on a truth that is none, and on what is not in the comparison, and why.
    truth_distance : TruthDistance or None
        How far the mesh is from the truth; None without.
    settings : dict
        The parameters of the call.
    seconds : float
        Of the whole run.
    """

    name: str
    vertices: int
    faces: int
    fillers: dict[str, str]
    cases: tuple[Case, ...]
    rows: tuple[Row, ...]
    scenes: dict[tuple[str, str], SurfacePart] = field(repr=False)
    notes: tuple[str, ...]
    truth_distance: TruthDistance | None
    settings: dict[str, Any]
    seconds: float
    bars: dict[tuple[str, str], ErrorMap] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        """Tell the gist on a line."""
        gist = f"{len(self.fillers)} fillers on {len(self.cases)} cases in {self.seconds:.1f} s"
        return gist_line("Comparison", gist, self.name)

    def as_dict(self) -> dict[str, Any]:
        """Give everything but the pictures, ready for JSON."""
        return {
            "mesh": self.name,
            "vertices": self.vertices,
            "faces": self.faces,
            "settings": self.settings,
            "fillers": self.fillers,
            "notes": list(self.notes),
            "truth_distance": self.truth_distance and self.truth_distance.as_dict(),
            "rows": [row.as_dict() for row in self.rows],
            "over_places": spread_over_places(self.rows),
            "seconds": self.seconds,
        }

    def select(self, case: Case, filler: str) -> Row:
        """Find the row of a case and filler."""
        wanted = (case.hole, case.place, filler)
        return next(row for row in self.rows if (row.hole, row.place, row.filler) == wanted)


def compare(
    mesh: MeshSource,
    *,
    fillers: Sequence[str | os.PathLike[str]] | None = None,
    truth: MeshSource | None = None,
    places: int | None = None,
    holes: int = 4,
    radius: float | None = None,
    closerim: bool = False,
    seed: int = 0,
    timeout: float = 600.0,
    progress: ProgressCallback | None = None,
) -> Comparison:
    """Fill the holes of a mesh with several fillers and measure what each of them made.

    Each run is a process of its own, so a filler that crashes or hangs costs a row, not the
    comparison. The mesh is not changed.

    Parameters
    ----------
    mesh : path, pymeshlab.MeshSet, or (vertices, faces)
        Of a MeshSet the current mesh is taken.
    fillers : sequence of str or path, optional
        Names of the registry, and paths of chains: ``.mlx`` filter scripts or Python files with a
        function ``chain(ms)``. Default: the registry without those that are `named_only`.
    truth : like `mesh`, optional
        The surface without the holes, in the same place. Its triangles may differ; a note says so
        if it is another surface.
    places : int, optional
        Copies of each hole that are punched where the surface is known and measured against what
        was removed. Default: 3 without `truth`, none with it.
    holes : int
        Real holes that are compared, the largest first.
    radius : float, optional
        Punch round holes of this radius in mean edge lengths rather than copies of the real
        ones; a mesh without holes needs it.
    closerim : bool
        Take outer rims of open sheets for holes too.
    seed : int
        Seed of the punched places.
    timeout : float
        Seconds that one run may take.
    progress : callable, optional
        Gets a `ProgressEvent` before each run; returning False stops the comparison.

    Returns
    -------
    Comparison

    Raises
    ------
    InvalidParameterError
        If a parameter is out of range or a filler is not known.
    InvalidMeshError
        If the mesh can't be read or there is nothing to compare on.
    InpaintCancelledError
        If `progress` returned False.

    See Also
    --------
    inpaint : Our own filler.

    Notes
    -----
    Meshes are read and worked on in processes of their own: working folder, output and MeshLab's
    defaults of this process stay alone.

    Examples
    --------
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    >>> ms.meshing_remove_selected_faces()
    >>> comparison = meshlab_lowrank.compare(ms, fillers=["close", "lowrank-none"], places=0)
    >>> [(row.filler, row.status) for row in comparison.rows]
    [('close', 'filled'), ('lowrank-none', 'filled')]
    """
    started = time.perf_counter()
    _check_call(places, holes, radius, timeout, seed)
    chosen_fillers = _find_fillers(usual_fillers() if fillers is None else fillers)
    if places is None:
        places = _PLACES if truth is None else 0
    with contextlib.closing(WorkerPool()) as pool:
        surface = read_mesh(mesh, pool)
        whole = None if truth is None else read_mesh(truth, pool)
        fillable, notes = _fillable(boundary_loops(*surface), closerim=closerim)
        distance = None if whole is None else truth_distance(surface, whole)
        if distance and truth is not None and not distance.same:
            notes.insert(0, distance.warning(mesh_name(mesh), mesh_name(truth)))
        chosen = fillable[:holes]
        if len(chosen) < len(fillable):
            notes.append(f"Smaller holes stay open and are not compared: {len(fillable) - holes}.")
            if truth is not None:
                notes.append("So there is no Hausdorff distance of the whole mesh.")
        jobs = [real_job(*surface, chosen, whole)] if chosen else []
        if places:
            outlines = _outlines(*surface, chosen, radius)
            punched = punched_jobs(*surface, outlines, places, seed)
            jobs += punched
            notes += _missing_places(outlines, punched, places)
        if not jobs:
            reason = " ".join(notes) or "The mesh has no hole."
            msg = f"{reason} There is nothing to compare on; give a radius to punch round holes."
            raise InvalidMeshError(msg)
        gathered = _Gathered(jobs, whole if len(chosen) == len(fillable) else None)
        steps = _Steps(len(jobs) * len(chosen_fillers), progress)
        specs = {name: spec for name, (spec, _) in chosen_fillers.items()}
        for outcome in run_fillers(jobs, specs, timeout, steps.begin, pool):
            gathered.add(outcome)
    return Comparison(
        name=mesh_name(mesh),
        vertices=len(surface[0]),
        faces=len(surface[1]),
        fillers={name: explanation for name, (_, explanation) in chosen_fillers.items()},
        cases=tuple(case for job in jobs for case in job.cases),
        rows=tuple(gathered.rows),
        scenes=gathered.scenes,
        bars=gathered.bars,
        notes=tuple(notes),
        truth_distance=distance,
        settings={
            "truth": None if truth is None else mesh_name(truth),
            "places": places,
            "holes": holes,
            "radius": radius,
            "closerim": closerim,
            "seed": seed,
            "timeout": timeout,
        },
        seconds=time.perf_counter() - started,
    )


class _Gathered:
    """Rows and cut-outs, outcome by outcome."""

    def __init__(self, jobs: Sequence[Job], truth: tuple[FloatArray, IntArray] | None) -> None:
        self.rows: list[Row] = []
        self.scenes: dict[tuple[str, str], SurfacePart] = {}
        self.bars: dict[tuple[str, str], ErrorMap] = {}
        self._truth = truth
        for job in jobs:
            for case in job.cases:
                nothing = np.zeros(len(job.faces), dtype=np.bool_)
                damaged = SurfacePart(job.vertices, job.faces, nothing)
                self.scenes[case.name, ""] = case.scene(damaged)

    def add(self, outcome: Outcome) -> None:
        """Measure an outcome on every hole of its job."""
        filled, hausdorff = None, {}
        if outcome.mesh is not None:
            filled = outcome.job.known.locate(*outcome.mesh)
            if self._truth is not None and outcome.job.cases[0].place == 0:
                hausdorff = hausdorff_figures(outcome.mesh, self._truth)
        for case in outcome.job.cases:
            self.rows.append(measure(outcome, filled, case, hausdorff))
            if filled is not None:
                surface = filled.surface(case.loop.id)
                cut_out = case.scene(surface)
                self.scenes[case.name, outcome.filler] = cut_out
                if outcome.bars is not None:
                    bars = bar_map(surface, outcome.bars)
                    self.bars |= {(case.name, outcome.filler): bars} if bars else {}


class _Steps:
    """Counts runs and tells the caller of each."""

    def __init__(self, number: int, progress: ProgressCallback | None) -> None:
        self._number = number
        self._done = 0
        self._progress = progress

    def begin(self, filler: str, job: Job) -> None:
        """Tell that a run begins."""
        where = "the real holes" if job.cases[0].place == 0 else "punched holes"
        event = ProgressEvent(
            self._done, self._number, f"{filler} on {where}", self._done / self._number
        )
        self._done += 1
        if self._progress is not None and self._progress(event) is False:
            msg = "The comparison was stopped."
            raise InpaintCancelledError(msg)


def _check_call(
    places: int | None, holes: int, radius: float | None, timeout: float, seed: int
) -> None:
    for name, count in {"places": places or 0, "holes": holes, "seed": seed}.items():
        if count < 0:
            msg = f"Parameter {name} is {count}; give a whole number of at least 0."
            raise InvalidParameterError(msg)
    if radius is not None and not (math.isfinite(radius) and radius > 0):
        msg = f"Parameter radius is {radius}; give a number greater than 0."
        raise InvalidParameterError(msg)
    if not 0 < timeout <= MOST_SECONDS:
        msg = (
            f"Parameter timeout is {timeout}; give a number greater than 0 and at most "
            f"{MOST_SECONDS:g}."
        )
        raise InvalidParameterError(msg)


def _find_fillers(items: Iterable[str | os.PathLike[str]]) -> dict[str, tuple[str, str]]:
    """Text by which another process finds each filler, and its explanation, by name."""
    found: dict[str, tuple[str, str]] = {}
    for item in items:
        spec = os.fspath(item)
        filler = find_filler(spec)
        if filler.name in found:
            msg = f"Filler {filler.name} is given twice; leave one out or rename its file."
            raise InvalidParameterError(msg)
        path = Path(spec)
        found[filler.name] = str(path.absolute()) if path.is_file() else spec, filler.explanation
    return found


def _fillable(
    loops: Sequence[BoundaryLoop], *, closerim: bool
) -> tuple[list[BoundaryLoop], list[str]]:
    """Give the holes that can be filled, the largest first, and sentences on the others."""
    notes = [f"Hole {loop.id} is left out: {loop.reason}" for loop in loops if loop.reason]
    rims = [loop for loop in loops if loop.is_rim and not loop.reason and not closerim]
    notes += [f"Hole {loop.id} is left out: it is the outer rim of an open sheet." for loop in rims]
    fillable = [loop for loop in loops if not loop.reason and (closerim or not loop.is_rim)]
    return sorted(fillable, key=lambda loop: (-loop.perimeter, loop.id)), notes


def _outlines(
    vertices: FloatArray, faces: IntArray, holes: Sequence[BoundaryLoop], radius: float | None
) -> list[tuple[int, Outline]]:
    if radius is not None:
        length = float(edge_lengths(vertices, faces).mean())
        return [(ROUND, Outline.disc(radius * length))]
    return [(loop.id, Outline.of_loop(vertices[loop.vertices])) for loop in holes]


def _missing_places(
    outlines: Sequence[tuple[int, Outline]], jobs: Sequence[Job], places: int
) -> list[str]:
    notes = []
    for hole, _ in outlines:
        cases = [case for job in jobs for case in job.cases if case.hole == hole]
        label = "the round hole" if hole == ROUND else f"hole {hole}"
        if len(cases) < places:
            notes.append(f"Only {len(cases)} of {places} places were found to punch {label}.")
        shrunk = min((case.size for case in cases), default=1.0)
        if shrunk < 1.0:
            notes.append(f"Copies of {label} were shrunk to {shrunk:.0%} to find room.")
    return notes
