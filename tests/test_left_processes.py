"""Nothing works on for a command that is gone, and nothing that it started stays."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pymeshlab
import pytest

from meshlab_lowrank.folders.tasks import process as work
from meshlab_lowrank.isolation.pool import WorkerPool
from meshlab_lowrank.isolation.process import IsolatedWorker
from meshlab_lowrank.scratch import SCRATCH_PREFIX

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")

PROGRAM = "import sys; from meshlab_lowrank_command import main; sys.exit(main())"
MARK = "MESHLAB_LOWRANK_TEST"
LIMIT = 60.0

SLOW_RENDERER = "import time\n\ntime.sleep(300)\n"  # stands in for PyVista
SUBPROCESS = """
import subprocess

def chain(ms):
    subprocess.run(["sleep", "300"])
"""
ORPHAN = """
import os
import signal
import time

def chain(ms):
    if os.fork() == 0:
        time.sleep(300)
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(300)
"""
DAEMON = """
import os
import time

def chain(ms):
    if os.fork() == 0:
        time.sleep(300)
"""
IDLE = "def chain(ms):\n    pass\n"


def write_scan(path: Path) -> Path:
    path.parent.mkdir(exist_ok=True)
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.create_sphere(subdiv=3)
    meshset.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    meshset.meshing_remove_selected_faces()
    meshset.save_current_mesh(str(path))
    return path


class Run:
    """A command, and the processes that carry its mark in their environment."""

    def __init__(self, folder: Path, *call: str | Path) -> None:
        self.temporary = folder / "temporary"
        self.temporary.mkdir(exist_ok=True)
        (folder / "pyvista.py").write_text(SLOW_RENDERER)
        path = os.pathsep.join([str(folder), *filter(None, sys.path)])
        self._mark = f"{MARK}={folder}"
        self.process = subprocess.Popen(  # noqa: S603
            [sys.executable, "-c", PROGRAM, *map(str, call)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env={
                **os.environ,
                "PYTHONPATH": path,
                "TMPDIR": str(self.temporary),
                MARK: str(folder),
            },
        )

    def others(self, word: str = "") -> list[int]:
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != self.process.pid:
                with contextlib.suppress(OSError):
                    marked = self._mark.encode() in (entry / "environ").read_bytes().split(b"\0")
                    if marked and word.encode() in (entry / "cmdline").read_bytes():
                        found.append(int(entry.name))
        return found

    def wait_for(self, word: str) -> None:
        until = time.monotonic() + LIMIT
        while not self.others(word):
            assert self.process.poll() is None
            assert time.monotonic() < until
            time.sleep(0.01)

    def end(self, number: signal.Signals) -> int:
        self.process.send_signal(number)
        return self.process.wait(LIMIT)

    def nothing_stays(self) -> bool:
        until = time.monotonic() + LIMIT
        while self.others() and time.monotonic() < until:
            time.sleep(0.01)
        return not self.others()

    def close(self) -> None:
        for number in (*self.others(), *([self.process.pid] * (self.process.poll() is None))):
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
        self.process.communicate()


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    return write_scan(tmp_path / "scans" / "a.ply")


@contextlib.contextmanager
def started(folder: Path, *call: str | Path) -> Iterator[Run]:
    with contextlib.closing(Run(folder, *call)) as run:
        yield run


def test_a_renderer_ends_with_a_killed_command_and_the_next_sweeps_its_folder(
    scan: Path, tmp_path: Path
) -> None:
    options = ("--fillers", "close", "--places", "0")
    call = ("compare", scan, *options, "--html", tmp_path / "report.html")
    with started(tmp_path, *call) as run:
        run.wait_for("report.rendering")
        assert run.end(signal.SIGKILL) == -signal.SIGKILL
        assert run.nothing_stays()
        assert list(run.temporary.glob(f"{SCRATCH_PREFIX}*"))
    assert not (tmp_path / "report.html").exists()
    with started(tmp_path, "holes", scan) as run:
        assert run.process.wait(LIMIT) == 0
        assert not list(run.temporary.iterdir())


def test_a_stopped_batch_takes_its_renderer_and_folders_along(scan: Path, tmp_path: Path) -> None:
    with started(tmp_path, "batch", scan.parent, tmp_path / "out") as run:
        run.wait_for("report.rendering")
        assert run.end(signal.SIGHUP) == 128 + signal.SIGHUP
        assert run.nothing_stays()
        assert not list(run.temporary.iterdir())
        assert run.process.stderr
        assert "Traceback" not in run.process.stderr.read()
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.ply", "manifest.jsonl"]


def test_what_a_chain_started_ends_with_a_killed_command(scan: Path, tmp_path: Path) -> None:
    chain, target = tmp_path / "chain.py", tmp_path / "b.ply"
    chain.write_text(SUBPROCESS)
    with started(tmp_path, "run", chain, scan, target) as run:
        run.wait_for("sleep")
        run.end(signal.SIGKILL)
        assert run.nothing_stays()
    assert list(tmp_path.glob(f"{SCRATCH_PREFIX}*"))
    chain.write_text(IDLE)
    with started(tmp_path, "run", chain, scan, target) as run:
        assert run.process.wait(LIMIT) == 0
    assert target.exists()
    assert not list(tmp_path.glob(f"{SCRATCH_PREFIX}*"))


def order(scan: Path, chain: Path) -> dict[str, object]:
    return {
        "function": f"{work.__module__}:{work.__name__}",
        "source": str(scan),
        "target": str(scan.with_name("b.ply")),
        "parameters": {},
        "chain": str(chain),
        "repair": False,
        "threads": 1,
    }


def test_a_job_that_leaves_a_process_behind_keeps_nobody_waiting(
    scan: Path, tmp_path: Path
) -> None:
    chain = tmp_path / "chain.py"
    endings = []
    with contextlib.closing(WorkerPool()) as pool:
        for text in (DAEMON, IDLE, ORPHAN, IDLE):
            chain.write_text(text)
            with pool.borrowed() as worker:
                endings.append(worker.run(order(scan, chain), timeout=LIMIT))
    assert all(ending.seconds < LIMIT for ending in endings)
    assert [ending.report is None for ending in endings] == [False, False, True, False]
    assert "SIGKILL" in endings[2].cause


def test_a_worker_that_is_broken_off_or_died_idle_is_not_lent_out(
    scan: Path, tmp_path: Path
) -> None:
    chain = tmp_path / "chain.py"
    chain.write_text(IDLE)

    def break_off(_: object) -> None:
        raise ZeroDivisionError

    def lend() -> None:
        with pool.borrowed() as worker:
            broken_off.append(worker)
            worker.run({**order(scan, chain), "chain": str(slow)}, on_event=break_off)

    broken_off: list[IsolatedWorker] = []
    slow = tmp_path / "slow.py"
    slow.write_text(SUBPROCESS)
    with contextlib.closing(WorkerPool()) as pool:
        with pytest.raises(ZeroDivisionError):
            lend()
        assert not broken_off[0].alive
        with pool.borrowed() as first:
            assert first.run(order(scan, chain), timeout=LIMIT).report
        os.kill(first._process.pid, signal.SIGKILL)
        first._end.join()
        with pool.borrowed() as second:
            report = second.run(order(scan, chain), timeout=LIMIT).report
    assert second is not first
    assert report
    assert report["status"] == "done"
