"""Messages: one plain sentence, whatever a file, its name or a chain holds."""

import io
import json
import re
import sys
import warnings
from pathlib import Path
from typing import cast

import pymeshlab
import pytest
from rich.console import Console
from rich.progress import Progress

from meshlab_lowrank import compare
from meshlab_lowrank.chains import ScriptChain, load_chain
from meshlab_lowrank.cli import batch as batch_command
from meshlab_lowrank.cli import console, main
from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.folders import batch
from meshlab_lowrank.folders.dispatch import BatchEvent
from meshlab_lowrank.plain_text import plain
from meshlab_lowrank.report import page
from tests.hostile_files import obj, ply

CAPTURE = pytest.CaptureFixture[str]
RAW = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
NAMES = ("a\x1b]0;title\x07.ply", "b\u202eylp.ply", "c\n.ply", "[/red] [bold.ply", "d\x9b2J.ply")

OURS = '<FilterScript>\n<filter name="meshing_inpaint_lowrank">\n<Param name="{}" value="{}"/>'
OURS += "</filter></FilterScript>"


def one_sentence(text: str) -> bool:
    plain_ones = not RAW.search(text) and "bug" not in text and "Traceback" not in text
    return plain_ones and text.count("\n") <= 1 and text.rstrip().endswith(".")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("süß 日本 é", "süß 日本 é"),
        ("a\x1b[31m", r"a\x1b[31m"),
        ("\u202e\u2066\u200f\ufeff", r"\u202e\u2066\u200f\ufeff"),
        ("a\nb\r\t\0\x7f\x9b", r"a\nb\r\t\x00\x7f\x9b"),
        ("\udcff\u2028", r"\udcff\u2028"),
        ("\U000e0041", r"\U000e0041"),
        ("no\xa0break", "no\xa0break"),
    ],
)
def test_what_steers_a_terminal_is_written_out(text: str, shown: str) -> None:
    assert plain(text) == shown
    assert plain("a\nb\x07", keep="\n") == "a\nb\\x07"


def test_everything_that_the_console_writes_is_plain(capsys: CAPTURE) -> None:
    for name in NAMES:
        console.say(name)
        console.tell(name)
        console.fail(name, 1, as_json=True)
        console.say_table(("name",), [(name,)])
        with console.file_progress(name) as show:
            show({"stage": name, "fraction": 0.5})
    told = capsys.readouterr()
    for text in (told.out, told.err):
        assert not RAW.search(text)
        assert "[/red] [bold" in text


def test_bars_show_names_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    file = io.StringIO()
    screen = Console(file=file, force_terminal=True, width=200, color_system=None)
    monkeypatch.setattr(console, "messages", lambda: screen)
    with batch_command._display(quiet=False) as show:
        for name in NAMES:
            show(BatchEvent(name, "reading", 0.5, None, 0, 5))
    with console.file_progress(NAMES[3]) as show_one:
        show_one({"stage": NAMES[3], "fraction": 0.5})
    with Progress(console.description(), console=screen) as progress:
        progress.add_task("x")
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", file.getvalue())  # what moves the bars
    assert "[/red] [bold.ply: reading" in text
    assert not RAW.search(text.replace("\r", ""))


def test_reports_show_names_as_they_are() -> None:
    for name in NAMES:
        html = page.page(name, page.paragraph(name), page.table([name], [[name]]), page.code(name))
        assert not RAW.search(html)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems know no such names")
@pytest.mark.parametrize("name", ["a\x1b]0;title\x07\n.ply", "é not utf-8 \udcff.obj"])
def test_files_of_any_name_are_filled(tmp_path: Path, capfd: CAPTURE, name: str) -> None:
    source, target = tmp_path / name, tmp_path / f"out {name}"
    source.write_bytes(ply() if name.endswith("ply") else obj())
    call = [str(source), str(target)]
    assert main(["inpaint", *call, "--detail", "none"]) == 0
    assert target.is_file()
    assert main(["holes", str(source)]) == 0
    assert main(["inpaint", str(source), str(tmp_path / "no" / name)]) == 2
    assert main(["inpaint", str(tmp_path / f"no{name}"), str(target)]) == 2
    told = capfd.readouterr()
    assert not RAW.search(told.out + told.err)
    beside = {".mtl", ".json"}  # materials and marks
    names = {path.name for path in tmp_path.iterdir() if path.suffix not in beside}
    assert names == {source.name, target.name}


def test_a_wrong_option_is_told_plainly(capsys: CAPTURE) -> None:
    with pytest.raises(SystemExit):
        main(["holes", "a.ply", "--\x1b[31mred\u202e"])
    with pytest.raises(SystemExit):
        main(["\x1b[31m"])
    assert not RAW.search(capsys.readouterr().err)


@pytest.mark.parametrize("seconds", ["inf", "-inf", "nan", "-1", "0", "1e300"])
def test_times_that_are_none_are_wrong_calls(tmp_path: Path, capfd: CAPTURE, seconds: str) -> None:
    (tmp_path / "a.ply").write_bytes(ply())
    for call in (
        ["batch", str(tmp_path), str(tmp_path / "out")],
        ["compare", str(tmp_path / "a.ply")],
    ):
        assert main([*call, f"--timeout={seconds}"]) == 2
        told = capfd.readouterr()
        assert told.out == ""
        sentence = [line for line in told.err.splitlines() if "% " not in line]
        assert len(sentence) == 1
        assert one_sentence(sentence[0])
    assert not (tmp_path / "out").exists()
    with pytest.raises(InvalidParameterError, match="timeout"):
        batch(tmp_path, tmp_path / "out", timeout=float(seconds))
    with pytest.raises(InvalidParameterError, match="timeout"):
        compare(tmp_path / "a.ply", timeout=float(seconds))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("ms.mlx", OURS.format("ms", "1").encode(), "line 3: .*no parameter 'ms'"),
        ("progress.mlx", OURS.format("progress", "1").encode(), "no parameter 'progress'"),
        ("pipeline.mlx", OURS.format("pipeline", "x").encode(), "no parameter 'pipeline'"),
        ("self.mlx", OURS.format("self", "x").encode(), "self"),
        ("digits.mlx", OURS.format("seed", "9" * 5000).encode(), "seed"),
        ("wide.mlx", OURS.format("seed", "1").encode("utf-16"), "UTF-8"),
        ("latin.mlx", OURS.format("é", "1").encode("latin-1"), "UTF-8"),
        ("wide.py", "def chain(ms):\n    pass\n".encode("utf-16"), "UTF-8"),
        ("latin.py", "def chain(ms):\n    'é'\n".encode("latin-1"), "UTF-8"),
        ("null.py", b"def chain(ms):\n    '\0'\n", "null"),
        ("deep.py", b"def chain(ms):\n    " + b"(" * 9999, "nested|parenthes"),
        ("minus.py", b"def chain(ms):\n    " + b"-" * 100_000 + b"1\n", "nested|recursion|memory"),
    ],
)
def test_chains_that_are_none_are_refused(
    tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidParameterError) as caught:
        cast("ScriptChain", load_chain(tmp_path / name)).check(0)
    sentence = str(caught.value)
    assert one_sentence(sentence)
    assert re.search(words, sentence)
    assert name in sentence


def test_a_chain_that_is_none_is_a_wrong_call(tmp_path: Path, capfd: CAPTURE) -> None:
    chain, source = tmp_path / "chain.mlx", tmp_path / "a.ply"
    source.write_bytes(ply())
    for text in (OURS.format("ms", "1").encode(), OURS.format("é", "1").encode("latin-1")):
        chain.write_bytes(text)
        assert main(["run", str(chain), str(source), str(tmp_path / "out.ply")]) == 2
        assert one_sentence(capfd.readouterr().err)


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_chains_may_begin_with_the_mark_of_their_encoding(tmp_path: Path, mark: str) -> None:
    for name, text in (("a.py", "def chain(ms): pass\n"), ("a.mlx", OURS.format("seed", "1"))):
        (tmp_path / name).write_text(mark + text, encoding="utf-8")
        assert load_chain(tmp_path / name).length == 1


def test_a_chain_is_parsed_without_warnings(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("def chain(ms):\n    '\\d'\n    return 1 is 1\n")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_chain(tmp_path / "a.py")
    assert caught == []


RUBBISH = (
    "return 42",
    "return 'rubbish'",
    "return [1, 2]",
    "return {'holes': 3}",
    "return {'holes': [{'id': 'x'}]}",
    "return {'notes': [ms]}",
    "return {'holes': [float('nan')]}",
    "raise SystemExit(3)",
    "raise KeyError",
    "ms.meshing_inpaint_lowrank(ms=3)",
    "rubbish = []; rubbish.append(rubbish); return {'notes': rubbish}",
)


@pytest.mark.parametrize("body", RUBBISH)
def test_functions_that_return_rubbish_fail_in_one_sentence(tmp_path: Path, body: str) -> None:
    (tmp_path / "chain.py").write_text(f"def chain(ms):\n    {body}\n")
    chain, meshset = load_chain(tmp_path / "chain.py"), pymeshlab.MeshSet(verbose=False)
    meshset.create_cube()
    with pytest.raises(LowrankError, match=r"^chain\.py") as caught:
        chain.run(meshset)
    assert one_sentence(str(caught.value))


@pytest.mark.parametrize("body", ["return 42", "ms.clear()", "raise ValueError('\\x1b[1m\\u202e')"])
def test_a_file_that_a_function_spoils_has_failed(
    tmp_path: Path, capfd: CAPTURE, body: str
) -> None:
    chain, source = tmp_path / "chain.py", tmp_path / "a.ply"
    chain.write_text(f"def chain(ms):\n    {body}\n")
    source.write_bytes(ply())
    assert main(["run", str(chain), str(source), str(tmp_path / "out.ply"), "--json"]) == 1
    document = json.loads(capfd.readouterr().out)
    assert document["status"] == "failed"
    assert document["traceback"] == ""
    assert one_sentence(document["reason"])
    assert not (tmp_path / "out.ply").exists()


def test_functions_may_return_what_filters_give(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.ply").write_bytes(ply())
    chain = tmp_path / "chain.py"
    for body in (
        "(ms.get_geometric_measures(), ms.meshing_inpaint_lowrank(detail='none'))",
        "[ms.get_hole_measures(), None]",
    ):
        chain.write_text(f"def chain(ms):\n    return {body}\n")
        assert batch(tmp_path / "in", tmp_path / "out", chain=chain, pictures=False).complete
