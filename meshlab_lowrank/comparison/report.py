"""The report of a comparison: one HTML file with tables and pictures."""

from __future__ import annotations

import contextlib
import math
import platform
from collections.abc import Mapping
from importlib import metadata

from meshlab_lowrank.comparison.cases import Case
from meshlab_lowrank.comparison.comparing import Comparison
from meshlab_lowrank.comparison.gallery import (
    COLOURS,
    Gallery,
    PictureKey,
    colour_limit,
    shown_cases,
)
from meshlab_lowrank.comparison.measuring import Row
from meshlab_lowrank.comparison.tables import (
    Table,
    case_name,
    hole_name,
    not_installed,
    tables,
    verdicts,
)
from meshlab_lowrank.report import page
from meshlab_lowrank.threads import available_cores

_PACKAGES = (
    "meshlab-lowrank",
    "pymeshlab",
    "numpy",
    "scipy",
    "fast-simplification",
    "pyvista",
    "pymeshfix",
    "cgal",
    "vtk",
    "open3d",
    "trimesh",
)
_LEGEND = (
    "Lower pictures: distance of the fill to the truth, on one scale for all fillers of this hole. "
    "Grey is the known surface."
)
_BARS = (
    "Below them, of fills that tell how wrong they may be, the distance that is not exceeded in 68 "
    "% of cases, on the same scale."
)
FIGURES = {
    "RMS, max": "distance between the fill and what was there, from dense samples of both sides",
    "normals": "mean angle between the normals of the fill and of what was there",
    "roughness": "energy of the detail in the fill over that in the truth or the surroundings; "
    "1 is right, smooth fills lie below, torn or crumpled ones above",
    "dihedral": "mean angle between neighbouring faces of the fill over that of the truth; 1 is "
    "right, smooth fills lie below, crumpled ones above; only for triangles of about one size",
    "rim angle": "largest angle between a new and an old face that share an edge",
    "crossing, flipped, degenerate": "new faces that cut through others, look the wrong way, or "
    "have next to no height",
    "error bars": "distance to the true surface that the filler expects not to be exceeded at 68 % "
    "of the new vertices, and the part of them at which it is not",
    "Hausdorff": "MeshLab's Hausdorff filter between the whole result and the whole truth, both "
    "directions",
    "seconds, CPU s, MB": "of one run of the filler, on all holes of the mesh, in a process of its "
    "own: without starting and loading, with conversions to and from other packages; memory at "
    "the peak beyond the loaded mesh",
}


def html_report(comparison: Comparison, gallery: Gallery, command: str = "") -> str:
    """Write the report.

    Parameters
    ----------
    comparison : Comparison
    gallery : Gallery
    command : str
        The command line that made the comparison.

    Returns
    -------
    str
        A whole HTML document that needs nothing else; without pictures, it says why and what to
        do.
    """
    files, missing = gallery.files, gallery.missing
    parts = [page.paragraph(sentence) for sentence in _introduction(comparison)]
    if missing:
        parts.append(page.note(f"There are no pictures. {missing}"))
    all_tables = tables(comparison)
    for hole in dict.fromkeys(table.hole for table in all_tables):
        parts.append(page.heading(hole_name(hole)))
        parts += [page.paragraph(sentence) for sentence in verdicts(comparison, hole)]
        parts += [_table(table) for table in all_tables if table.hole == hole]
        if not missing:
            for case in shown_cases(comparison):
                if case.hole == hole:
                    parts += _row_of_pictures(comparison, case, files)
    parts += _making(comparison, command)
    return page.page(f"Hole fillers on {comparison.name}", *parts)


def _introduction(comparison: Comparison) -> list[str]:
    real = sum(case.place == 0 for case in comparison.cases)
    punched = len(comparison.cases) - real
    text = (
        f"{comparison.name} has {comparison.vertices} vertices and {comparison.faces} faces. "
        f"{len(comparison.fillers)} fillers were run on {real} of its holes"
    )
    if punched:
        text += f", and on {punched} that were punched where the surface is known"
    units = (
        "Lengths called edges are mean edge lengths around the hole. The best value of a column "
        "is bold on a tinted ground."
    )
    return [f"{text}.", units, *comparison.notes, *not_installed(comparison)]


def _table(table: Table) -> page.Html:
    return page.table(
        table.columns,
        table.rows,
        caption=table.caption,
        text_columns=table.text_columns,
        best=table.best,
    )


def _row_of_pictures(
    comparison: Comparison, case: Case, files: Mapping[PictureKey, bytes]
) -> list[page.Html]:
    name = case_name(case.hole, case.place)
    parts = [page.heading(f"{name}, same camera and light", 3)]
    drawn = any(key[0] == case.name and key[2] == "bars" for key in files)
    if case.truth is not None or drawn:
        limit = f"{colour_limit(comparison, case) / case.edge_length:.2g} edges and more"
        legends = [_LEGEND] * (case.truth is not None) + [_BARS] * drawn
        parts.append(page.paragraph(" ".join(legends)))
        parts.append(page.colour_scale(COLOURS, "0", limit))
    hole = files[case.name, "", "surface"]
    figures = [page.picture(hole, f"{name}, open", "the hole")]
    if case.truth is not None:
        truth = files[case.name, "truth", "surface"]
        figures.append(page.picture(truth, f"{name}, the true surface", "the truth"))
    for filler in comparison.fillers:
        row = comparison.select(case, filler)
        if row.status == "not installed":
            continue
        kinds = {"surface": "filled by", "errors": "errors of", "bars": "error bars of"}
        images = [
            (files[key], f"{name}, {words} {filler}")
            for kind, words in kinds.items()
            if (key := (case.name, filler, kind)) in files
        ]
        lines = (filler, *_caption(row))
        if images:
            figures.append(page.pictures(images, *lines))
        else:
            figures.append(page.missing_picture(row.status, *lines))
    parts.append(page.picture_row(figures))
    return parts


def _caption(row: Row) -> list[str]:
    """Give the figures that stand under a picture."""
    lines = [] if row.status == "filled" else [f"{row.status}: {row.reason}"]
    if row.error:
        lines.append(f"RMS {row.error.rms / row.edge_length:.3f} edges")
        lines.append(f"max {row.error.maximum / row.edge_length:.2f} edges")
        lines.append(f"normals {row.error.normal_error:.1f}°")
        lines.append(f"roughness {_number(row.error.roughness)}")
        lines.append(f"dihedral {_number(row.error.dihedral)}")
    if row.bars:
        lines.append(f"error bar {row.bars.median / row.edge_length:.3f} edges (median)")
    if row.shape and not row.error:
        lines.append(f"rim angle {_number(row.shape.rim_angle, 0)}°")
        lines.append(f"roughness to surroundings {_number(row.shape.roughness)}")
    if row.shape:
        counts = ("self_crossing", "crossing"), ("flipped", "flipped"), ("degenerate", "degenerate")
        bad = [f"{n} {word}" for name, word in counts if (n := getattr(row.shape, name))]
        lines.append(f"{row.shape.faces} faces" + (f", {', '.join(bad)}" if bad else ""))
    if math.isfinite(row.seconds):
        lines.append(f"{row.seconds:.2f} s")
    return lines


def _number(value: float, digits: int = 2) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "not defined"


def _making(comparison: Comparison, command: str) -> list[page.Html]:
    settings = {name: str(value) for name, value in comparison.settings.items()}
    surroundings = {
        "Python": platform.python_version(),
        "system": platform.platform(),
        "cores": str(available_cores()),
        "time of the whole run": f"{comparison.seconds:.1f} s",
    }
    parts = [page.heading("How this was made")]
    if command:
        parts.append(page.code(command))
    return [
        *parts,
        page.heading("Parameters", 3),
        page.definitions(settings),
        page.heading("Fillers", 3),
        page.definitions(comparison.fillers),
        page.heading("Figures", 3),
        page.definitions(FIGURES),
        page.heading("Versions", 3),
        page.definitions({**versions(), **surroundings}),
    ]


def versions() -> dict[str, str]:
    """Give the versions of this package and of those that it compares with or uses."""
    found = {}
    for package in _PACKAGES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found
