"""Make the sample meshes: closed shapes with repeated detail, and the same with holes.

    python sample_meshes/generate.py [FOLDER]

Writes binary PLY files and the README that lists them, by default beside this script. The same
versions of the packages give the same bytes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sample_meshes.bodies import FloatArray, IntArray
from sample_meshes.holes import Outline, Punched, boundary_edges, disc, remove_faces
from sample_meshes.shapes import make_shape


@dataclass(frozen=True)
class Hole:
    """A disc to cut out: direction from the centre of the mesh, radius in mean edge lengths."""

    direction: tuple[float, float, float]
    radius: float = 8.0
    outline: Outline = "round"


@dataclass(frozen=True)
class Sample:
    """A closed shape and the holes of its damaged twin."""

    name: str
    body: str
    detail: str
    holes: tuple[Hole, ...]
    wavelength: float = 10.0
    count: int = 8000


SAMPLES = (
    Sample(
        "bumps",
        "torus",
        "bumps",
        (Hole((1, 0.2, 0.3)), Hole((-1, 0.1, 0.2), outline="irregular")),
        count=9000,
    ),
    Sample(
        "scales",
        "capsule",
        "scales",
        (Hole((1, 0.1, 0.1), outline="irregular"), Hole((-0.3, 1, 0.3))),
    ),
    Sample("weave", "torus", "woven", (Hole((1, 0, 0.25)), Hole((0.75, 0.66, 0.25), 7.0)), 8.0),
    Sample(
        "dimples",
        "blob",
        "dimples",
        (Hole((1, 0, 0)), Hole((-0.8, 0.5, 0.1), 8.0, "irregular"), Hole((-0.55, -0.6, 0.5), 6.0)),
        9.0,
    ),
    Sample("knurl", "ring", "knurl", (Hole((0.2, 1, 0.3), outline="irregular"),), 9.0),
    Sample("smooth", "blob", "smooth", (Hole((1, 0, 0)), Hole((-0.8, 0.5, 0.1), 8.0, "irregular"))),
)


def single_precision(vertices: FloatArray) -> FloatArray:
    """Round positions to what the files hold."""
    return vertices.astype(np.float32).astype(np.float64)


def build(sample: Sample) -> tuple[FloatArray, IntArray, Punched]:
    """Make the closed shape of a sample and its damaged twin."""
    vertices, faces = make_shape(
        sample.body,
        sample.detail,
        count=sample.count,
        wavelength=sample.wavelength,
        triangulation="irregular",
    )
    vertices = single_precision(vertices)
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    masks = []
    for seed, hole in enumerate(sample.holes):
        # The vertex furthest along the direction among those that see it.
        direction = np.array(hole.direction) / np.linalg.norm(hole.direction)
        along = (vertices - centre) @ direction
        across = np.linalg.norm(vertices - centre - along[:, None] * direction, axis=1)
        place = int(np.argmax(along - 2 * across))
        masks.append(disc(vertices, faces, place, hole.radius, outline=hole.outline, seed=seed))
    return vertices, faces, remove_faces(vertices, faces, np.any(masks, axis=0))


def write_ply(path: Path, vertices: FloatArray, faces: IntArray) -> None:
    """Write a binary little-endian PLY with single precision positions."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    rows = np.zeros(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"] = 3
    rows["corners"] = faces
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


def loop_sizes(faces: IntArray) -> list[int]:
    """Numbers of edges of the boundary loops, which must be simple."""
    following = dict(boundary_edges(faces).tolist())
    sizes = []
    while following:
        vertex, size = next(iter(following)), 0
        while vertex in following:
            vertex, size = following.pop(vertex), size + 1
        sizes.append(size)
    return sorted(sizes)


README = """# Sample meshes

Closed shapes with repeated surface detail on irregular triangulations, and each again with holes
(`*_holes.ply`). A damaged mesh holds the closed one's vertices and faces in their order, less what
was cut out, so the closed mesh is the truth. Lengths are in mean edge lengths. This file and the
meshes are made by

    python sample_meshes/generate.py

{table}
"""


def table_row(sample: Sample, damaged: bool, vertices: FloatArray, faces: IntArray) -> str:
    """One line of the table in the README."""
    name = f"{sample.name}_holes.ply" if damaged else f"{sample.name}.ply"
    detail = f"{sample.detail}, {sample.wavelength:g} apart"
    what = f"{sample.body}, {'no detail' if sample.detail == 'smooth' else detail}"
    holes = "; ".join(
        f"{hole.outline}, radius {hole.radius:g}" for hole in (sample.holes if damaged else ())
    )
    loops = ", ".join(str(size) for size in loop_sizes(faces))
    return f"| `{name}` | {what} | {len(vertices)} | {len(faces)} | {holes} | {loops} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Write every sample and the README."""
    parser = argparse.ArgumentParser(description="Make the sample meshes.")
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).resolve().parent)
    folder: Path = parser.parse_args(arguments).folder
    folder.mkdir(parents=True, exist_ok=True)
    rows = [
        "| file | shape | vertices | faces | holes | boundary edges |",
        "|---|---|---|---|---|---|",
    ]
    for sample in SAMPLES:
        vertices, faces, cut = build(sample)
        write_ply(folder / f"{sample.name}.ply", vertices, faces)
        write_ply(folder / f"{sample.name}_holes.ply", cut.vertices, cut.faces)
        rows.append(table_row(sample, False, vertices, faces))
        rows.append(table_row(sample, True, cut.vertices, cut.faces))
        print(rows[-1], flush=True)
    (folder / "README.md").write_text(README.format(table="\n".join(rows)), encoding="utf-8")


if __name__ == "__main__":
    main()
