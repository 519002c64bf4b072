"""Measure the batch engine: two workers against one, and its overhead.

python benchmarks/batch_runs.py scaling --files 200
python benchmarks/batch_runs.py overhead --seconds 2
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank import batch


def main() -> None:
    """Run one measurement."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("measurement", choices=("scaling", "overhead"))
    parser.add_argument("--files", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=2.0, help="work a file, for overhead")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scans = Path(folder, "scans")
        make_scans(scans, args.files)
        measurements: dict[str, Callable[[], dict[str, Any]]] = {
            "scaling": lambda: scaling(scans, Path(folder)),
            "overhead": lambda: overhead(scans, Path(folder), args.seconds),
        }
        figures = measurements[args.measurement]()
    sys.stdout.write(json.dumps(figures, indent=2) + "\n")


def make_scans(folder: Path, count: int) -> None:
    """Write bumpy spheres with one hole each, all of them different."""
    folder.mkdir()
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.create_sphere(subdiv=4)
    vertices = meshset.current_mesh().vertex_matrix()
    faces = meshset.current_mesh().face_matrix()
    for number in range(count):
        centre = np.random.default_rng(number).normal(size=3)
        centre /= np.linalg.norm(centre)
        bumps = 1 + 0.02 * np.sin(12 * vertices).prod(axis=1)
        outside = (vertices[faces].mean(axis=1) @ centre) < 0.97
        mesh = pymeshlab.Mesh(vertices * bumps[:, None], faces[outside])
        single = pymeshlab.MeshSet(verbose=False)
        single.add_mesh(mesh)
        single.meshing_remove_unreferenced_vertices()
        single.save_current_mesh(str(folder / f"scan{number:03}.ply"))


def scaling(scans: Path, folder: Path) -> dict[str, float]:
    """Compare the time of two workers with that of one."""
    seconds = {n: batch(scans, folder / f"out{n}", workers=n).seconds for n in (1, 2)}
    return {"one": seconds[1], "two": seconds[2], "ratio": seconds[2] / seconds[1]}


def overhead(scans: Path, folder: Path, seconds: float) -> dict[str, float]:
    """Compare the wall time of one worker with the time spent in the filters."""
    chain = folder / "wait.py"
    chain.write_text(f"import time\n\ndef chain(ms):\n    time.sleep({seconds})\n")
    result = batch(scans, folder / "out", workers=1, chain=chain)
    inside = sum(record.filter_seconds for record in result.records)
    return {"wall": result.seconds, "filters": inside, "overhead": result.seconds / inside - 1}


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
