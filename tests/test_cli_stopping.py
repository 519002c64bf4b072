"""The command when it is stopped, and when nothing can be written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import pymeshlab
import pytest

from meshlab_lowrank.cli import holes, main
from meshlab_lowrank.cli.stopping import Stop

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX")
PROGRAM = "import sys; from meshlab_lowrank_command import main; sys.exit(main())"
FULL = Path("/dev/full")

LOADING = """
import time

print("loading", flush=True)
try:
    time.sleep(300)
except BaseException:
    print("went on")
"""


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    path = tmp_path / "a.ply"
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.create_sphere(subdiv=3)
    meshset.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    meshset.meshing_remove_selected_faces()
    meshset.save_current_mesh(str(path))
    return path


@contextmanager
def loading(folder: Path, *prefix: str) -> Iterator[subprocess.Popen[str]]:
    """Start the command and wait until it loads a library, which never ends."""
    (folder / "scipy.py").write_text(LOADING)
    path = os.pathsep.join([str(folder), *filter(None, sys.path)])
    with subprocess.Popen(  # noqa: S603
        [*prefix, sys.executable, "-c", PROGRAM, "--version"],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout
        assert process.stdout.readline() == "loading\n"
        try:
            yield process
        finally:
            process.kill()


@POSIX
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_while_the_package_loads_ends_it_in_silence(
    tmp_path: Path, number: signal.Signals
) -> None:
    with loading(tmp_path) as process:
        process.send_signal(number)
        assert process.communicate(timeout=60) == ("", "")
        assert process.returncode == 128 + number


@POSIX
def test_what_ignores_the_end_of_its_terminal_goes_on(tmp_path: Path) -> None:
    with loading(tmp_path, "sh", "-c", 'trap "" HUP; exec "$@"', "sh") as process:
        process.send_signal(signal.SIGHUP)
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 128 + signal.SIGTERM


@POSIX
def test_signals_interrupt_once_until_all_is_cleared_up() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    try:
        with Stop() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert stop.number == 0
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGINT)
            assert stop.number == signal.SIGTERM
            stop._last = 0.0
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
            stop._last = 0.0
            stop.settle()
            signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)
    assert handlers == [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]


@POSIX
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError, RuntimeError])
def test_however_a_stop_comes_out_it_is_told_as_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: type[BaseException]
) -> None:
    def stopped(_: object) -> NoReturn:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        raise error

    monkeypatch.setattr(holes, "run", stopped)
    assert main(["holes", "a.ply"]) == 128 + signal.SIGTERM
    assert capsys.readouterr().err == (
        "Stopped; no half file was left. Run the same command again to start over.\n"
    )


def call(*words: str | Path, **streams: Any) -> tuple[int, str, str]:
    command = [sys.executable, "-c", PROGRAM, *map(str, words)]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams}
    done = subprocess.run(command, text=True, check=False, **streams)  # noqa: S603
    return done.returncode, done.stdout, done.stderr


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
def test_output_that_cannot_be_written_is_one_sentence(scan: Path) -> None:
    with FULL.open("w") as full:
        code, _, text = call("holes", scan, "--json", stdout=full)
        assert code == 1
        assert text == "Standard output can't be written to (No space left on device).\n"
        code, text, _ = call("holes", scan, stderr=full)
        assert code == 0
        assert "1 boundary loops" in text


def test_a_full_disk_leaves_no_part_of_a_report(
    scan: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_text = Path.write_text

    def half(self: Path, text: str, **options: Any) -> None:
        if self.suffix == ".json":  # what a renderer is told, where there is one
            write_text(self, text, **options)
            return
        write_text(self, text[: len(text) // 2], **options)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", half)
    report = scan.with_name("report.html")
    options = ["--fillers", "close", "--places", "0", "--html", str(report)]
    assert main(["compare", str(scan), *options]) == 1
    sentence = capsys.readouterr().err.splitlines()[-1]
    assert sentence == f"No space left on device: {report}."
    assert list(scan.parent.iterdir()) == [scan]
