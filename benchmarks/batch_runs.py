"""Measure the batch engine: two workers against one, its overhead, and random kills.

python benchmarks/batch_runs.py scaling --files 200
python benchmarks/batch_runs.py overhead --seconds 2
python benchmarks/batch_runs.py kills --kills 50
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank import batch

COMMAND = [
    sys.executable,
    "-c",
    "import sys; from meshlab_lowrank.cli import main; sys.exit(main())",
]


def main() -> None:
    """Run one measurement."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("measurement", choices=("scaling", "overhead", "kills"))
    parser.add_argument("--files", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=2.0, help="work a file, for overhead")
    parser.add_argument("--kills", type=int, default=50)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scans = Path(folder, "scans")
        make_scans(scans, args.files)
        measurements: dict[str, Callable[[], dict[str, Any]]] = {
            "scaling": lambda: scaling(scans, Path(folder)),
            "overhead": lambda: overhead(scans, Path(folder), args.seconds),
            "kills": lambda: kills(scans, Path(folder), args.kills),
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


def kills(scans: Path, folder: Path, count: int) -> dict[str, int]:
    """Kill runs at random moments; count what is lost or half written, then let one finish."""
    reference, target = folder / "reference", folder / "out"
    whole = {r.output: digest(reference / r.output) for r in batch(scans, reference).records}
    chance, bad, unreadable = random.Random(0), 0, 0
    for _ in range(count):
        command = [*COMMAND, "batch", str(scans), str(target)]
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        time.sleep(chance.uniform(0.3, 4))
        process.send_signal(signal.SIGKILL)
        process.wait()
        bad += sum(digest(path) != whole[path.name] for path in target.glob("scan*"))
        manifest = target / "manifest.jsonl"
        lines = manifest.read_text() if manifest.exists() else ""
        unreadable += sum(not readable(line) for line in lines.splitlines())
        if len(list(target.glob("scan*"))) == len(whole):
            for path in chance.sample(sorted(target.glob("scan*")), len(whole) // 2):
                path.unlink()
    batch(scans, target)
    lost = sum(digest(target / name) != value for name, value in whole.items())
    leftovers = len(list(target.glob(".meshlab-lowrank-*")))
    return {"kills": count, "half written": bad, "unreadable": unreadable, "lost": lost} | {
        "leftovers": leftovers
    }


def readable(line: str) -> bool:
    """Whether a line of the manifest is JSON."""
    try:
        json.loads(line)
    except ValueError:
        return False
    return True


def digest(path: Path) -> str:
    """Hash a file; empty if there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
