"""Progress events of a run, and stopping it."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from meshlab_lowrank.errors import InpaintCancelledError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.reporting import Reporter
from meshlab_lowrank.restoring import restore_detail
from meshlab_lowrank.threads import THREADS_VARIABLE
from sample_meshes.shapes import make_shape

QUICK = InpaintParameters(iterations=1, detail="full")


@pytest.fixture(scope="module")
def holed(sheet):
    """Egg box with a round hole and a single missing face; its rim stays open."""
    points, faces = sheet(44, 38)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    points[:, 2] = 0.4 * (np.cos(0.8 * x) + np.cos(0.8 * y))
    gone = (np.hypot(x, y) < 4.0)[faces].any(axis=1)
    gone[np.argmin(np.linalg.norm(points[faces[:, 0], :2] - 12.0, axis=1))] = True
    return points, faces[~gone]


@pytest.fixture(scope="module")
def events(holed):
    found = []
    inpaint(*holed, parameters=QUICK, progress=found.append)
    return found


def test_the_run_goes_from_nothing_to_done(events):
    fractions = [event.fraction for event in events]
    assert fractions[0] == 0.0
    assert fractions[-1] == 1.0
    assert (np.diff(fractions) >= 0.0).all()
    assert events[-1].stage == "done"


def test_stages_come_in_order_and_holes_are_counted(events):
    assert {event.holes for event in events} == {2}
    stages = [event.stage for event in events]
    assert stages[:2] == ["closing", "fairing"]
    order = [
        stages.index(stage)
        for stage in ("choosing settings", "patches", "diffusion", "vertex update", "done")
    ]
    assert order == sorted(order)
    # The single face is done when all fills are smooth.
    assert [event.hole for event in events] == [0, 0] + [1] * (len(events) - 2)


@pytest.mark.parametrize("threads", ["1", "2"])
def test_holes_that_are_worked_on_at_once_are_counted(sheet, monkeypatch, threads):
    monkeypatch.setenv(THREADS_VARIABLE, threads)
    points, faces = sheet(26, 90)
    x, y = (points - points.mean(axis=0))[:, :2].T
    points[:, 2] = 0.4 * (np.cos(0.8 * x) + np.cos(0.8 * y))
    gone = np.zeros(len(points), dtype=bool)
    for middle in (-30.0, 0.0, 30.0):
        gone |= np.hypot(x - middle, y) < 4.0
    holed = points, faces[~gone[faces].any(axis=1)]
    found, threads_seen = [], set()

    def progress(event):
        found.append(event)
        threads_seen.add(threading.get_ident())

    inpaint(*holed, parameters=QUICK, progress=progress)
    fractions = [event.fraction for event in found]
    assert (np.diff(fractions) >= 0.0).all()
    assert [event.stage for event in found].count("done") == 1
    assert found[-1].fraction == 1.0
    counts = [event.hole for event in found]
    assert counts == sorted(counts)
    # two holes that end together are counted together
    assert {0, 2} <= set(counts) <= {0, 1, 2}
    assert threads == "2" or 1 in counts
    assert threads_seen == {threading.get_ident()}

    def stop(event):
        return event.stage != "diffusion"

    with pytest.raises(InpaintCancelledError):
        inpaint(*holed, parameters=QUICK, progress=stop)


def test_without_holes_to_fill_nothing_is_said():
    vertices, faces = make_shape("torus", "smooth", count=500)
    found = []
    inpaint(vertices, faces, progress=found.append)
    assert found == []


def test_returning_false_stops_at_once(holed, events):
    before = holed[0].copy(), holed[1].copy()
    for wanted in ("closing", "fairing", "choosing settings", "diffusion", "done"):
        seen = []

        def stop(event, wanted=wanted, seen=seen):
            seen.append(event.stage)
            return event.stage != wanted

        with pytest.raises(InpaintCancelledError, match="cancelled"):
            inpaint(*holed, parameters=QUICK, progress=stop)
        assert seen == [event.stage for event in events][: len(seen)]
        assert seen.index(wanted) == len(seen) - 1
    np.testing.assert_array_equal(holed[0], before[0])
    np.testing.assert_array_equal(holed[1], before[1])


@pytest.mark.parametrize("answer", [None, True, 0, ""])
def test_only_false_itself_stops(answer):
    Reporter(lambda _: answer, 1).stage("closing", 0.0)


def test_an_exception_of_the_callback_comes_through(holed):
    class Stop(Exception):  # noqa: N818
        pass

    def progress(_):
        raise Stop

    with pytest.raises(Stop):
        inpaint(*holed, progress=progress)


def test_restoring_reports_too():
    vertices, faces = make_shape("torus", "bumps", count=2500, seed=1)
    selected = np.linalg.norm(vertices - vertices[700], axis=1) < 3.0
    found = []
    parameters = InpaintParameters(detail="none")
    restore_detail(vertices, faces, selected, parameters=parameters, progress=found.append)
    assert found[0].stage == "fairing"
    assert (found[-1].stage, found[-1].fraction) == ("done", 1.0)
    with pytest.raises(InpaintCancelledError):
        restore_detail(vertices, faces, selected, progress=lambda _: False)


def test_the_last_hole_ends_the_run():
    found = []
    reporter = Reporter(found.append, 4)
    reporter.stage("closing", 0.0)
    reporter.done(0)
    reporter.done(3)
    reporter.stage("diffusion", 0.5)
    reporter.done(1)
    assert [(event.stage, event.hole, event.fraction) for event in found] == [
        ("closing", 0, 0.0),
        ("diffusion", 3, 0.5),
        ("done", 3, 1.0),
    ]
