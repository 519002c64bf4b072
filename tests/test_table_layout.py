"""Tables on narrow terminals: names and numbers stay whole, sentences wrap, nothing is cut."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from meshlab_lowrank.cli import console
from meshlab_lowrank.cli.table_layout import GAP, blocks_of

FIGURES = [f"figure number {number}" for number in range(9)]
SENTENCE = "It is a cut: its rim is flat and met steeply all round, so it is capped flat."


def shown(monkeypatch: pytest.MonkeyPatch, width: int, columns: list[str], *rows: list[str]) -> str:
    screen = Console(file=io.StringIO(), width=width, highlight=False, markup=False)
    monkeypatch.setattr(console, "output", lambda: screen)
    console.say_table(columns, rows)
    text = screen.file.getvalue()
    assert max(map(len, text.splitlines())) <= width
    return text


@pytest.mark.parametrize("width", [40, 80, 120, 200])
def test_blocks_hold_every_column_once_and_fit(width: int) -> None:
    headings = ["filler", "status", *FIGURES]
    cells = [["meshlab-smooth", "not installed", *["12.345 (1.00-2.00)"] * 9], ["a", *["b"] * 10]]
    blocks = blocks_of(headings, cells, width)
    assert [j for block in blocks for j in block.columns[1:]] == list(range(1, 11))
    for block in blocks:
        assert block.columns[0] == 0
        assert sum(block.widths) + GAP * (len(block.widths) - 1) <= width
        for j, room in zip(block.columns, block.widths, strict=True):
            assert room >= max(len(row[j]) for row in cells)


def test_names_of_fillers_and_figures_are_whole_at_80_columns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    row = ["meshlab-smooth", "not installed", *[f"1{number}.345" for number in range(9)]]
    text = shown(monkeypatch, 80, ["filler", "status", *FIGURES], row)
    assert all(cell in text for cell in row)
    assert text.count("meshlab-smooth") == 2


def test_reasons_are_readable_at_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    columns = ["id", "edges", "diameter", "status", "faces", "flaws", "rim°", "trust", "reason"]
    row = ["12", "16", "0.008679", "filled", "36", "0", "104", "0.00", SENTENCE]
    lines = shown(monkeypatch, 80, columns, row).splitlines()
    assert len(lines) <= 7
    words = " ".join(line[lines[0].index("reason") :].strip() for line in lines[1:])
    assert words == SENTENCE


def test_a_long_name_of_a_file_is_folded_and_its_reason_stands_beside(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    name = "folder/" * 12 + "scan.ply"
    lines = shown(
        monkeypatch, 80, ["file", "status", "reason"], [name, "partly filled", SENTENCE]
    ).splitlines()
    assert lines[0].split() == ["file", "status", "reason"]
    end = lines[0].index("status")
    assert "".join(line[:end].strip() for line in lines[1:]) == name


def test_a_wide_terminal_has_one_line_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    text = shown(monkeypatch, 200, ["file", "reason"], ["a.ply", SENTENCE])
    assert len(text.splitlines()) == 2
