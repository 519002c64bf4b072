"""An even surface tried where trials on the triangles of the mesh itself gain nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from meshlab_lowrank.mesh.geometry import edge_lengths
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.solving import solve_hole
from meshlab_lowrank.stages.stage1b_fair_harmonic import fair_region
from meshlab_lowrank.stages.stage1c_level_even import EvenLevel
from meshlab_lowrank.tuning.judging import Belief
from meshlab_lowrank.tuning.tune import Look, Tuned, Unquestioning
from tests.builders import region_of

STRETCHED = 2.6  # edges vary by 0.26 then


@pytest.fixture(scope="module")
def region(sheet):
    """Bumps on triangles that are stretched, and a hole."""
    points, faces = sheet(30, 64)
    points = (points - points.mean(axis=0)) * [STRETCHED, 1.0, 1.0]
    x, y = points[:, :2].T
    points[:, 2] = 0.6 * (np.cos(0.5 * x) + np.cos(0.5 * y))
    unknown = np.hypot(x, y) < 8.0
    return fair_region(region_of(points, faces, unknown))


@dataclass(frozen=True)
class Doubting(Unquestioning):
    """Tells what trials leave on the mesh itself, and on other surfaces, and notes which it saw."""

    own: int
    on_mesh: Belief
    on_others: Belief
    others_show: bool
    seen: list

    def look(self, hole):
        shown = len(hole.positions) == self.own or self.others_show
        return Look("" if shown else "nothing", 1.0, (12.0,), (1.0,))

    def __call__(self, hole, *_):
        mine = len(hole.positions) == self.own
        self.seen.append("mesh" if mine else "even")
        evidence = self.on_mesh if mine else self.on_others
        return Tuned(replace(hole, wavelength=12.0), evidence)


def tuned_on(region, monkeypatch, on_mesh, on_others, *, others_show=True, doubtful=0.22):
    """Give the surfaces that trials were made on, and the one that detail was recovered on."""
    own = len(region.vertices)
    recovered = []

    def recover(hole, *_, **__):
        recovered.append("mesh" if len(hole.positions) == own else "even")

    monkeypatch.setattr("meshlab_lowrank.solving.recover", recover)
    tune = Doubting(own, on_mesh, on_others, others_show, [])
    pipeline = replace(AUTO, level=EvenLevel(doubtful=doubtful), tune=tune, depth=np.inf)
    solve_hole(region, pipeline, detail="calibrated", report=lambda *_: None)
    return tune.seen, recovered[0]


def test_an_even_surface_is_tried_where_the_mesh_itself_gains_nothing(region, monkeypatch):
    poor, good = Belief(error=1.1), Belief(error=0.9)
    assert tuned_on(region, monkeypatch, poor, good) == (["mesh", "even"], "even")
    assert tuned_on(region, monkeypatch, poor, Belief(error=1.2)) == (["mesh", "even"], "mesh")
    assert tuned_on(region, monkeypatch, good, good) == (["mesh"], "mesh")


def test_no_time_is_spent_on_it_where_it_can_t_help(region, monkeypatch):
    poor, good = Belief(error=1.1), Belief(error=0.9)
    nothing = tuned_on(region, monkeypatch, poor, good, others_show=False)
    hopeless = tuned_on(region, monkeypatch, replace(poor, hopeless=True), good)
    even = tuned_on(region, monkeypatch, poor, good, doubtful=0.3)
    assert nothing == hopeless == even == (["mesh"], "mesh")


def test_less_patience_with_the_mesh_itself(region):
    lengths = edge_lengths(region.vertices, region.faces)
    assert 0.22 < lengths.std() / lengths.mean() < 0.3
    assert EvenLevel()(region, 1.0, rim_normals=False).is_mesh
    assert not EvenLevel().for_even()(region, 1.0, rim_normals=False).is_mesh
    assert AUTO.for_even().level == EvenLevel().for_even()
    assert EvenLevel(uneven=0.1).for_even().uneven == 0.1
