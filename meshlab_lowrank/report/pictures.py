"""Pictures of holes, fills and errors, drawn in a process of its own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, normalized
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.mesh.triangle_sampling import cut_triangles
from meshlab_lowrank.report.renderer_process import run_renderer
from meshlab_lowrank.report.rendering import missing_renderer
from meshlab_lowrank.report.view import View
from meshlab_lowrank.scratch import scratch_folder

_TILT = np.radians(15.0)  # of the view against the normal of the hole, so that relief shows
_VIEW = 1.35  # half the height of a picture, in radii of the hole
_FINENESS = 0.5  # longest edge of the pieces of an error map, in mean edge lengths


@dataclass(frozen=True)
class ErrorMap:
    """Distances to the truth all over a fill, or error bars.

    Attributes
    ----------
    vertices : (n, 3) float64
        Corners of small pieces of the fill.
    faces : (m, 3) int64
    distances : (n,) float64
        In mesh units.
    """

    vertices: FloatArray
    faces: IntArray
    distances: FloatArray


@dataclass(frozen=True)
class Picture:
    """What to draw: a surface, its part marked or coloured by an error map.

    Attributes
    ----------
    view : View
        Gives the camera and the light.
    surface : SurfacePart
    errors : ErrorMap or None
    limit : float
        Distance at the end of the colour scale.
    marked : bool
        Whether the part has a colour of its own.
    """

    view: View
    surface: SurfacePart
    errors: ErrorMap | None = None
    limit: float = 1.0
    marked: bool = False


def error_map(fill: SurfacePart, truth: SurfacePart, edge_length: float) -> ErrorMap:
    """Measure a fill finely enough for a picture.

    Parameters
    ----------
    fill, truth : SurfacePart
    edge_length : float

    Returns
    -------
    ErrorMap
    """
    corners, _ = cut_triangles(fill.vertices[fill.faces[fill.part]], _FINENESS * edge_length)
    vertices, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    index = TriangleIndex(truth.vertices, truth.faces[truth.part])
    return ErrorMap(vertices, faces.reshape(-1, 3), index.closest(vertices).distances)


def bar_map(fill: SurfacePart, bars: FloatArray) -> ErrorMap | None:
    """Give the error bars at the vertices of a fill; None where they are not known.

    Parameters
    ----------
    fill : SurfacePart
    bars : (n,) float64
        Of all vertices of the surface; NaN where they are not known.

    Returns
    -------
    ErrorMap or None
    """
    faces = fill.faces[fill.part]
    if not bars[faces].any() or not np.isfinite(bars[faces]).all():
        return None
    return ErrorMap(fill.vertices, faces, bars)


def draw(pictures: Mapping[Any, Picture]) -> tuple[dict[Any, bytes], str]:
    """Draw pictures.

    Parameters
    ----------
    pictures : dict of any key to Picture

    Returns
    -------
    files : dict of key to bytes
        JPEG files; empty where they could not be drawn.
    reason : str
        Why there are none, and what to do; empty if there are.
    """
    if missing := missing_renderer():
        return {}, missing
    with scratch_folder() as folder:
        jobs = [
            _prepare(picture, folder, number) for number, picture in enumerate(pictures.values())
        ]
        list_file = folder / "pictures.json"
        list_file.write_text(json.dumps(jobs), encoding="utf-8")
        if reason := run_renderer("meshlab_lowrank.report.rendering", list_file):
            return {}, reason
        files = {
            key: Path(job["target"]).read_bytes() for key, job in zip(pictures, jobs, strict=True)
        }
    return files, ""


def _prepare(picture: Picture, folder: Path, number: int) -> dict[str, Any]:
    """Store the arrays of a picture and give the rest of its job."""
    view, surface = picture.view, picture.surface
    arrays: dict[str, Any] = {"all_vertices": surface.vertices, "all_faces": surface.faces}
    names = ["all"]
    if picture.marked or picture.errors is not None:
        arrays["all_faces"] = surface.faces[~surface.part]
    if picture.marked:
        names = ["all", "fill"]
        arrays["fill_vertices"] = surface.vertices
        arrays["fill_faces"] = surface.faces[surface.part]
    elif picture.errors is not None:
        names = ["all", "map"]
        arrays["map_vertices"] = picture.errors.vertices
        arrays["map_faces"] = picture.errors.faces
        arrays["map_values"] = picture.errors.distances
    source = folder / f"{number}.npz"
    np.savez(source, **arrays)
    up = normalized(np.cross(view.normal, np.eye(3)[np.abs(view.normal).argmin()]))
    towards = np.cos(_TILT) * view.normal - np.sin(_TILT) * up
    return {
        "arrays": str(source),
        "surfaces": names,
        "target": str(folder / f"{number}.jpg"),
        "centre": view.centre.tolist(),
        "towards": towards.tolist(),
        "up": (np.cos(_TILT) * up + np.sin(_TILT) * view.normal).tolist(),
        "scale": _VIEW * view.radius,
        "limit": picture.limit,
    }
