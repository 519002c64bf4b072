"""What is measured: models, holes, fillers and seeds. To add one, add its line here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pymeshlab

from sample_meshes.details import DETAILS
from sample_meshes.holes import Outline
from sample_meshes.shapes import Triangulation

Kind = Literal["repeated", "loose", "smooth", "real"]
KINDS: tuple[Kind, ...] = ("repeated", "loose", "smooth", "real")

SAMPLES = Path(__file__).resolve().parents[1] / "sample_meshes"
BUNDLED = Path(pymeshlab.__file__).parent / "tests" / "sample_meshes"


@dataclass(frozen=True)
class Shape:
    """A generated model; fields as the arguments of `sample_meshes.shapes.make_shape`."""

    body: str
    detail: str
    count: int
    wavelength: float = 10.0
    triangulation: Triangulation = "irregular"
    amplitude: float = 0.55
    seed: int = 0

    @property
    def name(self) -> str:
        """Short name for tables."""
        detail = "" if self.detail == "smooth" else f"-{self.wavelength:g}h"
        seed = f"-s{self.seed}" if self.seed else ""
        size = f"{self.count // 1000}k{self.triangulation[0]}"
        return f"{self.body}-{self.detail}{detail}-{size}{seed}"


@dataclass(frozen=True)
class Model:
    """A surface to punch holes into: generated, or a closed or open mesh file."""

    source: Shape | Path
    kind: Kind
    held_out: bool = False

    @property
    def name(self) -> str:
        """Short name for tables."""
        return self.source.name if isinstance(self.source, Shape) else self.source.stem


@dataclass(frozen=True)
class Hole:
    """A disc to cut out, its mean radius in mean edge lengths."""

    radius: float
    outline: Outline = "round"

    @property
    def name(self) -> str:
        """Short name for tables."""
        return f"{self.radius:g}h-{self.outline}"


def shape(
    body: str,
    detail: str,
    thousands: int,
    wavelength: float = 10.0,
    triangulation: Triangulation = "irregular",
    *,
    seed: int = 0,
    held_out: bool = False,
) -> Model:
    """Give a generated model; its kind follows from its detail."""
    kind: Kind = "loose" if DETAILS[detail].loose else "repeated"
    kind = "smooth" if detail == "smooth" else kind
    source = Shape(body, detail, 1000 * thousands, wavelength, triangulation, seed=seed)
    return Model(source, kind, held_out)


MODELS: list[Model] = [
    shape("torus", "bumps", 70, 10.0, "regular"),
    shape("torus", "bumps", 70, 10.0),
    shape("torus", "bumps", 30, 7.0),
    shape("torus", "bumps", 50, 16.0),
    shape("torus", "scales", 50, 12.0),
    shape("capsule", "scales", 50, 10.0, "regular"),
    shape("torus", "knurl", 50, 9.0),
    shape("ring", "woven", 50, 10.0),
    shape("ring", "woven", 30, 8.0, "regular"),
    shape("capsule", "bricks", 50, 10.0),
    shape("torus", "rope", 30, 9.0),
    shape("torus", "grooves", 50, 8.0),
    shape("blob", "dimples", 50, 9.0),
    shape("ring", "honeycomb", 50, 12.0, "regular"),
    shape("ellipsoid", "bumps", 50, 9.0),
    shape("torus", "bumps_jittered", 70, 10.0),
    shape("torus", "scales_varied", 50, 11.0),
    shape("blob", "pebbles", 50, 10.0),
    shape("blob", "smooth", 50),
    shape("ring", "smooth", 50, triangulation="regular"),
    shape("torus", "smooth", 30),
    Model(SAMPLES / "bumps.ply", "repeated"),
    Model(SAMPLES / "scales.ply", "repeated"),
    Model(SAMPLES / "weave.ply", "repeated"),
    Model(SAMPLES / "dimples.ply", "repeated"),
    Model(SAMPLES / "knurl.ply", "repeated"),
    Model(SAMPLES / "smooth.ply", "smooth"),
    Model(BUNDLED / "bunny.obj", "real"),
    # Not to be looked at while the method is being tuned.
    shape("torus", "rings", 50, 12.0, held_out=True),
    shape("ring", "stars", 50, 12.0, held_out=True),
    shape("torus", "studs", 50, 9.0, "regular", held_out=True),
    shape("torus", "chevrons", 50, 10.0, held_out=True),
    shape("ring", "braid", 50, 9.0, held_out=True),
    shape("capsule", "eggbox", 50, 11.0, "regular", held_out=True),
    shape("torus", "plates", 70, 9.0, held_out=True),
    shape("sphere", "honeycomb", 50, 10.0, held_out=True),
    shape("capsule", "ribs", 50, 8.0, held_out=True),
    shape("torus", "bumps_square", 30, 8.0, "regular", held_out=True),
    shape("torus", "wrinkles", 50, 9.0, held_out=True),
    shape("ring", "pebbles", 50, 9.0, seed=5, held_out=True),
    shape("torus", "bumps_jittered", 50, 8.0, "regular", seed=5, held_out=True),
    shape("capsule", "smooth", 50, held_out=True),
    shape("ellipsoid", "smooth", 50, triangulation="regular", held_out=True),
]

HOLES: list[Hole] = [
    Hole(8.0),
    Hole(8.0, "irregular"),
    Hole(16.0),
    Hole(16.0, "irregular"),
    Hole(28.0),
    Hole(28.0, "irregular"),
]

# Names of the registry in meshlab_lowrank.comparison.fillers, or paths of .py and .mlx files.
MESHLAB: list[str] = ["close", "close-refine", "close-remesh-smooth"]
PEERS: list[str] = ["cgal", "meshfix"]
OURS: list[str] = ["lowrank", "lowrank-full", "base", "paper"]

SEEDS: list[int] = [0, 1, 2]
HELD_OUT_SEEDS: list[int] = [100, 101, 102]
