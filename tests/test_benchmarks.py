"""The benchmark's catalogue, problems, runs and tables."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks import calibration, calibration_page, run, scaling, sheets
from benchmarks.cases import Cell, fits, load_model, punched
from benchmarks.catalogue import HELD_OUT_SEEDS, HOLES, KINDS, MODELS, SEEDS, Hole, Shape
from benchmarks.runs import measure_run, run_filler
from benchmarks.tables import report
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from sample_meshes.bodies import BODIES
from sample_meshes.details import DETAILS

BY_NAME = {model.name: model for model in MODELS}


@pytest.fixture(scope="module")
def problem():
    model = BY_NAME["knurl"]
    return punched(Cell(model, Hole(6.0), 0), *load_model(model))


def test_names_are_unique_and_recipes_known():
    assert len(BY_NAME) == len(MODELS)
    assert len({hole.name for hole in HOLES}) == len(HOLES)
    assert {model.kind for model in MODELS} == set(KINDS)
    for model in MODELS:
        if isinstance(model.source, Shape):
            assert model.source.body in BODIES
            assert model.source.detail in DETAILS
        else:
            assert model.source.exists()


def test_held_out_details_are_not_tuned_on():
    def details(*, held_out):
        found = set()
        for model in MODELS:
            if model.held_out == held_out and isinstance(model.source, Shape):
                found.add((model.source.detail, model.source.body))
        return found

    assert details(held_out=True)
    shared = details(held_out=True) & details(held_out=False)
    assert shared <= {("bumps_jittered", "torus")}  # with another seed and wavelength
    assert not set(SEEDS) & set(HELD_OUT_SEEDS)


def test_the_calibration_tells_bars_that_hold_from_those_that_do_not(problem):
    found = calibration.measure(problem, "none")
    assert found["way"] == "smooth"
    assert found["known"]
    assert found["coverage"] == sorted(found["coverage"])
    assert 0.0 < found["bar"] < 5.0
    row = {"kind": "repeated", "radius": 8.0, **found}
    factors = calibration.FACTORS.tolist()
    right = {
        **row,
        "bar": 1.0,
        "square": 1.0,
        "coverage": np.interp(factors, [0, 1, 2], [0, 0.7, 0.95]),
    }
    text = calibration_page.page([right, right], factors, plot_name="plot.png")
    assert "| smooth, repeated, radius 8 | 2 | 0.70 | 0.95 | 1.00 |" in text
    long = {**right, "bar": 2.0, "known": False}
    text = calibration_page.page(
        [right, long, {**long, "known": True}], factors, plot_name="plot.png"
    )
    assert "| all | 2 | 0.70 | 0.95 | 1.50 |" in text
    assert "on 1 of 3 fills" in text
    short = {**right, "coverage": np.interp(factors, [0, 1, 2], [0, 0.5, 0.8])}
    assert "**0.50** | **0.80**" in calibration_page.page([short], factors, plot_name="plot.png")


def test_bars_are_judged_where_they_were_not_tuned():
    tuned, held_out = (list(calibration.groups(each, None)) for each in (False, True))
    assert {group.model.kind for group in held_out} == set(KINDS)
    names = [{group.model.name for group in some} for some in (tuned, held_out)]
    assert names[0] & names[1] == {"bunny"}  # at other places
    assert calibration.FIRST_SEED[True] - calibration.FIRST_SEED[False] > 10


def test_a_problem_is_the_model_less_its_truth(problem):
    truth = problem.truth
    assert len(problem.faces) + truth.part.sum() == len(truth.faces)
    assert np.array_equal(truth.vertices[truth.faces[~truth.part]], problem.vertices[problem.faces])
    assert [loop.id for loop in problem.loops] == [problem.loop.id]
    assert 0.5 < problem.edge_length < 1.5
    assert 4.0 < problem.radius < 9.0


def test_the_same_seed_gives_the_same_place(problem):
    model = problem.cell.model
    again = punched(Cell(model, Hole(6.0), 0), *load_model(model))
    other = punched(Cell(model, Hole(6.0), 1), *load_model(model))
    assert np.array_equal(again.faces, problem.faces)
    assert np.linalg.norm(other.centre - problem.centre) > 1.0


def test_large_holes_are_left_out_of_small_models(problem):
    model = problem.cell.model
    vertices = problem.truth.vertices
    assert fits(Cell(model, Hole(8.0), 0), vertices)
    assert not fits(Cell(model, Hole(28.0), 0), vertices)


def test_the_truth_itself_has_no_error(problem):
    facts = {"status": "filled", "reason": "", "cpu_seconds": 1.0, "seconds": 1.0, "memory": 0}
    mesh = problem.truth.vertices, problem.truth.faces
    row = measure_run(problem, "truth", facts, mesh)
    assert row["status"] == "filled"
    assert row["rms_in_edges"] == pytest.approx(0.0, abs=1e-6)
    assert row["roughness"] == pytest.approx(1.0, abs=0.02)
    assert row["dihedral"] == pytest.approx(1.0, abs=1e-9)
    assert row["looks_right"] is True
    assert row["new_faces"] == problem.truth.part.sum()


def test_a_run_fails_by_itself(problem, tmp_path):
    def run_chain(body, time_limit):
        file = tmp_path / "chain.py"
        file.write_text(f"import os, time\ndef chain(ms): {body}\n")
        return run_filler(problem, str(file), time_limit)

    assert run_chain("os._exit(3)", 60.0)[0]["reason"] == "exit code 3"
    assert run_chain("time.sleep(60)", 0.2)[0]["status"] == "timed out"
    facts, mesh = run_chain("raise ValueError('not today')", 60.0)
    assert (facts["status"], mesh) == ("failed", None)
    assert "not today" in facts["reason"]


def test_results_are_kept_and_not_repeated(tmp_path, capsys):
    call = ["--models", "knurl", "--holes", "8h-round", "--seeds", "0", "--fillers", "close"]
    call += ["--output", str(tmp_path)]
    assert run.main(call) == 0
    lines = (tmp_path / "results.jsonl").read_text(encoding="utf-8").splitlines()
    row = json.loads(lines[0])
    assert len(lines) == 1
    assert row["status"] == "filled"
    assert 0.1 < row["rms_in_edges"] < 5.0
    assert row["known_surface_kept"]
    assert "close: filled" in capsys.readouterr().out
    assert run.main(call) == 0
    assert (tmp_path / "results.jsonl").read_text(encoding="utf-8").splitlines() == lines
    assert capsys.readouterr().out == ""
    assert "| close | 1 of 1 |" in (tmp_path / "results.md").read_text(encoding="utf-8")


def test_unknown_names_are_a_wrong_call(tmp_path, capsys):
    assert run.main(["--models", "nothing", "--output", str(tmp_path)]) == 2
    assert "--list" in capsys.readouterr().err


def test_ratios_are_to_the_best_of_the_others():
    def row(filler, model, seed, rms):
        shared = {"kind": "repeated", "radius": 8.0, "hole": "8h", "status": "filled"}
        figures = {"rms_in_edges": rms, "normal_error_degrees": rms, "cpu_seconds": rms}
        return {**shared, **figures, "filler": filler, "model": model, "seed": seed}

    rows = [
        *(row("ours", "a", seed, rms) for seed, rms in enumerate([1.0, 2.0, 9.0])),
        *(row("close", "a", seed, rms) for seed, rms in enumerate([8.0, 7.0, 8.0])),
        *(row("refine", "a", seed, rms) for seed, rms in enumerate([10.0, 10.0, 4.0])),
        *(row("peer", "a", seed, rms) for seed, rms in enumerate([4.0, 4.0, 4.0])),
        row("ours", "b", 0, 3.0),
        row("close", "b", 0, 3.0),
        row("peer", "b", 0, 6.0),
    ]
    text = report(rows, ["ours"], ["close", "refine"])
    line = next(line for line in text.splitlines() if line.startswith("| repeated | 8 | ours"))
    cells = [cell.strip() for cell in line.split("|")[1:-1]]
    assert cells[3:6] == ["2", "0.62 (1.00)", "0.50 (0.50)"]


def test_tables_tell_how_many_fills_look_right():
    rows = [
        {
            "kind": "real",
            "radius": 8.0,
            "hole": "8h",
            "status": "filled",
            "filler": "ours",
            "model": "a",
            "seed": seed,
            "dihedral": dihedral,
            "looks_right": right,
        }
        for seed, (dihedral, right) in enumerate([(1.0, True), (1.1, True), (4.1, False)])
    ]
    text = report(rows, ["ours"], ["close"])
    header = next(line for line in text.splitlines() if "looks right" in line)
    line = next(line for line in text.splitlines() if line.startswith("| ours | 3 of 3"))
    cells = dict(zip(header.split(" | "), line.split(" | "), strict=True))
    assert cells["dihedral"] == "1.10"
    assert cells["looks right"] == "67%"


def test_scaling_writes_what_it_measures(tmp_path):
    page = tmp_path / "scaling.md"
    sizes = ["--vertices", "8000", "--holes", "20", "--enlarged", "--growing", "--repeats", "1"]
    assert scaling.main([*sizes, "--page", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert " ".join(sizes) in text
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line[2:3].isdigit()]
    assert len(rows) == 1
    cpu, over, _, held, peak = (float(cell) for cell in rows[0][2:7])
    assert over == 1.0
    assert 0.0 < held < peak
    assert cpu > 0.0


def test_sheets_have_the_holes_that_are_asked_for():
    vertices, faces = sheets.one_ring_holes(80, 50)
    loops = boundary_loops(vertices, faces)
    assert [len(loop.vertices) for loop in loops[1:]] == 50 * [9]
    vertices, faces = sheets.sheet(10_000)
    assert len(vertices) == 10_000
    assert len(boundary_loops(vertices, faces)) == 1
    holed, rest = sheets.scattered_holes(vertices, faces, 20, 12)
    assert len(holed) == len(vertices) - 20 * 12
    assert len(boundary_loops(holed, rest)) >= 20
