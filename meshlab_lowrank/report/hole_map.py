"""A picture of a mesh with its holes numbered."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from meshlab_lowrank.errors import InvalidParameterError, LowrankError, MissingExtraError
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.report.renderer_process import run_renderer
from meshlab_lowrank.report.rendering import missing_renderer
from meshlab_lowrank.scratch import scratch_folder, written_whole

SUFFIXES = (".jpeg", ".jpg", ".png")


def check_picture(path: Path) -> None:
    """Refuse a picture that can't be drawn or written.

    Raises
    ------
    InvalidParameterError
        If its format is none of a picture, or there is no folder for it.
    MissingExtraError
        If what draws it is not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        msg = f"{path} is no name for a picture; end it in {' or '.join(SUFFIXES[1:])}."
        raise InvalidParameterError(msg)
    if not path.absolute().parent.is_dir():
        msg = f"There is no folder {path.parent} to write to; make it first."
        raise InvalidParameterError(msg)
    if missing := missing_renderer():
        raise MissingExtraError(missing)


def draw_hole_map(
    vertices: FloatArray,
    faces: IntArray,
    *,
    rims: Sequence[IntArray],
    normals: FloatArray,
    outer: BoolArray,
    target: Path,
    filled: BoolArray | None = None,
    bars: FloatArray | None = None,
) -> str:
    """Draw a mesh from the sides from which its holes are seen, with their numbers.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    rims : sequence of (k,) int64
        Vertices of each loop, in the order of the hole table.
    normals : (h, 3) float64
        Directions in which the holes look.
    outer : (h,) bool
        Whether they are outer rims.
    target : Path
        Picture to write, over what is there.
    filled : (m,) bool, optional
        Faces that fill holes, which are coloured by the error bars of their vertices.
    bars : (n,) float64, optional
        In mesh units; NaN where they are not known.

    Returns
    -------
    str
        Which holes have no number in it; empty if all have.

    Raises
    ------
    LowrankError
        If it can't be drawn.
    """
    with scratch_folder() as folder:
        arrays, told = folder / "mesh.npz", folder / "told.txt"
        picture, job = folder / f"picture{target.suffix.lower()}", folder / "job.json"
        ends = np.cumsum([0, *map(len, rims)])
        flat = np.concatenate([np.zeros(0, dtype=np.int64), *rims])
        np.savez(
            arrays,
            vertices=vertices,
            faces=faces,
            rims=flat,
            ends=ends,
            normals=normals,
            outer=outer,
            filled=np.zeros(len(faces), dtype=np.bool_) if filled is None else filled,
            bars=np.zeros(len(vertices)) if bars is None else bars,
        )
        names = {"arrays": str(arrays), "target": str(picture), "told": str(told)}
        job.write_text(json.dumps(names), encoding="utf-8")
        if reason := run_renderer("meshlab_lowrank.report.hole_map_rendering", job):
            raise LowrankError(reason)
        with written_whole(target) as place:
            place.write_bytes(picture.read_bytes())
        return told.read_text(encoding="utf-8")
