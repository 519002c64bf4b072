"""The picture of a mesh with its holes numbered."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from meshlab_lowrank.cli import main
from meshlab_lowrank.report.label_places import place_labels
from meshlab_lowrank.report.sides import choose, sides_of, worth
from tests.test_cli import write_sphere

CAPTURE = pytest.CaptureFixture[str]


def test_sides_are_right_handed_and_all_different() -> None:
    sides = sides_of(np.array([1.0, 3.0, 2.0]))
    assert len({side.name for side in sides}) == 26
    for side in sides:
        frame = np.stack([side.right, side.up, side.towards])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1.0)
    assert sides[0].name == "+x"
    np.testing.assert_allclose(sides[0].up, [0.0, 1.0, 0.0])


def test_few_sides_show_every_hole() -> None:
    sides = sides_of(np.ones(3))
    normals = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.1, 0.0, -1.0]])
    values = np.array([worth(normals, np.zeros(4, dtype=bool), np.ones(4), side) for side in sides])
    chosen = choose(values)
    assert len(chosen) == 2
    assert (values[chosen].max(axis=0) > 0.65).all()
    assert len(choose(np.zeros((26, 0)))) == 1
    assert len(choose(np.zeros((26, 3)))) == 1


def test_a_hidden_hole_is_worth_nothing() -> None:
    front, *_ = sides_of(np.ones(3))
    towards = np.array([[1.0, 0.0, 0.0]] * 2)
    outer = np.array([False, True])
    np.testing.assert_array_equal(worth(towards, outer, np.array([0.0, 1.0]), front), [0.0, 1.0])
    hole, rim = worth(-towards, outer, np.ones(2), front)
    assert 0.0 < hole < 0.5 < rim == 1.0


def test_labels_stand_in_large_holes_and_beside_small_ones_but_never_on_another() -> None:
    chance = np.random.default_rng(0)
    anchors = [tuple(place) for place in chance.uniform(150.0, 450.0, (40, 2)).tolist()]
    sizes = [(30.0, 20.0)] * 41
    places = place_labels([(300.0, 60.0), *anchors], [40.0, *[3.0] * 40], sizes, (600.0, 600.0))
    assert places[0] == (300.0, 60.0)
    for i, (x, y) in enumerate(places):
        assert 15.0 <= x <= 585.0
        assert 10.0 <= y <= 590.0
        for u, v in places[:i]:
            assert abs(x - u) >= 30.0 or abs(y - v) >= 20.0
    for (x, y), (u, v) in zip(anchors, places[1:], strict=True):
        assert abs(x - u) >= 15.0 or abs(y - v) >= 10.0


def test_a_number_stands_in_its_hole(tmp_path: Path, capsys: CAPTURE) -> None:
    pytest.importorskip("pyvista")
    image = pytest.importorskip("PIL.Image")
    mesh = write_sphere(tmp_path / "a.ply")
    picture = tmp_path / "a.png"
    assert main(["holes", str(mesh), "--picture", str(picture)]) == 0
    assert "1 boundary loops" in capsys.readouterr().out
    pixels = np.asarray(image.open(picture).convert("RGB")).astype(int)
    rim = np.abs(pixels - [0xC2, 0x18, 0x5B]).sum(axis=2) < 60
    rows, columns = np.nonzero(rim)
    inside = pixels[rows.min() : rows.max(), columns.min() : columns.max()]
    label = np.argwhere((inside > 250).all(axis=2))
    assert len(label) > 100
    assert np.abs(label.mean(axis=0) - np.array(inside.shape[:2]) / 2).max() < 6
    assert np.ptp(label, axis=0).max() < 40
    assert np.ptp(columns) == pytest.approx(np.ptp(rows), rel=0.1)  # seen from its front


def test_fills_are_coloured_by_their_error_bars(tmp_path: Path, capsys: CAPTURE) -> None:
    pytest.importorskip("pyvista")
    image = pytest.importorskip("PIL.Image")
    mesh, picture = write_sphere(tmp_path / "a.ply"), tmp_path / "a.png"
    call = ["inpaint", str(mesh), str(tmp_path / "b.ply"), "--picture", str(picture)]
    for options, bright in ((["--detail", "none"], True), (["--continuity", "flat"], False)):
        assert main([*call, *options, "--quiet"]) == 0
        assert ("not known" in capsys.readouterr().err) != bright
        pixels = np.asarray(image.open(picture).convert("RGB")).astype(int)
        red, green, blue = np.moveaxis(pixels, 2, 0)
        yellow = (red > 200) & (green > 180) & (blue < 110)
        orange = (red > 150) & (np.abs(green - 0.68 * red) < 20) & (blue < 0.5 * red)
        assert (np.count_nonzero(yellow) > 200) == bright
        assert (np.count_nonzero(orange & ~yellow) > 1000) != bright


def test_pictures_of_fills_have_a_name_too(tmp_path: Path, capsys: CAPTURE) -> None:
    mesh = write_sphere(tmp_path / "a.ply", subdiv=2)
    call = ["inpaint", str(mesh), str(tmp_path / "b.ply"), "--picture", str(tmp_path / "a.gif")]
    assert main(call) == 2
    assert "a.gif" in capsys.readouterr().err
    assert not (tmp_path / "b.ply").exists()


@pytest.mark.parametrize("name", ["a.ply", "a.gif", "no/a.png"])
def test_wrong_names_of_pictures_are_wrong_calls(
    tmp_path: Path, capsys: CAPTURE, name: str
) -> None:
    mesh = write_sphere(tmp_path / "a.ply", subdiv=2)
    before = mesh.read_bytes()
    assert main(["holes", str(mesh), "--picture", str(tmp_path / name)]) == 2
    assert str(tmp_path) in capsys.readouterr().err
    assert mesh.read_bytes() == before


def test_without_the_renderer_the_extra_is_named(
    tmp_path: Path, capsys: CAPTURE, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = write_sphere(tmp_path / "a.ply", subdiv=2)
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert main(["holes", str(mesh), "--picture", str(tmp_path / "a.png")]) == 1
    assert "pip install 'meshlab-lowrank[pictures]'" in capsys.readouterr().err
    assert not (tmp_path / "a.png").exists()
