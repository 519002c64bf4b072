"""What each stage of preset paper makes of the normals, and what true ones would make."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.cases import Problem
from benchmarks.paper_cases import Setting
from meshlab_lowrank.comparison.figures import error_figures
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.hole import Hole, start_hole
from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.geometry import FloatArray, normalized, vertex_normals
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.pipeline import recover
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_region import Region, cut_region
from meshlab_lowrank.stages.stage5_refine import Refine
from meshlab_lowrank.stages.stage5_refine_nothing import NoRefinement
from meshlab_lowrank.stages.stage6b_update_iterative import IterativeUpdate


@dataclass(frozen=True)
class Unmoved(Stage):
    """A vertex update that moves nothing, so that the normals can be looked at."""

    def __call__(self, hole: Hole) -> Hole:
        """Give the hole as it is."""
        return hole


class Stages:
    """One hole, closed and faired, and what stages make of it.

    Parameters
    ----------
    problem : Problem
    setting : Setting
    """

    def __init__(self, problem: Problem, setting: Setting) -> None:
        self._problem = problem
        self._pipeline = replace(setting.pipeline(), passes=1, update=Unmoved())
        self._refinement = setting.pipeline().refine
        loop = problem.loop
        region = cut_region(
            problem.vertices, problem.faces, loop.vertices, loop.faces, reach=AUTO.reach
        )
        (closed,) = self._pipeline.close([region], edge_lengths=[None])
        faired = closed if isinstance(closed, StageError) else self._pipeline.fair([closed])[0]
        if isinstance(faired, StageError):
            raise faired
        self.region: Region = faired.region
        self.smooth = start_hole(
            self.region.vertices,
            self.region.faces,
            unknown=~self.region.known_vertices,
            known_faces=self.region.known_faces,
            loop=self.region.loop,
            rim_normals=True,
        )

    def completed(self) -> Hole:
        """Give the hole with the normals of completion and diffusion."""
        return self._recovered(NoRefinement())

    def refined(self) -> Hole:
        """Give the hole with the normals of the refinement."""
        return self._recovered(self._refinement)

    def _recovered(self, refine: Refine) -> Hole:
        found = recover(self.smooth, replace(self._pipeline, refine=refine))
        if found is None:
            msg = "Its surroundings have too few patches."
            raise StageError(msg)
        return found

    def true(self) -> Hole:
        """Give the hole with the normals of the truth where it is nearest."""
        truth = self._problem.truth
        unknown = self.smooth.unknown
        points = self.region.to_global(self.smooth.positions[unknown])
        near = TriangleIndex(truth.vertices, truth.faces).closest(points)
        there = vertex_normals(truth.vertices, truth.faces)[truth.faces[near.faces]]
        normals = self.smooth.normals.copy()
        normals[unknown] = normalized(np.einsum("pi,pij->pj", near.barycentric, there))
        weights = np.where(unknown, 1.0, self.smooth.weights)
        return replace(self.smooth, normals=normals, weights=weights)

    def angle(self, hole: Hole) -> float:
        """Mean angle in degrees between the normals of a hole and the true ones, in the fill."""
        unknown = hole.unknown
        normals = hole.normals
        if not normals[unknown].any():
            normals = vertex_normals(hole.positions, hole.faces)
        cosine = np.einsum("ij,ij->i", normals[unknown], self.true().normals[unknown])
        return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).mean())

    def rms(self, positions: FloatArray) -> float:
        """Distance of a fill from the truth: root mean square, in mean edge lengths."""
        region = self.region
        fill = SurfacePart(region.to_global(positions), region.faces, ~region.known_faces)
        length = self._problem.edge_length
        return error_figures(fill, self._problem.truth, length).rms / length


def stage_figures(problem: Problem, setting: Setting) -> dict[str, float]:
    """Measure the stages of preset paper on one hole, and what true normals would give.

    Returns
    -------
    dict
        Angles in degrees: "smooth", "completed", "refined". Root mean square errors over that of
        the smooth fill: "completed fill", "refined fill" and "true fill" by the 20 steps of the
        usual update; "true fill, 1000 steps"; "true fill, direct" by our least squares.
    """
    stages = Stages(problem, setting)
    completed, refined, true = stages.completed(), stages.refined(), stages.true()
    smooth = stages.rms(stages.smooth.positions)
    usual = IterativeUpdate(niter=20)
    fills = {
        "completed fill": usual(completed),
        "refined fill": usual(refined),
        "true fill": usual(true),
        "true fill, 1000 steps": IterativeUpdate(niter=1000)(true),
        "true fill, direct": AUTO.update(true),
    }
    return {
        "smooth": stages.angle(stages.smooth),
        "completed": stages.angle(completed),
        "refined": stages.angle(refined),
        **{name: stages.rms(hole.positions) / smooth for name, hole in fills.items()},
    }
