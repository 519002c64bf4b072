"""Pictures of generated parts: the hole, our fill, and what was cut out."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from benchmarks.cases import Problem
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_normals
from sample_meshes.parts import Part

_AROUND = 1.7  # radii of the hole
_LIGHT = np.array([0.35, -0.55, 0.76])


def draw_parts(path: Path, part: Part, problem: Problem, mesh: tuple[FloatArray, IntArray]) -> None:
    """Write a picture of the hole, the filled part and the truth side by side."""
    n = len(problem.faces)
    panels = (
        ("hole", problem.vertices, problem.faces, np.zeros(n, dtype=np.bool_)),
        ("fill", *mesh, np.arange(len(mesh[1])) >= n),
        ("truth", part.vertices, part.faces, part.removed),
    )
    figure = plt.figure(figsize=(9.6, 3.4), dpi=110, layout="constrained")
    reach = _AROUND * problem.radius
    for number, (title, vertices, faces, new) in enumerate(panels):
        axes = figure.add_subplot(1, 3, number + 1, projection="3d")
        near = np.linalg.norm(vertices[faces].mean(axis=1), axis=1) < reach
        axes.add_collection3d(_painted(vertices, faces[near], new[near]))
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(-reach, reach), title=title)
        axes.set_box_aspect((1, 1, 1), zoom=1.5)
        axes.view_init(*_view(problem.normal))
        axes.set_axis_off()
    figure.savefig(path)
    plt.close(figure)


def _painted(vertices: FloatArray, faces: IntArray, new: BoolArray) -> Poly3DCollection:
    light = 0.35 + 0.65 * np.clip(face_normals(vertices, faces) @ _LIGHT, 0.0, 1.0)
    colour = np.where(new[:, None], [1.0, 0.62, 0.2], [0.78, 0.82, 0.88])
    return Poly3DCollection(
        vertices[faces], facecolors=colour * light[:, None], edgecolors="k", linewidths=0.12
    )


def _view(normal: FloatArray) -> tuple[float, float]:
    """Elevation and azimuth from which a surface with a normal is seen askew."""
    elevation = float(np.degrees(np.arcsin(np.clip(normal[2], -1.0, 1.0))))
    azimuth = float(np.degrees(np.arctan2(normal[1], normal[0])))
    return elevation - 25.0, azimuth + 25.0
