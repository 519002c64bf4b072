"""Jobs in processes of their own: they name their function, which is one of this package."""

from __future__ import annotations

import contextlib

import pytest

from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.isolation.jobs import load_function, perform
from meshlab_lowrank.isolation.pool import WorkerPool, run_isolated

HOLES = "meshlab_lowrank.folders.tasks:holes"


@pytest.mark.parametrize(
    "name",
    [
        "os:system",
        "meshlab_lowrankish.tasks:holes",
        "meshlab_lowrank.folders.tasks:_size",
        "meshlab_lowrank.folders.tasks:os.system",
        "meshlab_lowrank.folders.tasks",
        "",
        None,
    ],
)
def test_only_functions_of_this_package_are_called(name):
    with pytest.raises(InvalidParameterError, match="must be a function of meshlab_lowrank"):
        load_function({"function": name})
    report = perform({"function": name}, lambda _: None)
    assert (report["status"], report["wrong_call"]) == ("failed", True)


@pytest.mark.parametrize(
    "name", ["meshlab_lowrank.folders.tasks:nothing", "meshlab_lowrank.nothing:holes"]
)
def test_functions_that_are_not_there_are_named(name):
    with pytest.raises(InvalidParameterError, match=name):
        load_function({"function": name})


def test_a_refused_job_ends_in_its_process_too():
    with pytest.raises(InvalidParameterError, match="os:system"):
        run_isolated({"function": "os:system"})


def test_a_worker_does_one_job_after_the_other(tmp_path):
    (tmp_path / "a.ply").write_text("no mesh")
    job = {"function": HOLES, "source": str(tmp_path / "a.ply")}
    told = []
    with contextlib.closing(WorkerPool()) as pool, pool.borrowed() as worker:
        endings = [worker.run(each, on_event=told.append) for each in (job, {}, job)]
    assert [ending.report["status"] for ending in endings] == ["failed"] * 3
    assert [ending.report["wrong_call"] for ending in endings] == [False, True, False]
    assert [event["stage"] for event in told] == ["reading", "reading"]
    assert all(ending.seconds < 60.0 for ending in endings)
    with pytest.raises(LowrankError):
        run_isolated(job)
