import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.folders import batch, plan
from meshlab_lowrank.folders.dispatch import Dispatch
from meshlab_lowrank.folders.file_run import FileJob, FileRecord
from meshlab_lowrank.folders.lock import locked
from meshlab_lowrank.folders.manifest import MANIFEST_NAME, Manifest
from meshlab_lowrank.folders.run import BatchResult
from meshlab_lowrank.folders.settings import parameter_texts
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.scratch import SCRATCH_PREFIX

COMMAND = [
    sys.executable,
    "-c",
    "import sys; from meshlab_lowrank.cli import main; sys.exit(main())",
]

TROUBLE = """
import os
import time

def chain(ms):
    name = ms.current_mesh().label()
    if "slow" in name:
        time.sleep(60)
    if "crash" in name:
        os.abort()
    if "server" in name:
        os.kill(os.getppid(), 9)
        time.sleep(60)
    if "hungry" in name:
        bytearray(1 << 45)
    if "raises" in name:
        raise ValueError("no luck")
    if "full" in name:
        import resource
        import signal
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
"""

NOTHING = "def chain(ms):\n    pass\n"


def write_mesh(path: Path, seed: int = 0) -> Path:
    points = np.random.default_rng(seed).random((4, 3))
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.add_mesh(pymeshlab.Mesh(points, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
    path.parent.mkdir(parents=True, exist_ok=True)
    meshset.save_current_mesh(str(path))
    return path


def write_chain(folder: Path, text: str) -> Path:
    path = folder / "chain.py"
    path.write_text(text)
    return path


def run(folder: Path, out: Path, chain: Path, **options: Any) -> BatchResult:
    return batch(folder, out, chain=chain, workers=1, **options)


def statuses(result: BatchResult) -> dict[str, str]:
    return {record.file: record.status for record in result.records}


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    folder = tmp_path / "scans"
    for number, name in enumerate(("a.ply", "b.obj", "below/c.off")):
        write_mesh(folder / name, number)
    return folder


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs POSIX")
def test_every_trouble_costs_its_own_file_only(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    kinds = ("crash", "full", "good", "hungry", "raises", "server", "slow")
    for kind in kinds:
        write_mesh(folder / f"{kind}.ply")
    (folder / "garbage.ply").write_bytes(b"no mesh")
    result = batch(folder, out, chain=write_chain(tmp_path, TROUBLE), timeout=2, workers=3)
    assert statuses(result) == {
        "crash.ply": "crashed",
        "full.ply": "failed",
        "garbage.ply": "failed",
        "good.ply": "done",
        "hungry.ply": "failed",
        "raises.ply": "failed",
        "server.ply": "crashed",
        "slow.ply": "timed out",
    }
    assert not result.complete
    records = {record.file: record for record in result.records}
    assert records["crash.ply"].attempts == 2
    assert "SIGABRT" in records["crash.ply"].reason
    assert records["slow.ply"].attempts == 1
    assert "line 17: no luck" in records["raises.ply"].reason
    assert records["good.ply"].peak_memory > 0
    assert {path.name for path in out.iterdir() if path.suffix == ".ply"} == {"good.ply"}
    assert not list(out.glob(f"{SCRATCH_PREFIX}*"))


def test_a_second_run_does_only_what_is_missing_or_changed(scans: Path, tmp_path: Path) -> None:
    out, chain = tmp_path / "out", write_chain(tmp_path, NOTHING)
    assert run(scans, out, chain).counts == {"done": 3}
    manifest = out / MANIFEST_NAME
    lines = manifest.read_text(encoding="utf-8").splitlines()
    again = run(scans, out, chain)
    assert again.counts == {"skipped": 3}
    assert again.complete
    assert manifest.read_text(encoding="utf-8").splitlines() == lines
    write_mesh(scans / "a.ply", seed=9)
    (out / "b.obj").unlink()
    assert statuses(run(scans, out, chain)) == {
        "a.ply": "done",
        "b.obj": "done",
        "below/c.off": "skipped",
    }
    assert manifest.read_text(encoding="utf-8").splitlines()[:3] == lines
    chain.write_text(NOTHING + "# changed\n")
    assert run(scans, out, chain).counts == {"done": 3}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs POSIX")
def test_a_killed_run_leaves_whole_files_and_goes_on(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    for number in range(6):
        write_mesh(folder / f"{number}.ply", number)
    wait = "import time\n\ndef chain(ms):\n    time.sleep(0.3)\n"
    chain = write_chain(tmp_path, wait)
    command = [*COMMAND, "batch", str(folder), str(out), "--chain", str(chain), "--workers", "2"]
    process = subprocess.Popen(  # noqa: S603
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while len(Manifest(out).last_records()) < 2:
        time.sleep(0.01)
        assert process.poll() is None
    process.kill()
    process.wait()
    records = Manifest(out).last_records()
    assert 2 <= len(records) < 6
    for path in out.glob("*.ply"):
        meshset = pymeshlab.MeshSet(verbose=False)
        meshset.load_new_mesh(str(path))
        assert meshset.current_mesh().face_number() == 4
    result = run(folder, out, chain)
    assert result.counts["skipped"] >= len(records)
    assert result.complete
    assert len(list(out.glob("*.ply"))) == 6
    assert not list(out.glob(f"{SCRATCH_PREFIX}*"))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs POSIX")
def test_an_interrupted_run_stops_at_once_without_a_traceback(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    write_mesh(folder / "slow.ply")
    chain = write_chain(tmp_path, TROUBLE)
    command = [*COMMAND, "batch", str(folder), str(out), "--chain", str(chain)]
    with subprocess.Popen(  # noqa: S603
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            while not list(out.glob(f"{SCRATCH_PREFIX}*")):
                time.sleep(0.01)
                assert process.poll() is None
            process.send_signal(signal.SIGINT)
            output, messages = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == 128 + signal.SIGINT
    assert output == ""
    assert "Traceback" not in messages
    assert "Stopped" in messages
    assert not list(out.glob(f"{SCRATCH_PREFIX}*"))


def test_a_signal_that_another_thread_gets_stops_a_run(tmp_path: Path) -> None:
    def struck(job: FileJob) -> FileRecord:
        time.sleep(0.5)  # until the main thread waits, which the signal then doesn't wake
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        in_time.append(stopped.wait(20))
        return FileRecord(file=job.name, status="done")

    stopped, in_time = threading.Event(), list[bool]()
    dispatch = Dispatch(1, Manifest(tmp_path), None)
    with ThreadPoolExecutor(1) as threads:
        with pytest.raises(KeyboardInterrupt):
            dispatch.go(threads, struck, [FileJob(name="a", source="a", target="b", output="b")])
        stopped.set()
    assert in_time == [True]


def test_a_second_run_on_the_same_folder_says_so_and_stops(scans: Path, tmp_path: Path) -> None:
    out, chain = tmp_path / "out", write_chain(tmp_path, NOTHING)
    out.mkdir()
    with locked(out), pytest.raises(LowrankError, match=f"process {os.getpid()}"):
        run(scans, out, chain)
    assert run(scans, out, chain).complete


def test_manifest_survives_a_line_cut_short(tmp_path: Path) -> None:
    manifest = Manifest(tmp_path)
    manifest.append({"file": "a.ply", "status": "failed"})
    manifest.append({"file": "b.ply", "status": "done"})
    with manifest.path.open("ab") as file:
        file.write(b'{"file": "c.ply", "sta')
    assert set(manifest.last_records()) == {"a.ply", "b.ply"}
    manifest.append({"file": "a.ply", "status": "done"})
    assert manifest.last_records()["a.ply"]["status"] == "done"
    assert len(manifest.path.read_bytes().splitlines()) == 4


def test_outputs_keep_the_tree_and_take_another_format(scans: Path, tmp_path: Path) -> None:
    write_mesh(scans / "a.obj")
    write_mesh(scans / ".hidden" / "d.ply")
    out = tmp_path / "out"
    result = run(scans, out, write_chain(tmp_path, NOTHING), suffix=".ply")
    assert [record.output for record in result.records] == [
        "a.obj.ply",
        "a.ply",
        "b.ply",
        "below/c.ply",
    ]
    assert all((out / record.output).is_file() for record in result.records)


def test_outputs_in_the_input_folder_are_no_inputs_of_the_next_run(
    scans: Path, tmp_path: Path
) -> None:
    out, chain = scans / "filled", write_chain(tmp_path, NOTHING)
    assert run(scans, out, chain).counts == {"done": 3}
    assert run(scans, out, chain).counts == {"skipped": 3}


def test_inputs_are_never_overwritten(scans: Path, tmp_path: Path) -> None:
    chain = write_chain(tmp_path, NOTHING)
    before = (scans / "a.ply").read_bytes()
    with pytest.raises(InvalidParameterError, match="is an input"):
        run(scans, scans, chain)
    link = tmp_path / "link"
    link.symlink_to(scans)
    with pytest.raises(InvalidParameterError, match="is an input"):
        run(scans, link, chain)
    assert (scans / "a.ply").read_bytes() == before


def test_a_wrong_call_does_no_work(
    scans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    (tmp_path / "empty").mkdir()
    with pytest.raises(InvalidParameterError, match="no mesh in"):
        batch(tmp_path / "empty", out)
    with pytest.raises(InvalidParameterError, match="no folder"):
        batch(tmp_path / "nowhere", out)
    with pytest.raises(InvalidParameterError, match="maxholsize"):
        batch(scans, out, parameters={"maxholsize": 3})
    with pytest.raises(InvalidParameterError, match=r"\.foo"):
        batch(scans, out, suffix=".foo")
    with pytest.raises(InvalidParameterError, match="workers"):
        batch(scans, out, workers=0)
    with pytest.raises(InvalidParameterError, match="timeout"):
        batch(scans, out, timeout=0)
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(InvalidParameterError, match="can't be written to"):
        batch(scans, blocked / "out")
    assert not out.exists()
    usage = type("Usage", (), {"free": 10})
    monkeypatch.setattr(plan.shutil, "disk_usage", lambda _: usage)
    with pytest.raises(LowrankError, match="make room"):
        run(scans, out, write_chain(tmp_path, NOTHING))
    assert not list(out.glob("*.ply"))


def test_any_executor_does_the_work(scans: Path, tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as executor:
        chain = write_chain(tmp_path, NOTHING)
        result = batch(scans, tmp_path / "out", chain=chain, executor=executor)
    assert result.counts == {"done": 3}


def test_an_executor_that_breaks_loses_nothing_of_what_was_done(
    scans: Path, tmp_path: Path
) -> None:
    out, chain = tmp_path / "out", write_chain(tmp_path, NOTHING)

    class Breaking(ThreadPoolExecutor):
        """Does the first job, breaks on the second, and takes no third."""

        jobs = 0

        def submit(self, *call: Any, **_: Any) -> Future[Any]:
            self.jobs += 1
            if self.jobs == 1:
                self.first = super().submit(*call)
                return self.first
            self.first.result()
            broken: Future[Any] = Future()
            broken.set_exception(BrokenExecutor("All is lost."))
            return broken

    with Breaking(1) as executor, pytest.raises(LowrankError, match=r"^All is lost; start the"):
        batch(scans, out, chain=chain, executor=executor)
    assert list(Manifest(out).last_records()) == ["a.ply"]
    assert run(scans, out, chain).counts == {"skipped": 1, "done": 2}


def test_events_tell_every_stage_and_every_end(scans: Path, tmp_path: Path) -> None:
    events = []
    chain = write_chain(tmp_path, NOTHING)
    batch(scans, tmp_path / "out", chain=chain, workers=1, progress=events.append)
    stages = [event.stage for event in events if event.file == "a.ply"]
    assert stages == ["reading", "chain.py", "writing", ""]
    ends = [event for event in events if event.record]
    assert [event.done for event in ends] == [1, 2, 3]
    assert {event.total for event in events} == {3}


def test_what_stayed_open_is_told_again(scans: Path, tmp_path: Path) -> None:
    hole = {"id": 0, "status": "failed", "reason": "torn", "boundary_edges": 3, "trust": 0.0}
    hole |= {"perimeter": 1.0, "diameter": 1.0, "new_faces": 0, "new_vertices": 0}
    text = f"def chain(ms):\n    return {{'closed_holes': 0, 'holes': [{hole}]}}\n"
    chain, out = write_chain(tmp_path, text), tmp_path / "out"
    first = run(scans, out, chain)
    assert first.counts == {"failed": 3}
    assert "torn" in first.records[0].reason
    second = run(scans, out, chain)
    assert second.counts == {"skipped": 3}
    assert "torn" in second.records[0].reason
    assert not first.complete
    assert not second.complete


def test_a_manifest_that_cannot_be_written_stops_nothing(
    scans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, chain = tmp_path / "out", write_chain(tmp_path, NOTHING)
    append, calls = Manifest.append, []

    def full_at_first(self: Manifest, record: dict[str, Any]) -> None:
        calls.append(record)
        if len(calls) <= 2:
            raise OSError(28, "No space left on device")
        append(self, record)

    monkeypatch.setattr(Manifest, "append", full_at_first)
    assert run(scans, out, chain).counts == {"done": 3}
    assert len(Manifest(out).last_records()) == 3


def test_a_dangling_link_fails_alone(scans: Path, tmp_path: Path) -> None:
    (scans / "gone.ply").symlink_to(tmp_path / "nowhere.ply")
    result = run(scans, tmp_path / "out", write_chain(tmp_path, NOTHING))
    assert result.counts == {"done": 3, "failed": 1}


def test_records_are_json_and_complete(scans: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(scans, out, write_chain(tmp_path, NOTHING))
    records = [
        json.loads(line) for line in (out / MANIFEST_NAME).read_text(encoding="utf-8").splitlines()
    ]
    assert {record["file"] for record in records} == {"a.ply", "b.obj", "below/c.off"}
    for record in records:
        assert FileRecord(**record).as_dict() == record
        assert len(record["input_sha256"]) == 64
        assert record["output_bytes"] == (out / record["output"]).stat().st_size
        assert record["seconds"] >= record["filter_seconds"] >= 0


def test_parameters_become_text_and_are_checked() -> None:
    length = pymeshlab.PercentageValue(2)
    assert parameter_texts({"refineedgelen": length}) == {"refineedgelen": "2.0%"}
    texts = parameter_texts(InpaintParameters(maxholesize=30, closerim=True))
    assert texts["maxholesize"] == "30"
    assert texts["closerim"] == "true"
    assert "refineedgelen" not in texts
    with pytest.raises(InvalidParameterError, match="refineedgelen"):
        parameter_texts({"refineedgelen": "-1"})
