"""From the mesh that a filler made to the figures of each hole."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.comparison.bars import ErrorBars, error_bars
from meshlab_lowrank.comparison.cases import ROUND, Case
from meshlab_lowrank.comparison.figures import (
    ErrorFigures,
    ShapeFigures,
    error_figures,
    shape_figures,
)
from meshlab_lowrank.comparison.roughness import REACH
from meshlab_lowrank.comparison.running import Outcome
from meshlab_lowrank.mesh.filled_mesh import FilledMesh
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.plain_text import gist_line


@dataclass(frozen=True, kw_only=True)
class Row:
    """One filler on one hole.

    Attributes
    ----------
    hole, place : int
        As in `Case`.
    size : float
        Size of a punched copy over that of the real hole.
    filler : str
    status : {"filled", "left open", "not installed", "failed", "crashed", "timed out"}
    reason : str
    seconds, cpu_seconds : float
        Of the run, in which the filler filled `run_holes` holes.
    memory : int
        Bytes at its peak beyond the loaded mesh; 0 if not known.
    run_holes : int
    kept : bool
        Whether the surroundings are still those of the input.
    edge_length, diagonal : float
        Mean edge length at the hole and bounding-box diagonal, in mesh units.
    shape : ShapeFigures or None
    error : ErrorFigures or None
        In mesh units; None without truth.
    hausdorff : dict
        RMS, mean and maximum of MeshLab's Hausdorff filter over the whole mesh, both directions,
        in mesh units; empty without truth.
    bars : ErrorBars or None
        None where the filler gave none.
    """

    hole: int
    place: int
    size: float
    filler: str
    status: str
    reason: str
    seconds: float
    cpu_seconds: float
    memory: int
    run_holes: int
    kept: bool
    edge_length: float
    diagonal: float
    shape: ShapeFigures | None
    error: ErrorFigures | None
    hausdorff: dict[str, float]
    bars: ErrorBars | None = None

    def __repr__(self) -> str:
        """Tell the gist on a line."""
        hole = "round hole" if self.hole == ROUND else f"hole {self.hole}"
        where = hole + (f", place {self.place}" if self.place else "")
        error = f"RMS error {self.error.rms:.3g}" if self.error else ""
        gist = f"{self.filler} on {where}: {self.status} in {self.seconds:.1f} s"
        return gist_line("Row", gist, error, self.reason)

    def as_dict(self) -> dict[str, Any]:
        """Give the row flat and ready for JSON and CSV; what is not known is None."""
        shape = self.shape.as_dict() if self.shape else {}
        error = self.error.as_dict() if self.error else {}
        values: dict[str, Any] = {
            "hole": self.hole,
            "place": self.place,
            "size": self.size,
            "filler": self.filler,
            "status": self.status,
            "reason": self.reason,
            "seconds": self.seconds,
            "cpu_seconds": self.cpu_seconds,
            "memory_bytes": self.memory or None,
            "run_holes": self.run_holes,
            "surroundings_kept": self.kept if self.shape else None,
            "edge_length": self.edge_length,
            "diagonal": self.diagonal,
            "new_faces": shape.get("faces"),
            "self_crossing": shape.get("self_crossing"),
            "flipped": shape.get("flipped"),
            "degenerate": shape.get("degenerate"),
            "rim_angle_degrees": shape.get("rim_angle"),
            "roughness_to_surroundings": shape.get("roughness"),
            "rms": error.get("rms"),
            "rms_over_diagonal": _over(error.get("rms"), self.diagonal),
            "rms_in_edges": _over(error.get("rms"), self.edge_length),
            "max": error.get("maximum"),
            "max_over_diagonal": _over(error.get("maximum"), self.diagonal),
            "max_in_edges": _over(error.get("maximum"), self.edge_length),
            "normal_error_degrees": error.get("normal_error"),
            "roughness_to_truth": error.get("roughness"),
            "dihedral_to_truth": error.get("dihedral"),
            "looks_right": self.error.looks_right if self.error else None,
            "median_error_bar": self.bars.median if self.bars else None,
            "largest_error_bar": self.bars.largest if self.bars else None,
            "within_error_bar": self.bars.within if self.bars else None,
            "hausdorff_rms": self.hausdorff.get("rms"),
            "hausdorff_mean": self.hausdorff.get("mean"),
            "hausdorff_max": self.hausdorff.get("max"),
        }
        return {name: _known(value) for name, value in values.items()}


def measure(
    outcome: Outcome, filled: FilledMesh | None, case: Case, hausdorff: dict[str, float]
) -> Row:
    """Measure what a filler did to one hole.

    Parameters
    ----------
    outcome : Outcome
    filled : FilledMesh or None
        None where the filler gave no mesh.
    case : Case
    hausdorff : dict

    Returns
    -------
    Row
    """
    job = outcome.job
    shape, error, bars = None, None, None
    status, reason = outcome.status, outcome.reason
    if filled is not None:
        part = case.around(filled.surface(case.loop.id), (REACH + 1.0) * case.edge_length)
        if part.part.any():
            shape = shape_figures(part, case.edge_length)
            turned = int((filled.turned & (filled.loop == case.loop.id)).sum())
            shape = replace(shape, flipped=max(shape.flipped, turned))
            if case.truth is not None:
                error = error_figures(part, case.truth, case.edge_length)
            if outcome.bars is not None:
                bars = error_bars(filled, case.loop.id, outcome.bars, case.truth)
        if not filled.closed[case.loop.id]:
            status = "left open"
            reason = "Edges stayed open." if shape else "Nothing was put into the hole."
    return Row(
        hole=case.hole,
        place=case.place,
        size=case.size,
        filler=outcome.filler,
        status=status,
        reason=reason,
        seconds=outcome.seconds,
        cpu_seconds=outcome.cpu_seconds,
        memory=outcome.memory,
        run_holes=len(job.cases),
        kept=filled is not None and filled.kept,
        edge_length=case.edge_length,
        diagonal=diagonal(job.vertices),
        shape=shape,
        error=error,
        hausdorff=hausdorff,
        bars=bars,
    )


_SPREAD = (
    "seconds",
    "rim_angle_degrees",
    "roughness_to_surroundings",
    "rms_over_diagonal",
    "rms_in_edges",
    "max_over_diagonal",
    "max_in_edges",
    "normal_error_degrees",
    "roughness_to_truth",
    "dihedral_to_truth",
    "median_error_bar",
    "largest_error_bar",
    "within_error_bar",
)


def spread_over_places(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Sum up the punched copies of each hole for each filler.

    Parameters
    ----------
    rows : sequence of Row

    Returns
    -------
    list of dict
        ``hole``, ``filler``, ``places``, ``filled`` (how many of them), and for each figure of
        the filled ones, named as in `Row.as_dict`, its ``median``, ``least`` and ``most``.
    """
    groups: dict[tuple[int, str], list[Row]] = {}
    for row in rows:
        if row.place > 0:
            groups.setdefault((row.hole, row.filler), []).append(row)
    summary = []
    for (hole, filler), own in groups.items():
        filled = [row.as_dict() for row in own if row.status == "filled"]
        figures = {}
        for name in _SPREAD:
            values = [row[name] for row in filled if row[name] is not None]
            if values:
                middle = statistics.median(values)
                figures[name] = {"median": middle, "least": min(values), "most": max(values)}
        counts = {"hole": hole, "filler": filler, "places": len(own), "filled": len(filled)}
        summary.append({**counts, **figures})
    return summary


def diagonal(vertices: FloatArray) -> float:
    """Length of the diagonal of the bounding box."""
    return float(np.linalg.norm(np.ptp(vertices, axis=0)))


def hausdorff_figures(
    one: tuple[FloatArray, IntArray], other: tuple[FloatArray, IntArray]
) -> dict[str, float]:
    """Distances between two whole meshes by MeshLab's Hausdorff filter, in mesh units.

    Samples are all vertices and as many points on faces, in both directions; `max` is the larger
    of both directions, `rms` and `mean` are over both.

    Parameters
    ----------
    one, other : (vertices, faces)

    Returns
    -------
    dict
        ``rms``, ``mean`` and ``max``.
    """
    ms = pymeshlab.MeshSet(verbose=False)
    for vertices, faces in (one, other):
        ms.add_mesh(pymeshlab.Mesh(vertices, faces))
    sides = [
        ms.get_hausdorff_distance(
            sampledmesh=i,
            targetmesh=1 - i,
            samplevert=True,
            sampleface=True,
            samplenum=len((one, other)[i][0]),
            maxdist=pymeshlab.PercentageValue(100),
        )
        for i in range(2)
    ]
    return {
        "rms": math.sqrt(sum(side["RMS"] ** 2 for side in sides) / 2),
        "mean": sum(side["mean"] for side in sides) / 2,
        "max": max(side["max"] for side in sides),
    }


def _over(value: float | None, unit: float) -> float | None:
    return None if value is None else value / unit


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
