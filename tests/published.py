"""What the tests of published hole fillers share."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.comparison.fillers import FILLERS
from meshlab_lowrank.comparison.task import current_arrays, mesh_set
from meshlab_lowrank.mesh.geometry import face_vectors
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops


def area(points, triangles):
    return float(np.linalg.norm(face_vectors(points, np.asarray(triangles)), axis=1).sum())


def circle(k, radius=1.0, height=0.0):
    angle = 2.0 * np.pi * np.arange(k) / k
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height + 0.0 * angle], axis=1)


def punched(vertices, faces, *, centre=(0.0, 0.0), radius=4.0, island=0.0):
    away = np.linalg.norm(vertices[faces].mean(axis=1)[:, :2] - centre, axis=1)
    kept = faces[(away > radius) | (away < island)]
    used, local = np.unique(kept, return_inverse=True)
    return vertices[used], local.reshape(-1, 3)


def holes_of(vertices, faces):
    return [loop for loop in boundary_loops(vertices, faces) if not loop.is_rim]


def filled(name, vertices, faces, loops=None):
    selected = np.zeros(len(faces), dtype=np.bool_)
    for loop in loops or holes_of(vertices, faces):
        selected[loop.faces] = True
    ms = mesh_set(vertices, faces, selected)
    FILLERS[name].run(ms)
    return current_arrays(ms)
