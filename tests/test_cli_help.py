"""What the command says of itself, when it is called wrongly, and when it is stopped."""

import shlex
import signal
import subprocess
import sys

import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank.cli import COMMANDS, batch, build_parser, main

NAMES = [command.__name__.rpartition(".")[2] for command in COMMANDS]


def help_of(capsys, *words):
    with pytest.raises(SystemExit) as caught:
        main([*words, "--help"])
    assert caught.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("words", [(), *((name,) for name in NAMES)])
def test_help_has_examples_exit_codes_and_where_to_read_on(capsys, words):
    text = help_of(capsys, *words)
    examples = text.split("examples:\n")[1].split("\n\n")[0].splitlines()
    for example in examples:
        name, *arguments = shlex.split(example)
        assert name == "meshlab-lowrank"
        if "--help" not in arguments:
            build_parser().parse_args(arguments)  # raises if it is wrong
    codes = text.split("exit codes:\n")[1].split("\n\n")[0].splitlines()
    assert [line.split()[0] for line in codes] == ["0", "1", "2", "130"]
    assert "\nmore: " in text
    assert "%%" not in text


def test_help_tells_the_defaults(capsys):
    for default in ("(0: no limit)", "(about 130; paper: 100)", "(that of the\n"):
        assert default in help_of(capsys, "inpaint")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Work in a folder with a closed scan and a folder with another."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").mkdir()
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.create_cube()
    for name in ("a.ply", "in/a.ply"):
        meshset.save_current_mesh(name)
    return tmp_path


@pytest.mark.parametrize(
    "call",
    [
        "",
        "fill",
        "holes",
        "holes nope.ply",
        "holes a.foo",
        "holes .",
        "inpaint a.ply",
        "inpaint nope.ply b.ply",
        "inpaint a.ply b.ply --preset best",
        "inpaint a.ply b.ply --seed -1",
        "inpaint a.ply b.ply --refineedgelen 0%",
        "batch nope out",
        "batch in out --workers 0",
        "batch in out --timeout nan",
        "batch in out --format foo",
        "batch in out --chain nope",
        "batch in out --chain meshlab-fill --seed 3",
        "run nope a.ply b.ply",
        "run meshlab-fill a.ply a.ply",
        "compare nope.ply",
        "compare a.ply --fillers nope",
        "compare a.ply --radius -1",
        "compare a.ply --seed -1",
        "compare a.ply --timeout 0",
        "compare a.ply --picture a.gif",
        "compare a.ply --csv no/a.csv",
    ],
)
def test_wrong_calls_give_2_and_leave_nothing(folder, capsys, call):
    def files():
        return sorted(path for path in folder.rglob("*") if path.is_file())

    before = files()
    try:
        code = main(shlex.split(call))
    except SystemExit as error:  # of argparse
        code = error.code
    assert code == 2
    assert capsys.readouterr().err.strip()
    assert files() == before


def test_ctrl_c_says_how_to_go_on(folder, capsys, monkeypatch):
    def stopped(*_, **__):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(batch, "batch", stopped)
    assert main(["batch", "in", "out"]) == 130
    assert "Run the same command again to go on" in capsys.readouterr().err
    assert (folder / "in").exists()


def test_the_package_runs_as_the_command():
    command = [sys.executable, "-m", "meshlab_lowrank", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    expected = f"meshlab-lowrank {meshlab_lowrank.__version__}\n"
    assert (done.returncode, done.stdout) == (0, expected)
