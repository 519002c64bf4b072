import os
import signal
from pathlib import Path

import pymeshlab
import pytest

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.folders import BatchEvent, batch, dask_engine

distributed = pytest.importorskip("distributed")

pytestmark = pytest.mark.filterwarnings("default")  # dask's own

WAIT = "import time\n\ndef chain(ms):\n    time.sleep(0.5)\n"


def test_a_killed_dask_worker_costs_nothing(tmp_path: Path) -> None:
    scans, out, chain = tmp_path / "scans", tmp_path / "out", tmp_path / "chain.py"
    scans.mkdir()
    chain.write_text(WAIT)
    for number in range(8):
        meshset = pymeshlab.MeshSet(verbose=False)
        meshset.create_cube()
        meshset.save_current_mesh(str(scans / f"{number}.ply"))
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=tmp_path
    )
    with cluster, dask_engine.dask_executor(cluster.scheduler_address) as executor:
        victims = [worker.pid for worker in cluster.workers.values()]

        def kill_one(event: BatchEvent) -> None:
            if event.record and event.done == 1:
                os.kill(victims[0], signal.SIGKILL)

        result = batch(scans, out, chain=chain, executor=executor, progress=kill_one)
    assert result.counts == {"done": 8}
    assert len(list(out.glob("*.ply"))) == 8


def test_a_cluster_that_does_not_answer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_engine, "_PATIENCE", 0.5)
    with (
        pytest.raises(InvalidParameterError, match="No dask scheduler answers"),
        dask_engine.dask_executor("tcp://127.0.0.1:9"),
    ):
        pass
