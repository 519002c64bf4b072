"""The process that draws a mesh with numbered holes; see `rendering`."""

from __future__ import annotations

import importlib
import itertools
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from meshlab_lowrank import lifeline
from meshlab_lowrank.mesh.boundary_walk import rim_centre
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import vertex_components
from meshlab_lowrank.report.label_sheet import Panel, compose
from meshlab_lowrank.report.rendering import COLOUR_MAP
from meshlab_lowrank.report.sides import Side, choose, sides_of, worth

_SURFACE, _INSIDE, _RIM, _UNKNOWN = "#c9ced6", "#6b7280", "#c2185b", "#e39a4f"
_PIXELS = 800  # of a panel
_COARSE = 256  # of a picture by which a side is judged
_MARGIN = 1.15  # around the mesh, in its own size
_HIDDEN = 0.01  # depth behind which a rim counts as hidden, in sizes of the mesh
_AWAY = 2.0  # of the camera, in sizes of the mesh
_SHOWN = 0.5  # part of a rim that must be seen then
_WELL = 0.6  # of the best sight of a hole, from which on it is numbered in other panels too
_MOST_NUMBERS = 100


class _Scene:
    """A mesh and the rims of its holes before a camera."""

    def __init__(self, pv: Any, arrays: dict[str, Any]) -> None:
        faces: IntArray = arrays["faces"]
        used = arrays["vertices"][np.unique(faces)]
        low, high = used.min(axis=0), used.max(axis=0)
        size = float(np.linalg.norm(high - low)) or 1.0
        # of size 1 around the origin: far from it, graphics cards round
        vertices: FloatArray = (arrays["vertices"] - 0.5 * (low + high)) / size
        self.extent = (high - low) / size
        self.corners = vertices[np.unique(faces)]
        ends = arrays["ends"]
        parts = [arrays["rims"][a:b] for a, b in itertools.pairwise(ends)]
        self.rims = [vertices[rim] for rim in parts]
        self.normals: FloatArray = arrays["normals"].reshape(-1, 3)
        self.outer: BoolArray = arrays["outer"]
        self._pv = pv
        self._plotter = pv.Plotter(off_screen=True, window_size=(_PIXELS, _PIXELS), lighting="none")
        self._plotter.set_background("white")
        self._plotter.enable_parallel_projection()
        self.filled: BoolArray = arrays["filled"]
        self.bars: FloatArray = arrays["bars"]
        self._add(vertices, faces[~self.filled])
        fills = faces[self.filled]
        told = _with_bars(fills, self.bars)
        self.unknown = not told.all()
        if told.any():
            self._add_bars(vertices, fills[told])
        if self.unknown:
            self._add(vertices, fills[~told], _UNKNOWN)
        self._plotter.show(auto_close=False)  # else there are no depths

    def _add(self, vertices: FloatArray, faces: IntArray, colour: str = _SURFACE) -> None:
        look = {"ambient": 0.25, "diffuse": 0.8, "specular": 0.0, "reset_camera": False}
        surface = self._pv.PolyData.from_regular_faces(vertices, faces)
        self._plotter.add_mesh(
            surface, color=colour, backface_params={"color": _INSIDE}, render=False, **look
        )

    @property
    def largest_bar(self) -> float:
        """The largest error bar that is known; 0 if none is."""
        known = self.bars[np.isfinite(self.bars)]
        return float(known.max(initial=0.0))

    def _add_bars(self, vertices: FloatArray, faces: IntArray) -> None:
        surface = self._pv.PolyData.from_regular_faces(vertices, faces)
        self._plotter.add_mesh(
            surface,
            scalars=self.bars,
            cmap=COLOUR_MAP,
            clim=(0.0, self.largest_bar or 1.0),
            show_scalar_bar=False,
            ambient=0.5,
            diffuse=0.6,
            reset_camera=False,
            render=False,
        )

    def add_rims(self) -> None:
        """Draw the rims; they would hide themselves while sides are judged."""
        self._plotter.enable_anti_aliasing("ssaa")
        for points in self.rims:
            line = self._pv.lines_from_points(np.vstack([points, points[:1]]))
            self._plotter.add_mesh(
                line, color=_RIM, line_width=4, lighting=False, reset_camera=False, render=False
            )

    def look(self, side: Side, pixels: int) -> tuple[FloatArray, float]:
        """Turn the camera: the middle of the picture (2,), and the units of a pixel."""
        plotter = self._plotter
        plotter.window_size = (pixels, pixels)
        plotter.remove_all_lights()
        raking = 0.7 * side.up - 0.8 * side.right + 0.9 * side.towards
        for direction, intensity in ((raking, 0.75), (side.towards, 0.35)):
            light = self._pv.Light(
                position=direction, focal_point=(0.0, 0.0, 0.0), intensity=intensity
            )
            light.positional = False
            plotter.add_light(light)
        flat = side.across(self.corners)
        middle = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
        scale = 0.5 * _MARGIN * float(np.ptp(flat, axis=0).max()) or 1.0
        focus = middle[0] * side.right + middle[1] * side.up
        camera = plotter.camera
        camera.focal_point = focus
        camera.position = focus + _AWAY * side.towards
        camera.up = side.up
        camera.parallel_scale = scale
        camera.clipping_range = (_AWAY - 1.0, _AWAY + 1.0)
        plotter.render()
        return middle, 2.0 * scale / pixels

    def picture(self) -> Any:
        """Give what the camera sees."""
        return self._plotter.screenshot(None, return_img=True)

    def shown(self, side: Side, middle: FloatArray, unit: float) -> FloatArray:
        """Give the part of each rim that nothing hides, (h,)."""
        depth = np.nan_to_num(
            -self._plotter.get_image_depth(reset_camera_clipping_range=False), nan=np.inf
        )
        parts = []
        for points in self.rims:
            places = pixels_of(side, points, middle, unit, depth.shape[0]).round().astype(int)
            column, row = np.clip(places, 1, depth.shape[0] - 2).T
            nearest = np.max(
                [depth[row + r, column + c] for r in (-1, 0, 1) for c in (-1, 0, 1)], axis=0
            )  # a rim has nothing beside it on one side
            distance = _AWAY - points @ side.towards
            parts.append(np.mean(distance <= nearest + _HIDDEN))
        return np.array(parts)


def pixels_of(
    side: Side, points: FloatArray, middle: FloatArray, unit: float, pixels: int
) -> FloatArray:
    """Give the pixels (k, 2), from left and top, at which points (k, 3) are seen."""
    places = (side.across(points) - middle) / unit
    return np.asarray(places * [1.0, -1.0] + 0.5 * pixels)


def main(job: str) -> None:
    """Draw the picture of a job file."""
    names = json.loads(Path(job).read_text(encoding="utf-8"))
    pv: Any = importlib.import_module("pyvista")
    pv.OFF_SCREEN = True
    with np.load(names["arrays"]) as arrays:
        scene = _Scene(pv, dict(arrays))
    sides = sides_of(scene.extent)
    values = np.zeros((len(sides), len(scene.rims)))
    parts = np.zeros_like(values)
    for i, side in enumerate(sides):
        parts[i] = scene.shown(side, *scene.look(side, _COARSE))
        values[i] = worth(scene.normals, scene.outer, parts[i], side)
    chosen = choose(values)
    numbered = np.zeros(len(scene.rims), dtype=np.bool_)
    numbered[:_MOST_NUMBERS] = True
    best = values[chosen].max(axis=0, initial=0.0)
    scene.add_rims()
    panels = []
    for i in chosen:
        well = (parts[i] >= _SHOWN) & (values[i] >= _WELL * best) & (values[i] > 0.0)
        panels.append(_panel(scene, sides[i], numbered & (well | (values[i] == best) & (best > 0))))
    told = " ".join(filter(None, (_scale(scene), _told(numbered, best > 0.0))))
    compose(panels, told).save(names["target"])
    Path(names["told"]).write_text(told, encoding="utf-8")


def _panel(scene: _Scene, side: Side, here: BoolArray) -> Panel:
    middle, unit = scene.look(side, _PIXELS)
    marks = {}
    for number in np.flatnonzero(here):
        rim = pixels_of(side, scene.rims[number], middle, unit, _PIXELS)
        outer = scene.outer[number]  # the gap lies around the surface
        beside = outer or scene.filled.any()  # so that numbers hide no fill
        spot = rim[rim[:, 1].argmax()] if beside else rim_centre(rim)
        radius = 0.0 if beside else 0.5 * float(np.ptp(rim, axis=0).min())
        marks[int(number)] = (float(spot[0]), float(spot[1]), radius)
    outline = pixels_of(side, scene.corners, middle, unit, _PIXELS)
    box = (*outline.min(axis=0).tolist(), *outline.max(axis=0).tolist())
    return Panel(scene.picture(), f"seen from {side.name}", marks, box)


def _scale(scene: _Scene) -> str:
    """Say what the colours of fills are."""
    if not scene.filled.any():
        return ""
    told = f"Error bars of fills from 0 (dark) to {scene.largest_bar:.3g} (bright)."
    return f"{told} Orange: not known." if scene.unknown else told


def _with_bars(fills: IntArray, bars: FloatArray) -> BoolArray:
    """Mark the faces (f, 3) of fills that have error bars: at new vertices, and known ones."""
    part = vertex_components(fills, len(bars))[fills[:, 0]]
    known = np.isfinite(bars[fills]).all(axis=1) & bars[fills].any(axis=1)
    return np.asarray(np.isin(part, part[known]))


def _told(numbered: BoolArray, seen: BoolArray) -> str:
    hidden = ", ".join(map(str, np.flatnonzero(numbered & ~seen)))
    told = [f"Hidden from all of these sides: {hidden}."] if hidden else []
    if not numbered.all():
        told.append(f"Only the {_MOST_NUMBERS} longest holes have numbers.")
    return " ".join(told)


if __name__ == "__main__":
    lifeline.die_with_parent(int(sys.argv[2]))
    lifeline.die_with_input()
    main(sys.argv[1])
