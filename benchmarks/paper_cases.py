"""The holes and the ways to fill them with which the paper's experiments are done again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cases import Cell, Problem, load_model, punched, punched_at
from benchmarks.catalogue import SAMPLES, Hole, Model, shape
from meshlab_lowrank.parameters import Base, InpaintParameters
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.presets import pipeline_of
from meshlab_lowrank.stages.stage5_refine_nothing import NoRefinement

LEG = (0.24, -0.4, 0.08)  # before the bumps of a shin of the armadillo


@dataclass(frozen=True)
class PaperCase:
    """A model with one hole.

    Attributes
    ----------
    title : str
    stands_for : str
        The model of the paper that it is, or comes nearest to; empty if it is one more.
    model : Model
    hole : Hole
    iterations : int
        The paper's S_iter.
    near : (x, y, z) or None
        The hole is at the vertex nearest to it; None: where the benchmark punches it.
    """

    title: str
    stands_for: str
    model: Model
    hole: Hole
    iterations: int = 1
    near: tuple[float, float, float] | None = None

    def problem(self) -> Problem:
        """Punch the hole."""
        vertices, faces = load_model(self.model)
        cell = Cell(self.model, self.hole, 0)
        if self.near is None:
            found = punched(cell, vertices, faces)
        else:
            place = int(np.argmin(np.linalg.norm(vertices - self.near, axis=1)))
            found = punched_at(cell, vertices, faces, place)
        if found is None:
            msg = f"{self.title} has no place for the hole."
            raise SystemExit(msg)
        return found


def paper_cases(folder: Path | None) -> dict[str, PaperCase]:
    """Give the cases by their short names.

    Parameters
    ----------
    folder : Path or None
        With ``armadillo.obj``; without it its legs are left out.
    """
    small, wide, large = Hole(8.0), Hole(12.0), Hole(14.0)
    cases = {
        "hair": PaperCase(
            "strands (torus-rope)", "Child's hair", shape("torus", "rope", 30, 9.0), small
        ),
        "scale": PaperCase(
            "scales (torus)", "Merlion's scale", shape("torus", "scales", 50, 12.0), small
        ),
        "bumps": PaperCase("sample bumps", "", Model(SAMPLES / "bumps.ply", "repeated"), small),
        "knurl": PaperCase("sample knurl", "", Model(SAMPLES / "knurl.ply", "repeated"), small),
        "big": PaperCase(
            "bumps (torus), big hole", "", shape("torus", "bumps", 70, 10.0), wide, iterations=7
        ),
    }
    armadillo = folder / "armadillo.obj" if folder else None
    if armadillo and armadillo.exists():
        leg = Model(armadillo, "real")
        name = "Armadillo's leg"
        cases = {
            "leg": PaperCase(name.lower(), name, leg, small, near=LEG),
            "leg-big": PaperCase(
                f"{name.lower()}, big hole",
                f"{name} (big hole)",
                leg,
                large,
                iterations=7,
                near=LEG,
            ),
            **cases,
        }
    return cases


@dataclass(frozen=True)
class Setting:
    """A setting of preset paper.

    Attributes
    ----------
    refined : bool
        With the refinement of section 3.4.3, or without.
    base : {"meshlab", "bspline"}
    iterations, patchsize, ringnumber : int
        The paper's S_iter, sp and r.
    """

    refined: bool = True
    base: Base = "meshlab"
    iterations: int = 1
    patchsize: int = 100
    ringnumber: int = 8

    def pipeline(self) -> Pipeline:
        """Give the pipeline of this setting."""
        parameters = InpaintParameters.paper(
            base=self.base,
            iterations=self.iterations,
            patchsize=self.patchsize,
            ringnumber=self.ringnumber,
        )
        found = pipeline_of(parameters)
        return found if self.refined else replace(found, refine=NoRefinement())


CHAIN = '''"""Preset paper: {setting}."""

from benchmarks.paper_cases import Setting, run_setting


def chain(ms):
    run_setting(ms, {setting})
'''


def run_setting(ms: Any, setting: Setting) -> None:
    """Fill the selected loops of the current mesh with a setting of preset paper."""
    ms.meshing_inpaint_lowrank(
        selected=True, closerim=True, detail="full", pipeline=setting.pipeline()
    )


def chain_of(setting: Setting, folder: Path) -> str:
    """Write a filler of a setting; give its path."""
    folder.mkdir(parents=True, exist_ok=True)
    values = "-".join(str(value) for value in vars(setting).values())
    path = folder / f"{values}.py"
    path.write_text(CHAIN.format(setting=setting), encoding="utf-8")
    return str(path)
