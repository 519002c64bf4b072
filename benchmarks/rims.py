"""Do fills fold or cross more than others' at rims as they come?

    python -m benchmarks.rims FOLDER ... --places 200 --detail none

punches holes at random places of all meshes in the folders, also where they are ragged, fills them,
and counts folded edges and pairs of faces that cross. Rows are appended to
``benchmarks/results/rims.jsonl``; places that are there already are passed over.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab

import meshlab_lowrank
from benchmarks.rim_places import Place, mesh_files, places_on
from benchmarks.rim_tables import page
from meshlab_lowrank.comparison.task import FUNCTION
from meshlab_lowrank.fill_crossings import crossings_of_patches
from meshlab_lowrank.isolation.pool import WorkerPool
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_normals
from meshlab_lowrank.mesh.topology import edges_of, faces_at, half_edge_pairs
from meshlab_lowrank.scratch import scratch_folder

_FOLDED = -0.2
_RINGS = 8  # around a hole, of what CGAL gets
_TIMEOUT = 60.0
RESULTS = Path("benchmarks/results/rims.jsonl")


@dataclass(frozen=True)
class Flaws:
    """What is wrong with a fill.

    Attributes
    ----------
    status : str
        "filled", or why not.
    faces, folds, crossings : int
        New faces, folded edges, and pairs of a new face and any other that cross.
    seconds : float
        Of one processor.
    note : str
    """

    status: str
    faces: int = 0
    folds: int = 0
    crossings: int = 0
    seconds: float = 0.0
    note: str = ""


def measured(
    vertices: FloatArray, faces: IntArray, new: BoolArray, capped: BoolArray
) -> tuple[int, int]:
    """Count folded edges, of flat caps not those at the rim, and crossing pairs of new faces."""
    near = np.zeros(len(vertices), dtype=np.bool_)
    near[faces[new]] = True
    rows = faces_at(near, faces)
    local, fresh, flat = faces[rows], new[rows], capped[rows]
    one, other = half_edge_pairs(edges_of(local)) // 3
    normals = face_normals(vertices, local)
    cosine = np.einsum("ij,ij->i", normals[one], normals[other])
    both, across = fresh[one] & fresh[other], fresh[one] ^ fresh[other]
    folded = (cosine < _FOLDED) & (both | (across & ~(flat[one] | flat[other])))
    crossed = crossings_of_patches(vertices, faces, np.where(new, 0, -1))
    return int(folded.sum()), int(crossed.sum())


def ours(place: Place, **parameters: Any) -> Flaws:
    """Fill the holes of a place."""
    started = time.process_time()
    try:
        result = meshlab_lowrank.inpaint(
            place.vertices,
            place.faces,
            holes=[loop.id for loop in place.loops],
            closerim=True,
            **parameters,
        )
    except Exception as error:  # noqa: BLE001 - a run must not die
        return Flaws(str(error), seconds=time.process_time() - started)
    seconds = time.process_time() - started
    records = [result.holes[loop.id] for loop in place.loops]
    left = [record for record in records if record.status != "filled"]
    capped = np.zeros(len(result.faces), dtype=np.bool_)
    if all(record.shape == "cut" for record in records):
        capped[len(place.faces) :] = True
    folds, crossings = measured(result.vertices, result.faces, result.new_faces, capped)
    note = " ".join(record.reason for record in records)
    status = left[0].reason if left else "filled"
    return Flaws(status, int(result.new_faces.sum()), folds, crossings, seconds, note)


def another(place: Place, filler: str, pool: WorkerPool, folder: Path) -> Flaws:
    """Let another filler fill the holes, with what lies around them."""
    inside = np.zeros(len(place.vertices), dtype=np.bool_)
    for loop in place.loops:
        inside[loop.vertices] = True
    for _ in range(_RINGS):
        inside[place.faces[faces_at(inside, place.faces)]] = True
    rows = np.flatnonzero(faces_at(inside, place.faces))
    selected = np.isin(rows, np.concatenate([loop.faces for loop in place.loops]))
    ids, local = np.unique(place.faces[rows], return_inverse=True)
    vertices, faces, origin = _split(place.vertices[ids], local.reshape(-1, 3))
    source, target = folder / "job.npz", folder / "result.npz"
    np.savez(source, vertices=vertices, faces=faces, selected=selected)
    call = {"filler": filler, "source": str(source), "target": str(target)}
    with pool.borrowed() as worker:
        ending = worker.run({"function": FUNCTION, **call}, timeout=_TIMEOUT)
    if ending.report is None or ending.report["status"] != "filled":
        return Flaws("timed out" if ending.timed_out else "failed", seconds=ending.seconds)
    with np.load(target) as arrays:
        made, filled = arrays["vertices"], arrays["faces"][len(faces) :]
    if len(filled) == 0:
        return Flaws("left open", seconds=ending.report["seconds"])
    n = len(place.vertices)
    number = np.concatenate([ids[origin], n + np.arange(len(made) - len(vertices))])
    points = np.concatenate([place.vertices, made[len(vertices) :]])
    every = np.concatenate([place.faces, number[filled]])
    new = np.arange(len(every)) >= len(place.faces)
    folds, crossings = measured(points, every, new, np.zeros_like(new))
    return Flaws("filled", len(filled), folds, crossings, ending.report["seconds"])


def _split(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Give each fan of faces a vertex of its own, and say of which vertex each is a copy."""
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(vertices, faces))
    ms.meshing_repair_non_manifold_vertices(vertdispratio=0.0)
    parted = np.asarray(ms.current_mesh().face_matrix(), dtype=np.int64)
    points = np.asarray(ms.current_mesh().vertex_matrix(), dtype=np.float64)
    origin = np.zeros(len(points), dtype=np.int64)
    origin[parted] = faces
    return points, parted, origin


def main() -> None:
    """Measure, a line a place."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--places", type=int, default=200, help="of each radius, over all meshes")
    parser.add_argument("--radii", type=float, nargs="+", default=[8.0, 16.0])
    parser.add_argument("--detail", default="none")
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--fillers", nargs="*", default=["cgal"])
    parser.add_argument("--longest", type=int, default=700, help="edges of the rims at a place")
    parser.add_argument("--minutes", type=float, default=math.inf, help="begin no place after that")
    parser.add_argument("--page", type=Path, help="write the tables of all results there")
    args = parser.parse_args()
    args.results.parent.mkdir(parents=True, exist_ok=True)
    done = {(row["file"], row["radius"], row["place"]) for row in _rows(args.results)}
    files = mesh_files(args.folders)
    pool = WorkerPool()
    share = -(-args.places // max(1, len(files)))
    until = time.perf_counter() + 60.0 * args.minutes
    with scratch_folder() as folder:
        for place, radius in _in_turn(files, share, args.radii):
            edges = [len(loop.vertices) for loop in place.loops]
            key = (place.file, radius, place.number)
            if key in done or sum(edges) > args.longest:
                continue
            if time.perf_counter() > until:
                break
            fills = {"ours": asdict(ours(place, detail=args.detail))}
            for name in args.fillers:
                fills[name] = asdict(another(place, name, pool, folder))
            row = {"file": place.file, "radius": radius, "place": place.number}
            row |= {"at_border": place.at_border, "edges": edges, "fills": fills}
            with args.results.open("a") as file:
                file.write(json.dumps(row) + "\n")
            counts = (f"{n} {f['folds']}/{f['crossings']}" for n, f in fills.items())
            print(*key, edges, *counts, flush=True)
    pool.close()
    if args.page:
        args.page.write_text(page(_rows(args.results), args.detail, args.longest), encoding="utf-8")


def _in_turn(files: list[Path], count: int, radii: list[float]) -> Iterator[tuple[Place, float]]:
    """Give the first place on each mesh at each radius, then the second ones, and so on."""
    places = [(places_on(path, count, radius), radius) for radius in radii for path in files]
    for _ in range(count):
        for each, radius in places:
            place = next(each, None)
            if place is not None:
                yield place, radius


def _rows(path: Path) -> list[dict[str, Any]]:
    return (
        [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        if path.exists()
        else []
    )


if __name__ == "__main__":
    main()
