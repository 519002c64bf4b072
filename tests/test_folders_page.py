"""The page of a folder: the order of the holes, all runs, what failed, narrow screens."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from meshlab_lowrank.cli import build_parser
from meshlab_lowrank.cli.inpaint import parameters_of
from meshlab_lowrank.folders import batch
from meshlab_lowrank.folders.command import command_line
from meshlab_lowrank.folders.file_run import FileRecord
from meshlab_lowrank.folders.hole_pictures import Album
from meshlab_lowrank.folders.ranking import worst_holes
from meshlab_lowrank.folders.summary_page import PAGE_NAME, summary_page
from meshlab_lowrank.records import checked_hole
from meshlab_lowrank.version import __version__
from tests.builders import RUN_FACTS as FACTS
from tests.hostile_files import ply


def hole(**changes: Any) -> dict[str, Any]:
    usual = {"id": 0, "status": "filled", "reason": "", "boundary_edges": 9, "perimeter": 1.0}
    usual |= {"diameter": 1.0, "new_faces": 5, "trust": 0.5, "rim_angle": 5.0, "edge_ratio": 1.0}
    return checked_hole({**usual, **changes})


def order(*holes: dict[str, Any]) -> list[int]:
    record = FileRecord(file="a.ply", status="partly filled", holes=list(holes))
    return [each["id"] for _, each in worst_holes([record])]


def test_open_then_flawed_then_sharp_then_doubted_holes_come_first() -> None:
    triangle = {"boundary_edges": 3, "new_faces": 1, "trust": 0.0}
    assert order(
        hole(id=0, **triangle),
        hole(id=1, trust=0.9, boundary_edges=40),
        hole(id=2, trust=None, boundary_edges=40),
        hole(id=3, rim_angle=70.0, trust=0.9),
        hole(id=4, rim_angle=90.0, trust=0.9),
        hole(id=5, folded_edges=1, trust=0.9),
        hole(id=6, flat_faces=1, crossings=3, trust=0.9),
        hole(id=7, status="failed", rim_angle=None, edge_ratio=None, trust=0.0),
        hole(id=8, status="skipped", rim_angle=None, edge_ratio=None),
    ) == [7, 6, 5, 4, 3, 2, 1, 0]


def test_a_cut_is_met_steeply_and_no_worse_for_it() -> None:
    assert order(hole(id=0, shape="cut", rim_angle=90.0), hole(id=1, boundary_edges=10)) == [1, 0]


def test_what_is_not_known_is_told_in_words() -> None:
    record = FileRecord(file="a.ply", status="done", holes=[hole(trust=None, rim_angle=None)])
    text = summary_page([record], FACTS, Album())
    assert "unknown" in text
    assert "None" not in text


def test_the_page_says_how_good_fills_are_and_how_it_was_made() -> None:
    holes = [hole(crossings=17, rim_angle=123.0, edge_ratio=1.75)]
    facts = replace(FACTS, parameters={"maxholesize": "400"})
    text = summary_page([FileRecord(file="a.ply", status="done", holes=holes)], facts, Album())
    for words in ("17", "123", "1.75", "maxholesize 400", *(FACTS.source, FACTS.target)):
        assert words in text
    assert FACTS.command in text
    assert FACTS.finished in text


def test_what_failed_stands_before_all_else() -> None:
    records = [
        FileRecord(file="good.ply", status="done", holes=[hole()]),
        FileRecord(file="partly.ply", status="partly filled", reason="One stayed open."),
        FileRecord(file="dead.ply", status="crashed", reason="It died."),
    ]
    text = summary_page(records, FACTS, Album())
    places = [text.index(name) for name in ("dead.ply", "partly.ply", "good.ply")]
    assert places == sorted(places)
    assert places[1] < text.index("Holes, the worst first") < places[2]
    assert "What failed" not in summary_page(records[:1], FACTS, Album())


def test_each_cell_of_a_card_has_the_name_of_its_column() -> None:
    text = summary_page([FileRecord(file="a.ply", status="done", holes=[hole()])], FACTS, Album())
    table = re.search(r'<table class="cards".*?</table>', text, re.DOTALL)
    assert table
    columns = re.findall(r'<th scope="col"[^>]*>(.*?)</th>', table[0])
    names = re.findall(r'<td[^>]* data-name="(.*?)"', table[0])
    assert names == columns[1:]
    assert "max-width: 640px" in text


def test_files_are_counted_over_all_runs(tmp_path: Path) -> None:
    scans, out = tmp_path / "in", tmp_path / "out"
    scans.mkdir()
    (scans / "first.ply").write_bytes(ply())
    (scans / "bad.ply").write_text("no mesh")
    options: dict[str, Any] = {"pictures": False, "parameters": {"detail": "none"}}
    batch(scans, out, **options)
    (scans / "bad.ply").unlink()
    (scans / "second.ply").write_bytes(ply())
    result = batch(scans, out, **options)
    assert result.counts == {"skipped": 1, "done": 1}
    text = (out / PAGE_NAME).read_text(encoding="utf-8")
    assert "3 over all runs: 1 failed, 2 done" in text
    assert "1 worked on" in text
    assert __version__ in text
    assert "skipped" not in text
    assert command_line(scans, out, {"detail": "none"}, pictures=False) in text


@pytest.mark.parametrize(
    ("parameters", "options"),
    [
        ({}, {}),
        ({"closerim": "true", "detail": "none", "refineedgelen": "1%"}, {"repair": True}),
        ({"closerim": "false"}, {"suffix": ".ply", "workers": 2, "timeout": 2.5}),
        ({}, {"chain": "my chain.mlx", "pictures": False}),
    ],
)
def test_the_command_is_read_back_as_it_was_meant(
    parameters: dict[str, str], options: dict[str, Any]
) -> None:
    program, *words = shlex.split(command_line("my scans", "out", parameters, **options))
    args = build_parser().parse_args(words)
    assert program == "meshlab-lowrank"
    assert (args.in_dir, args.out_dir) == (Path("my scans"), Path("out"))
    given = {name: text for name, text in parameters.items() if text != "false"}
    assert parameters_of(args) == given
    assert args.repair == options.get("repair", False)
    assert args.workers == options.get("workers")
    assert args.timeout == options.get("timeout")
    assert args.chain == options.get("chain")
    assert args.format == (options["suffix"][1:] if "suffix" in options else None)
    assert args.no_pictures != options.get("pictures", True)
