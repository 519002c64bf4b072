"""The process that draws the pictures of a report with PyVista, without a screen.

It is a process of its own since a renderer without a usable driver may take its process down.
Called with the name of a file, a JSON list of pictures, each with the arrays to draw, camera and
target, and with the number of the process that waits for them, whose end is its end.
"""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from meshlab_lowrank import lifeline

HOW_TO_GET = (
    "Pictures are drawn by PyVista, which is not installed: "
    "pip install 'meshlab-lowrank[pictures]'."
)
COLOUR_MAP = "cividis"
_SURFACE = "#c9ced6"
_FILL = "#e39a4f"  # of a part that is marked
_PIXELS = 420
_QUALITY = 82


def missing_renderer() -> str:
    """Say what to install before pictures can be drawn; empty if it is there."""
    return "" if importlib.util.find_spec("pyvista") else HOW_TO_GET


def main(job: str) -> None:
    """Draw every picture of a job file."""
    pv: Any = importlib.import_module("pyvista")
    pv.OFF_SCREEN = True
    plotter = pv.Plotter(off_screen=True, window_size=(_PIXELS, _PIXELS), lighting="none")
    plotter.set_background("white")
    plotter.enable_parallel_projection()
    plotter.enable_anti_aliasing("ssaa")
    for picture in json.loads(Path(job).read_text(encoding="utf-8")):
        _draw(pv, plotter, picture)
    plotter.close()


def _draw(pv: Any, plotter: Any, picture: dict[str, Any]) -> None:
    plotter.clear_actors()
    plotter.remove_all_lights()
    centre, up = np.array(picture["centre"]), np.array(picture["up"])
    towards = np.array(picture["towards"])
    right = np.cross(up, towards)
    raking = 0.7 * up - right + 0.9 * towards  # from the upper left, so that low relief shows
    for direction, intensity in ((raking, 0.8), (towards, 0.25)):
        light = pv.Light(position=centre + direction, focal_point=centre, intensity=intensity)
        light.positional = False
        plotter.add_light(light)
    look = {"ambient": 0.12, "diffuse": 0.9, "specular": 0.0}
    with np.load(picture["arrays"]) as arrays:
        for name in picture["surfaces"]:
            if len(arrays[f"{name}_faces"]) == 0:
                continue
            surface = pv.PolyData.from_regular_faces(
                arrays[f"{name}_vertices"], arrays[f"{name}_faces"]
            )
            values = arrays.get(f"{name}_values")
            if values is None:
                colour = _FILL if name == "fill" else _SURFACE
                plotter.add_mesh(surface, color=colour, reset_camera=False, render=False, **look)
            else:
                plotter.add_mesh(
                    surface,
                    scalars=values,
                    cmap=COLOUR_MAP,
                    clim=(0.0, picture["limit"]),
                    show_scalar_bar=False,
                    reset_camera=False,
                    render=False,
                    ambient=0.5,
                    diffuse=0.6,
                )
    plotter.camera.focal_point = centre
    plotter.camera.position = centre + 10.0 * picture["scale"] * towards
    plotter.camera.up = up
    plotter.camera.parallel_scale = picture["scale"]
    plotter.camera.clipping_range = (picture["scale"], 20.0 * picture["scale"])
    plotter.render()  # the camera moved after the last surface was added
    image = plotter.screenshot(None, return_img=True)
    drawn = importlib.import_module("PIL.Image").fromarray(image)  # comes with PyVista
    drawn.save(picture["target"], quality=_QUALITY, optimize=True)


if __name__ == "__main__":
    lifeline.die_with_parent(int(sys.argv[2]))
    lifeline.die_with_input()
    main(sys.argv[1])
