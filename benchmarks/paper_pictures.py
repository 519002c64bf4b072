"""Pictures of fills side by side, shaded or coloured by their normals, as small JPEG files."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.cases import Problem
from benchmarks.readme_picture import draw, frame_of
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.surface_part import SurfacePart

MOST_BYTES = 115_000
_PANEL, _TITLE, _DPI = 2.0, 0.22, 110  # inches, inches, dots an inch
_MISSING = np.array([0.25, 0.25, 0.25])


def draw_strip(
    path: Path, problem: Problem, shown: Mapping[str, SurfacePart], columns: int, margin: float
) -> None:
    """Draw surfaces around a hole in rows of panels, each under its title."""
    figure = _panels(len(shown), columns)
    for number, (title, surface) in enumerate(shown.items()):
        axes = _axes(figure, number, len(shown), columns)
        draw(axes, surface, problem, margin)
        axes.set_title(title, fontsize=8, pad=2)
    save_jpeg(figure, path)


def draw_normals(
    path: Path,
    problem: Problem,
    shown: Mapping[str, tuple[FloatArray, IntArray, FloatArray]],
    margin: float,
) -> None:
    """Draw normal maps: red, green and blue are the normals' parts to the right, up and ahead.

    Parameters
    ----------
    path : Path
    problem : Problem
    shown : mapping of str to (vertices (n, 3), faces (m, 3), normals (n, 3))
        Normals that are missing are zero, and grey.
    margin : float
        Width shown beyond the rim, in radii of the hole.
    """
    frame = frame_of(problem.normal)
    reach = (1.0 + margin) * problem.radius
    figure = _panels(len(shown), len(shown))
    for number, (title, (vertices, faces, normals)) in enumerate(shown.items()):
        axes = _axes(figure, number, len(shown), len(shown))
        seen = (vertices - problem.centre) @ frame.T
        in_view = (np.abs(seen[:, :2]) < 1.1 * reach).all(axis=1) & (seen[:, 2] > -reach)
        kept = faces[in_view[faces].any(axis=1)]
        corners, turned = seen[kept], (normals[kept] @ frame.T)
        mean = turned.mean(axis=1)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        colours = np.clip(0.5 + 0.5 * mean / np.maximum(length, 1e-9), 0.0, 1.0)
        colours[((turned**2).sum(axis=2) == 0.0).any(axis=1)] = _MISSING
        front = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0.0
        order = np.argsort(corners[:, :, 2].mean(axis=1), kind="stable")
        order = order[front[order]]
        _add(axes, corners[order][:, :, :2], colours[order], reach)
        axes.set_title(title, fontsize=8, pad=2)
    save_jpeg(figure, path)


def _add(axes: Axes, corners: FloatArray, colours: FloatArray, reach: float) -> None:
    axes.add_collection(
        PolyCollection(list(corners), facecolors=colours, edgecolors=colours, linewidths=0.3)
    )
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set_axis_off()


def _panels(count: int, columns: int) -> Figure:
    rows = -(-count // columns)
    mpl.use("agg")
    size = (_PANEL * columns, (_PANEL + _TITLE) * rows)
    return Figure(figsize=size, dpi=_DPI, facecolor="white")


def _axes(figure: Figure, number: int, count: int, columns: int) -> Axes:
    rows = -(-count // columns)
    row, column = divmod(number, columns)
    height = _PANEL / (_PANEL + _TITLE) / rows
    return figure.add_axes((column / columns, 1.0 - (row + 1) / rows, 0.985 / columns, height))


def save_jpeg(figure: Figure, path: Path) -> None:
    """Save as JPEG of the best quality that is small enough."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    path.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(buffer) as picture:
        for quality in (85, 75, 65, 55, 45):
            picture.convert("RGB").save(path, quality=quality, optimize=True)
            if path.stat().st_size < MOST_BYTES:
                return
