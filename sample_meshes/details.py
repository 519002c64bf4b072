"""Repeated surface detail: one height field a family, before smoothing and scaling.

Wave families read the tube chart of a body; cell families read the offsets to the nearest centres
of a lattice (on a chart) or of an even scatter of points (on a body without a chart).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from .bodies import Body, FloatArray, IntArray

NEIGHBOURS = 8


@dataclass(frozen=True)
class Cells:
    """Nearest cell centres of every vertex.

    Attributes
    ----------
    offsets : (n, k, 2) float64
        Vertex minus centre, along and across, in wavelengths; nearest first.
    ids : (n, k) int64
        Number of each centre.
    count : int
        Number of centres.
    """

    offsets: FloatArray
    ids: IntArray
    count: int

    @property
    def distances(self) -> FloatArray:
        """Distances to the centres, (n, k), in wavelengths."""
        return np.asarray(np.linalg.norm(self.offsets, axis=2))


def _even(length: float, wavelength: float) -> int:
    return 2 * max(1, round(length / wavelength / 2))


def _turns(body: Body, along: float, across: float) -> tuple[FloatArray, FloatArray]:
    """Chart in cells of about `along` x `across`, an even number of them round each period."""
    chart = body.chart
    if chart is None:
        msg = "this detail needs a body with a chart: torus, ring or capsule"
        raise ValueError(msg)
    cells = []
    for column, size in enumerate((along, across)):
        period = body.periods[column]
        step = period / _even(period, size) if period else size
        # The offset keeps vertices off the lines where a pattern switches by rounding.
        cells.append(chart[:, column] / step + 0.0137)
    return cells[0], cells[1]


def chart_cells(
    body: Body, wavelength: float, *, square: bool, jitter: float, rng: np.random.Generator
) -> Cells:
    """Cells of a hexagonal or square lattice on the chart, each centre moved by `jitter`."""
    along, across = body.periods
    chart = body.chart
    if chart is None:
        return scattered_cells(body, wavelength, jitter=jitter, rng=rng)
    span = along or float(chart[:, 0].max())
    rows = _even(span, wavelength * (1.0 if square else np.sqrt(3.0) / 2))
    columns = _even(across, wavelength) if square else max(2, round(across / wavelength))
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    shift = 0.0 if square else 0.5 * (i % 2)
    centres = np.stack([(i + 0.5) * span / rows, (j + shift) * across / columns], axis=-1)
    centres = centres.reshape(-1, 2) + jitter * wavelength * rng.uniform(-1, 1, (rows * columns, 2))
    box = np.array([along, across])
    wrapped = np.where(box > 0, np.mod(centres, np.where(box > 0, box, 1)), centres)
    points = np.where(box > 0, np.mod(chart, np.where(box > 0, box, 1)), chart)
    _, ids = KDTree(wrapped, boxsize=box).query(points, k=NEIGHBOURS)
    offsets = points[:, None] - wrapped[ids]
    offsets -= box * np.round(offsets / np.where(box > 0, box, np.inf))
    return Cells(offsets / wavelength, np.asarray(ids, dtype=np.int64), len(centres))


def scattered_cells(
    body: Body, wavelength: float, *, jitter: float, rng: np.random.Generator
) -> Cells:
    """Cells of points spread evenly over the body by Lloyd's relaxation."""
    a, b, c = (body.vertices[body.faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    count = max(12, round(float(area.sum()) / (wavelength**2 * np.sqrt(3.0) / 2)))
    chosen = rng.choice(len(area), size=60 * count, p=area / area.sum())
    u, v = rng.random((2, len(chosen), 1))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    samples = a[chosen] * (1 - u - v) + b[chosen] * u + c[chosen] * v
    centres = samples[:count]
    for _ in range(60):
        owner = KDTree(centres).query(samples)[1]
        size = np.maximum(np.bincount(owner, minlength=count), 1)
        mean = np.stack(
            [np.bincount(owner, weights=samples[:, i], minlength=count) for i in range(3)], axis=1
        )
        centres = mean / size[:, None]
    _, nearest = KDTree(body.vertices).query(centres)
    centres = body.vertices[nearest] + jitter * wavelength * rng.uniform(-1, 1, (count, 3))
    _, ids = KDTree(centres).query(body.vertices, k=NEIGHBOURS)
    away = body.vertices[:, None] - centres[ids]
    # "Along" is the horizontal direction round the body; it is only singular at the poles.
    around = np.cross([0.0, 0.0, 1.0], body.vertices)
    around /= np.maximum(np.linalg.norm(around, axis=1), 1e-9)[:, None]
    along = np.einsum("nkd,nd->nk", away, around)
    distance = np.linalg.norm(away, axis=2)
    across = np.sqrt(np.maximum(distance**2 - along**2, 0)) * np.sign(away[..., 2])
    return Cells(np.stack([along, across], -1) / wavelength, np.asarray(ids, dtype=np.int64), count)


def _round(distance: FloatArray, radius: float) -> FloatArray:
    """Round bump of height 1 that ends with zero slope at `radius`."""
    return np.asarray(np.cos(np.minimum(distance / radius, 1.0) * np.pi / 2) ** 2)


def _soft_max(heights: FloatArray, sharpness: float = 12.0) -> FloatArray:
    """Smooth maximum over the last axis."""
    top = heights.max(axis=-1, keepdims=True)
    return np.asarray(
        top[..., 0] + np.log(np.exp(sharpness * (heights - top)).sum(axis=-1)) / sharpness
    )


def _sizes(cells: Cells, spread: float, rng: np.random.Generator) -> FloatArray:
    """A random factor for each centre, gathered to (n, k)."""
    return np.asarray(1 + spread * rng.uniform(-1, 1, cells.count)[cells.ids])


CellHeight = Callable[[Cells, np.random.Generator], FloatArray]
WaveHeight = Callable[[Body, float], FloatArray]


def bumps(cells: Cells, rng: np.random.Generator, spread: float = 0.0) -> FloatArray:
    """Round bumps, their heights varying by `spread`."""
    return np.asarray((_round(cells.distances, 0.48) * _sizes(cells, spread, rng)).max(axis=1))


def dimples(cells: Cells, rng: np.random.Generator) -> FloatArray:
    """Round pits in a flat surface."""
    return -bumps(cells, rng)


def honeycomb(cells: Cells, _: np.random.Generator) -> FloatArray:
    """Ridges half-way between neighbouring centres."""
    d = cells.distances
    return np.asarray(np.exp(-(((d[:, 1] - d[:, 0]) / 0.22) ** 2)))


def plates(cells: Cells, rng: np.random.Generator, spread: float = 0.0) -> FloatArray:
    """Domed plates with grooves between them."""
    d = cells.distances
    groove = 1 - np.exp(-(((d[:, 1] - d[:, 0]) / 0.2) ** 2))
    dome = 1 - (d[:, 0] / 0.8) ** 2
    return np.asarray(groove * dome * _sizes(cells, spread, rng)[:, 0])


def rings(cells: Cells, _: np.random.Generator) -> FloatArray:
    """Ring-shaped welts."""
    return np.asarray(np.exp(-(((cells.distances[:, 0] - 0.3) / 0.11) ** 2)))


def stars(cells: Cells, _: np.random.Generator) -> FloatArray:
    """Five-pointed lumps."""
    x, y = cells.offsets[:, 0, 0], cells.offsets[:, 0, 1]
    reach = 0.36 * (1 + 0.35 * np.cos(5 * np.arctan2(y, x)))
    return _round(np.hypot(x, y) / reach, 1.2)


def studs(cells: Cells, _: np.random.Generator) -> FloatArray:
    """Rows of large and of small studs in turn (on a square lattice)."""
    # A square lattice has an even number of columns, so parity is that of the column.
    large = cells.ids % 2 == 0
    return np.asarray(
        np.where(large, _round(cells.distances, 0.5), 0.55 * _round(cells.distances, 0.33)).max(1)
    )


def scales(cells: Cells, rng: np.random.Generator, spread: float = 0.0) -> FloatArray:
    """Overlapping tilted discs: a slow rise and a steep, curved edge."""
    size = 0.72 * _sizes(cells, spread, rng)
    x, y = cells.offsets[..., 0], cells.offsets[..., 1]
    inside = 1 / (1 + np.exp(np.clip((cells.distances - size) / 0.03, -50, 50)))
    return _soft_max((0.9 + 0.8 * x / size - 0.35 * (y / size) ** 2) * inside)


def grooves(body: Body, wavelength: float) -> FloatArray:
    """Rings of rounded grooves round the tube."""
    a, _ = _turns(body, wavelength, wavelength)
    return np.asarray(np.tanh(1.5 * np.cos(2 * np.pi * a)))


def ribs(body: Body, wavelength: float) -> FloatArray:
    """Ribs along the tube, round on top and sharp in the valleys."""
    _, b = _turns(body, wavelength, wavelength)
    return np.asarray(np.abs(np.cos(np.pi * b)))


def rope(body: Body, wavelength: float) -> FloatArray:
    """Round strands twisted round the tube."""
    a, b = _turns(body, 1.6 * wavelength, 1.3 * wavelength)
    return np.asarray(np.abs(np.cos(np.pi * (a + b))))


def knurl(body: Body, wavelength: float) -> FloatArray:
    """Two crossing sets of ribs."""
    a, b = _turns(body, 1.4 * wavelength, 1.4 * wavelength)
    left, right = np.abs(np.cos(np.pi * (a + b))), np.abs(np.cos(np.pi * (a - b)))
    return np.asarray(np.minimum(left, right))


def woven(body: Body, wavelength: float) -> FloatArray:
    """Strands that pass over and under each other."""
    a, b = _turns(body, 1.6 * wavelength, 1.6 * wavelength)
    over = np.cos(2 * np.pi * (a - 0.25) + np.pi * np.floor(2 * b))
    under = -np.cos(2 * np.pi * (b - 0.25) + np.pi * np.floor(2 * a))
    along = np.abs(np.sin(2 * np.pi * b)) ** 0.7 + 0.5 * over
    across = np.abs(np.sin(2 * np.pi * a)) ** 0.7 + 0.5 * under
    return _soft_max(np.stack([along, across], axis=-1), 8.0)


def bricks(body: Body, wavelength: float) -> FloatArray:
    """Bricks in a running bond."""
    a, b = _turns(body, 1.7 * wavelength, wavelength)
    x = a + 0.5 * (np.floor(b) % 2)
    upright = np.abs(x - np.round(x)) * 1.7
    level = np.abs(b - np.round(b))
    return np.asarray(1 - np.exp(-((np.minimum(upright, level) / 0.14) ** 2)))


def chevrons(body: Body, wavelength: float) -> FloatArray:
    """Zigzag ridges, as on a plait."""
    a, b = _turns(body, wavelength, 2.2 * wavelength)
    zigzag = 2 * np.abs(b - np.round(b))
    return np.asarray(np.abs(np.cos(np.pi * (a + zigzag))))


def braid(body: Body, wavelength: float) -> FloatArray:
    """Three interlaced strands side by side, repeated round the tube."""
    a, b = _turns(body, 2.2 * wavelength, 2.2 * wavelength)
    strands = []
    for third in range(3):
        t = 2 * np.pi * (a + third / 3)
        gap = b - 0.25 * np.sin(t)
        gap -= np.round(gap)
        strands.append(_round(np.abs(gap), 0.26) * (1 + 0.45 * np.sin(2 * t)))
    return _soft_max(np.stack(strands, axis=-1))


def eggbox(body: Body, wavelength: float) -> FloatArray:
    """Sum of two crossing waves."""
    a, b = _turns(body, wavelength, wavelength)
    return np.asarray(np.cos(2 * np.pi * a) + np.cos(2 * np.pi * b))


def wrinkles(body: Body, wavelength: float) -> FloatArray:
    """Grooves bent by slow waves and of varying depth: they repeat only loosely."""
    a, _ = _turns(body, wavelength, wavelength)
    c, d = _turns(body, 5.3 * wavelength, 3.7 * wavelength)
    slow = np.sin(2 * np.pi * c + 1.0) * np.cos(2 * np.pi * d)
    depth = 1 + 0.4 * np.sin(2 * np.pi * (c + d) + 2.0)
    return np.asarray(np.cos(2 * np.pi * a + 2.2 * slow) * depth)


@dataclass(frozen=True)
class Detail:
    """How one family is laid out and drawn.

    Attributes
    ----------
    wave, cell : callable or None
        The height field; exactly one is given.
    square : bool
        Square lattice instead of a hexagonal one.
    jitter : float
        How far centres are moved, in wavelengths.
    loose : bool
        Whether the pattern repeats only loosely.
    """

    wave: WaveHeight | None = None
    cell: CellHeight | None = None
    square: bool = False
    jitter: float = 0.0
    loose: bool = False

    def height(self, body: Body, wavelength: float, rng: np.random.Generator) -> FloatArray:
        """Height of every vertex of the body, in arbitrary units, shape (n,)."""
        if self.wave is not None:
            return self.wave(body, wavelength)
        if self.cell is None:
            return np.zeros(len(body.vertices))
        cells = chart_cells(body, wavelength, square=self.square, jitter=self.jitter, rng=rng)
        return self.cell(cells, rng)


DETAILS: dict[str, Detail] = {
    "smooth": Detail(),
    "bumps": Detail(cell=bumps),
    "bumps_square": Detail(cell=bumps, square=True),
    "dimples": Detail(cell=dimples),
    "honeycomb": Detail(cell=honeycomb),
    "plates": Detail(cell=plates),
    "rings": Detail(cell=rings),
    "stars": Detail(cell=stars, square=True),
    "studs": Detail(cell=studs, square=True),
    "scales": Detail(cell=scales),
    "grooves": Detail(wave=grooves),
    "ribs": Detail(wave=ribs),
    "rope": Detail(wave=rope),
    "knurl": Detail(wave=knurl),
    "woven": Detail(wave=woven),
    "bricks": Detail(wave=bricks),
    "chevrons": Detail(wave=chevrons),
    "braid": Detail(wave=braid),
    "eggbox": Detail(wave=eggbox),
    "bumps_jittered": Detail(cell=lambda c, r: bumps(c, r, 0.35), jitter=0.15, loose=True),
    "scales_varied": Detail(cell=lambda c, r: scales(c, r, 0.2), jitter=0.1, loose=True),
    "pebbles": Detail(cell=lambda c, r: plates(c, r, 0.3), jitter=0.22, loose=True),
    "wrinkles": Detail(wave=wrinkles, loose=True),
}
