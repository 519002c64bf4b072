"""Figures that tell whether a fill looks like what was cut out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import feathers
from benchmarks.cases import Cell, load_model, punched
from benchmarks.catalogue import MODELS, Hole
from benchmarks.full import HEADER, RADII, lines, summary
from benchmarks.full_figures import looks, surfaces


@pytest.fixture(scope="module")
def problem():
    model = next(model for model in MODELS if model.name == "knurl")
    return punched(Cell(model, Hole(6.0), 0), *load_model(model))


@pytest.fixture(scope="module")
def truth(problem):
    """The problem with what was cut out put back, its vertices after those of the mesh."""
    whole = problem.truth
    fill, same = surfaces(problem, (whole.vertices, whole.faces))
    assert fill.part.sum() == same.part.sum()
    return same


def inner_vertex(surface):
    """A vertex of the part that no face outside it has."""
    own = np.setdiff1d(surface.faces[surface.part], surface.faces[~surface.part])
    middle = surface.vertices[own].mean(axis=0)
    return own[np.linalg.norm(surface.vertices[own] - middle, axis=1).argmin()]


def moved(surface, by):
    vertices = surface.vertices.copy()
    vertices[inner_vertex(surface)] += by
    return replace(surface, vertices=vertices)


def test_the_truth_looks_right_at_the_rim_and_inside(problem, truth):
    found = looks(problem, truth, truth)
    assert found.right
    assert found.flaws == 0
    assert found.rms == pytest.approx(0.0, abs=1e-6)
    for ratio in (found.roughness, found.dihedral, found.dihedral_at_rim, found.dihedral_inside):
        assert ratio == pytest.approx(1.0)


def test_a_spike_is_seen_and_a_move_along_the_surface_is_none(problem, truth):
    length = problem.edge_length
    spiked = looks(problem, moved(truth, 2.5 * length * problem.normal), truth)
    assert spiked.spikes >= 1
    assert not spiked.right
    along = np.cross(problem.normal, np.eye(3)[np.abs(problem.normal).argmin()])
    assert looks(problem, moved(truth, 0.2 * length * along), truth).spikes == 0


def test_a_fold_is_seen(problem, truth):
    along = np.cross(problem.normal, np.eye(3)[np.abs(problem.normal).argmin()])
    folded = looks(problem, moved(truth, 2.5 * problem.edge_length * along), truth)
    assert folded.folds >= 1
    assert not folded.right


def test_noise_is_seen_at_the_rim_or_inside_where_it_is(problem, truth):
    vertices = truth.vertices.copy()
    middle = vertices[inner_vertex(truth)]
    near = np.linalg.norm(vertices - middle, axis=1) < 2.0 * problem.edge_length
    noise = np.random.default_rng(0).normal(0.0, 0.15 * problem.edge_length, near.sum())
    vertices[near] += noise[:, None] * problem.normal
    found = looks(problem, replace(truth, vertices=vertices), truth)
    assert found.dihedral_inside > 1.2
    assert found.dihedral_at_rim < 1.1
    assert not found.right


def test_the_tables_have_a_line_for_each_hole_and_radius(problem, truth):
    figures = vars(looks(problem, truth, truth))
    rough = {**figures, "rms": 1.0, "dihedral_at_rim": 1.4}
    smooth = {**figures, "rms": 1.0, "roughness": 0.3}
    common = {"model": "knurl", "seed": 0, "reason": "", "seconds": 1.0, "smooth": smooth}
    rows = [{**common, "radius": radius, "full": figures} for radius in RADII]
    rows.append({**common, "radius": RADII[0], "full": rough})
    table = lines(rows)
    assert [line[-1] for line in table] == ["both", "both", "both", "RMS"]
    assert all(len(line) == len(HEADER) for line in table)
    assert "| 8 h | 2 | 0 | 1 | 2 | 1 |" in summary(rows)


def test_a_fill_of_feathers_is_set_beside_the_best_other_and_what_its_triangles_allow(
    monkeypatch, problem
):
    whole = problem.truth
    raised = whole.vertices.copy()
    raised[np.setdiff1d(whole.faces[whole.part], whole.faces[~whole.part])] += 0.1

    def run(problem, filler, time_limit):  # noqa: ARG001
        facts = {"status": "filled", "reason": "", "cpu_seconds": 2.0}
        return facts, (whole.vertices if filler == "lowrank" else raised, whole.faces)

    monkeypatch.setattr(feathers, "run_filler", run)
    options = SimpleNamespace(others=["close", "cgal"], time_limit=1.0, pictures=None)
    found = dict(zip(feathers.HEADER, feathers.line("there", problem, options), strict=True))
    assert found["over best other"] == "0.00"
    assert found["roughness"] == "1.00"
    assert float(found["smooth, h"]) > float(found["ours, h"]) == 0.0
    assert float(found["exact positions, over best other"]) < 1.0
