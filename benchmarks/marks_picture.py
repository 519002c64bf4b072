"""Draw ``docs/marks_meshlab.jpg``: a scan, its fill as MeshLab reads it, and as it is selected.

python -m benchmarks.marks_picture
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pymeshlab
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import meshlab_lowrank.cli
from meshlab_lowrank.mesh.geometry import FloatArray, face_normals

TARGET = Path("docs/marks_meshlab.jpg")
SAMPLE = Path("sample_meshes/bumps_holes.ply")
_GREY, _RED = (0.78, 0.8, 0.84), (0.85, 0.2, 0.15)


def _loaded(path: Path) -> pymeshlab.MeshSet:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.load_new_mesh(str(path))
    return ms


def _draw(axes: Any, ms: pymeshlab.MeshSet, colours: FloatArray) -> None:
    mesh = ms.current_mesh()
    corners = mesh.vertex_matrix()[mesh.face_matrix()]
    normals = face_normals(mesh.vertex_matrix(), np.asarray(mesh.face_matrix(), dtype=np.int64))
    light = 0.45 + 0.55 * np.abs(normals @ [0.3, -0.5, 0.81])
    axes.add_collection3d(Poly3DCollection(corners, facecolors=colours * light[:, None]))
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    middle, half = 0.5 * (low + high), 0.5 * (high - low).max()
    axes.set(**{f"{x}lim": (m - half, m + half) for x, m in zip("xyz", middle, strict=True)})
    axes.set_box_aspect((1, 1, 1), zoom=1.5)
    axes.view_init(40, -60)
    axes.set_axis_off()


def main() -> None:
    """Fill, read again, draw."""
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder, "whole.ply")
        meshlab_lowrank.cli.main(["inpaint", str(SAMPLE), str(whole), "--quiet"])
        scan, again = _loaded(SAMPLE), _loaded(whole)
        again.compute_color_from_scalar_per_vertex(minval=0, maxval=1)
        again.compute_selection_inpainted_lowrank(marksfile=str(whole))
    mesh = again.current_mesh()
    painted = mesh.vertex_color_matrix()[mesh.face_matrix(), :3].mean(axis=1)
    selected = np.where(mesh.face_selection_array()[:, None], _RED, _GREY)
    figure, axes = plt.subplots(
        1, 3, figsize=(9.0, 3.0), dpi=100, subplot_kw={"projection": "3d"}, layout="constrained"
    )
    bare = np.tile(_GREY, (scan.current_mesh().face_number(), 1))
    for place, ms, colours in zip(
        axes, (scan, again, again), (bare, painted, selected), strict=True
    ):
        _draw(place, ms, colours)
    figure.savefig(TARGET)


if __name__ == "__main__":
    main()
