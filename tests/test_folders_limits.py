"""Batch runs that meet a limit: memory to share out, a disk that fills up."""

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pymeshlab
import pytest

from meshlab_lowrank.folders import batch, plan, run
from meshlab_lowrank.folders.manifest import MANIFEST_NAME, Manifest
from meshlab_lowrank.folders.summary_page import PAGE_NAME
from meshlab_lowrank.isolation import memory
from meshlab_lowrank.isolation.memory import MemoryGate
from meshlab_lowrank.threads import available_cores

LOGGING = """
import os
import time
from pathlib import Path

def chain(ms):
    name = ms.current_mesh().label()
    for word in ("start", "end"):
        with Path({log!r}).open("a") as file:
            file.write(word + " " + name + chr(10))
        time.sleep(0.3)
"""
NOTHING = "def chain(ms):\n    pass\n"

LIMITED = """
import resource
import sys
from meshlab_lowrank.cli import main

resource.setrlimit(resource.RLIMIT_FSIZE, (4000, resource.RLIM_INFINITY))
sys.exit(main())
"""


def write_spheres(folder: Path, *names: str, subdiv: int = 0) -> None:
    folder.mkdir(exist_ok=True)
    for name in names:
        meshset = pymeshlab.MeshSet(verbose=False)
        meshset.create_sphere(subdiv=subdiv)
        meshset.save_current_mesh(str(folder / name))


def wait_for(queue: MemoryGate, waiting: int) -> None:
    while len(queue._waiting) < waiting:
        time.sleep(0.001)


def test_the_gate_keeps_order_and_room() -> None:
    gate, order = MemoryGate(10), []

    def ask(name: str, need: int) -> None:
        with gate.admitted(need):
            order.append(name)

    with gate.admitted(6):
        threads = []
        for waiting, (name, need) in enumerate((("large", 100), ("small", 1))):
            threads.append(threading.Thread(target=ask, args=(name, need)))
            threads[-1].start()
            wait_for(gate, waiting + 1)
        assert order == []
    for thread in threads:
        thread.join()
    assert order == ["large", "small"]


def test_no_limit_is_no_gate() -> None:
    gate = MemoryGate(0)
    with gate.admitted(10**12), gate.admitted(10**12):
        pass


def test_a_file_too_large_to_share_the_memory_runs_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scans, log, chain = tmp_path / "scans", tmp_path / "log", tmp_path / "chain.py"
    write_spheres(scans, "a.ply", "big.ply", "c.ply", "d.ply")
    chain.write_text(LOGGING.format(log=str(log)))
    total = 8 * 10**9
    monkeypatch.setattr(run, "available_memory", lambda: total)
    monkeypatch.setattr(
        run, "estimated_memory", lambda path, _: 2 * total if "big" in str(path) else total // 4
    )
    assert batch(scans, tmp_path / "out", chain=chain, workers=3).counts == {"done": 4}
    lines = log.read_text(encoding="utf-8").splitlines()
    start = lines.index("start big.ply")
    assert lines[start + 1] == "end big.ply"
    begun = [line.split()[1] for line in lines[:start] if line.startswith("start")]
    assert all(f"end {name}" in lines[:start] for name in begun)


def test_cores_are_shared_by_as_many_files_as_fit() -> None:
    cores = available_cores()
    assert plan.thread_count(cores, 0, 10**9) == 1
    assert plan.thread_count(1, 0, 10**9) == cores
    assert plan.thread_count(cores, 10**9, 10**9) == cores
    assert plan.thread_count(cores, 10**9, 10**12) == cores
    assert plan.thread_count(cores, 10**15, 10**9) == 1


def test_estimates_grow_with_the_file() -> None:
    estimate = memory.estimated_memory
    assert estimate(Path("a.ply"), 10**9) > estimate(Path("a.ply"), 0) > 0
    assert estimate(Path("a.ctm"), 10**6) > estimate(Path("a.PLY"), 10**6)
    assert estimate(Path("a.ply"), 10**6) > estimate(Path("a.OBJ"), 10**6)


def test_limits_of_control_groups_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "memory.max").write_text("5000\n")
    (tmp_path / "memory.current").write_text("4000\n")
    (tmp_path / "memory.stat").write_text("anon 7\ninactive_file 500\n")
    monkeypatch.setattr(memory, "_CGROUPS", ((tmp_path, "", "memory.max", "memory.current"),))
    if memory.available_memory():
        assert memory.available_memory() == 1500
    (tmp_path / "memory.max").write_text("max\n")
    assert memory.available_memory() != 1500


def test_a_failed_append_leaves_the_manifest_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    manifest = Manifest(tmp_path)
    manifest.append({"file": "a.ply"})
    before = manifest.path.read_bytes()

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space"):
            manifest.append({"file": "b.ply"})
    assert manifest.path.read_bytes() == before


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs POSIX")
def test_a_full_disk_fails_files_and_the_next_run_goes_on(tmp_path: Path) -> None:
    scans, out, chain = tmp_path / "scans", tmp_path / "out", tmp_path / "chain.py"
    names = [f"{number:02}.ply" for number in range(8)]
    write_spheres(scans, *names)
    write_spheres(scans, "large.ply", subdiv=4)
    chain.write_text(NOTHING)
    command = [sys.executable, "-c", LIMITED, "batch", str(scans), str(out), "--json"]
    command += ["--chain", str(chain), "--workers", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 1
    document = json.loads(done.stdout)
    statuses = {record["file"]: record["status"] for record in document["files"]}
    assert statuses == {**dict.fromkeys(names, "done"), "large.ply": "failed"}
    assert {path.name for path in out.iterdir() if path.suffix == ".ply"} == set(names)
    manifest, page = document["problems"]
    assert MANIFEST_NAME in manifest
    assert PAGE_NAME in page
    lines = (out / MANIFEST_NAME).read_text(encoding="utf-8").splitlines()
    noted = {json.loads(line)["file"] for line in lines}
    assert set() < noted < {*names, "large.ply"}
    again = batch(scans, out, chain=chain, workers=1)
    assert again.complete
    assert again.counts == {"skipped": len(noted & set(names)), "done": 9 - len(noted)}
    assert set(Manifest(out).last_records()) == {*names, "large.ply"}
    assert (out / PAGE_NAME).exists()
