from __future__ import annotations

import importlib
import signal
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops


def jittered_sheet(
    rows: int, columns: int, *, jitter: float = 0.1, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Flat sheet of nearly equilateral triangles with edges of about 1, facing up."""
    r, c = (axis.ravel() for axis in np.mgrid[:rows, :columns])
    vertices = np.stack([c + 0.5 * (r % 2), r * np.sqrt(0.75), np.zeros(len(r))], axis=1)
    chance = np.random.default_rng(seed)
    vertices[:, :2] += chance.uniform(-jitter, jitter, (len(r), 2))
    here = (r < rows - 1) & (c < columns - 1)
    even = np.flatnonzero(here & (r % 2 == 0))
    odd = np.flatnonzero(here & (r % 2 == 1))
    faces = [
        np.stack([even, even + 1, even + columns], axis=1),
        np.stack([even + 1, even + columns + 1, even + columns], axis=1),
        np.stack([odd, odd + 1, odd + columns + 1], axis=1),
        np.stack([odd, odd + columns + 1, odd + columns], axis=1),
    ]
    return vertices, np.concatenate(faces)


@pytest.fixture(scope="session", autouse=True)
def interruptible() -> Iterator[None]:
    """Let signals arrive where they are ignored, as behind a shell or under ``nohup``."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    hang_up = signal.signal(signal.SIGHUP, signal.SIG_DFL) if hasattr(signal, "SIGHUP") else None
    yield
    signal.signal(signal.SIGINT, before)
    if hang_up is not None:
        signal.signal(signal.SIGHUP, hang_up)


@pytest.fixture(scope="session")
def sheet() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Give the maker of flat sheets."""
    return jittered_sheet


@pytest.fixture(scope="session")
def holed_sphere() -> tuple[np.ndarray, np.ndarray]:
    """A bumpy sphere with two holes of 30 edges; their inner vertices are unreferenced."""
    ms = pymeshlab.MeshSet()
    ms.create_sphere(subdiv=4)
    vertices, faces = ms.current_mesh().vertex_matrix(), ms.current_mesh().face_matrix()
    chance = np.random.default_rng(5)
    vertices = vertices * (1.0 + 0.01 * chance.normal(size=(len(vertices), 1)))
    middle = vertices[faces].mean(axis=1)
    poles = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    gone = (np.linalg.norm(middle[:, None] - poles, axis=2) < 0.35).any(axis=1)
    return vertices, faces[~gone]


@pytest.fixture
def holed_set(
    holed_sphere: tuple[np.ndarray, np.ndarray],
) -> Callable[..., pymeshlab.MeshSet]:
    """A maker of MeshSets with that sphere; keywords go to `pymeshlab.Mesh`."""

    def make(**data: Any) -> pymeshlab.MeshSet:
        ms = pymeshlab.MeshSet()
        ms.add_mesh(pymeshlab.Mesh(*holed_sphere, **data), "sphere")
        return ms

    return make


def fan_fill(vertices: np.ndarray, faces: np.ndarray, **_: Any) -> meshlab_lowrank.InpaintResult:
    """Fill every loop with a fan around a new vertex in its middle."""
    points, triangles, records = [vertices], [faces], []
    for number, loop in enumerate(boundary_loops(vertices, faces)):
        rim, apex = loop.vertices, len(vertices) + number
        points.append(vertices[rim].mean(axis=0, keepdims=True))
        triangles.append(np.column_stack([rim, np.roll(rim, -1), np.full(len(rim), apex)]))
        records.append(
            meshlab_lowrank.HoleRecord(
                id=loop.id,
                status="filled",
                reason="",
                boundary_edges=len(rim),
                perimeter=loop.perimeter,
                diameter=loop.diameter,
                new_vertices=1,
                new_faces=len(rim),
            )
        )
    merged, closed = np.concatenate(points), np.concatenate(triangles)
    new = np.arange(len(merged)) >= len(vertices)
    return meshlab_lowrank.InpaintResult(
        vertices=merged,
        faces=closed,
        new_vertices=new,
        new_faces=np.arange(len(closed)) >= len(faces),
        trust=np.where(new, 0.25, 1.0),
        error=np.where(new, 0.125, 0.0),
        holes=tuple(records),
    )


@pytest.fixture
def fans(monkeypatch: pytest.MonkeyPatch) -> Callable[..., meshlab_lowrank.InpaintResult]:
    """Let the filter fill with fans, at once and known beforehand; gives the maker of fans."""
    module = importlib.import_module("meshlab_lowrank.filters.meshing_inpaint_lowrank")
    monkeypatch.setattr(module, "inpaint", fan_fill)
    return fan_fill
