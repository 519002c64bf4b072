"""A dask cluster that loses workers or its scheduler: the run goes on or ends, nothing is lost."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

import pymeshlab
import pytest

from meshlab_lowrank.errors import LowrankError
from meshlab_lowrank.folders import BatchEvent, batch, dask_engine
from meshlab_lowrank.folders.manifest import Manifest
from meshlab_lowrank.scratch import SCRATCH_PREFIX

distributed = pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.filterwarnings("default"),  # dask's own
    pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX"),
]

FILES = 4
LIMIT = 120  # seconds
LOST = r"^The dask scheduler at .* was lost; start the same run again"
WAIT = "import time\n\ndef chain(ms):\n    time.sleep(0.3)\n"


class Cluster:
    """A scheduler and workers, each a process of its own."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.folder = folder
        self.processes: list[subprocess.Popen[bytes]] = []
        self.add_scheduler()
        self.add_worker()

    def add_scheduler(self) -> None:
        options = ["--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"]
        self.scheduler = self._start("dask_scheduler", *options)

    def add_worker(self) -> None:
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
        self.worker = self._start("dask_worker", self.address, *options)

    def wait_for_worker(self) -> None:
        client = distributed.Client(self.address, timeout=60, set_as_default=False)
        with client:
            client.wait_for_workers(1, timeout=60)

    def _start(self, name: str, *options: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(  # noqa: S603
            [sys.executable, "-m", f"distributed.cli.{name}", *options],
            cwd=self.folder,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self.processes.append(process)
        return process

    def close(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture(autouse=True)
def bounded() -> Iterator[None]:
    """Fail rather than hang."""

    def late(*_: object) -> NoReturn:
        pytest.fail("The run hangs.")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(LIMIT)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    folder = tmp_path / "cluster"
    folder.mkdir()
    with contextlib.closing(Cluster(folder)) as cluster:
        cluster.wait_for_worker()
        yield cluster


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    folder = tmp_path / "scans"
    (folder / "below").mkdir(parents=True)
    for number in range(FILES):
        meshset = pymeshlab.MeshSet(verbose=False)
        meshset.create_cube()
        meshset.save_current_mesh(str(folder / "below" / f"{number}.ply"))
    (tmp_path / "chain.py").write_text(WAIT)
    return folder


@pytest.fixture
def lose_patience(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Give a function from whose call on the run gives up after seconds rather than minutes."""

    def lose() -> None:
        monkeypatch.setattr(dask_engine, "_PATIENCE", 2.0)
        monkeypatch.setattr(dask_engine, "_LOST_AFTER", 0.5)
        monkeypatch.setattr(dask_engine, "_DESERTED_AFTER", 0.5)
        monkeypatch.setattr(dask_engine, "_PULSE", 0.1)

    return lose


def run(scans: Path, cluster: Cluster, out: Path, trouble: Callable[[], object]) -> dict[str, int]:
    """Run on the cluster and make trouble when the first file is done."""

    def make_trouble(event: BatchEvent) -> None:
        if event.record and event.done == 1:
            trouble()

    with dask_engine.dask_executor(cluster.address) as executor:
        result = batch(
            scans,
            out,
            chain=scans.parent / "chain.py",
            executor=executor,
            pictures=False,
            progress=make_trouble,
        )
    assert len(list(out.rglob("*.ply"))) == FILES
    return result.counts


def the_rest_is_done_here(scans: Path, out: Path) -> bool:
    noted = len(Manifest(out).last_records())
    result = batch(scans, out, chain=scans.parent / "chain.py", pictures=False)
    assert result.counts == {"skipped": noted, "done": FILES - noted}
    return 1 <= noted < FILES


def test_lost_workers(
    scans: Path, cluster: Cluster, tmp_path: Path, lose_patience: Callable[[], None]
) -> None:
    def come_back() -> None:
        while not list((tmp_path / "resumed").rglob(f"{SCRATCH_PREFIX}*")):
            time.sleep(0.01)  # until it is at work
        cluster.worker.kill()
        threading.Timer(0.5, cluster.add_worker).start()

    def stay_away() -> None:
        cluster.worker.kill()
        lose_patience()

    assert run(scans, cluster, tmp_path / "resumed", come_back) == {"done": FILES}
    assert not list((tmp_path / "resumed").rglob(".*"))
    with pytest.raises(LowrankError, match=r"^The dask scheduler .* has no workers any more; st"):
        run(scans, cluster, tmp_path / "ended", stay_away)
    assert the_rest_is_done_here(scans, tmp_path / "ended")


def test_a_lost_scheduler(
    scans: Path, cluster: Cluster, tmp_path: Path, lose_patience: Callable[[], None]
) -> None:
    def come_back() -> None:
        cluster.scheduler.kill()
        cluster.scheduler.wait()
        cluster.worker.kill()
        cluster.add_scheduler()
        cluster.add_worker()

    def fall_silent() -> None:
        cluster.scheduler.send_signal(signal.SIGSTOP)
        lose_patience()

    assert run(scans, cluster, tmp_path / "resumed", come_back) == {"done": FILES}
    with pytest.raises(LowrankError, match=LOST):
        run(scans, cluster, tmp_path / "silent", fall_silent)
    assert the_rest_is_done_here(scans, tmp_path / "silent")


def test_a_scheduler_that_stays_away(
    scans: Path, cluster: Cluster, tmp_path: Path, lose_patience: Callable[[], None]
) -> None:
    def stay_away() -> None:
        cluster.scheduler.kill()
        lose_patience()

    with pytest.raises(LowrankError, match=LOST):
        run(scans, cluster, tmp_path / "out", stay_away)
    assert the_rest_is_done_here(scans, tmp_path / "out")
