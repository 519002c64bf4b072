"""The page that `benchmarks.rims` writes."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Any

_FLAWS = ("folds", "crossings")
_SUMMED = (*_FLAWS, "faces")
_HEAD = """# Rims as they come

{places} places, measured by

    python -m benchmarks.rims FOLDER FOLDER --longest {longest} \\
        --page docs/rims.md

in turn: the first place on each mesh with each radius, then the second ones, as far as the time
went. Places with more than {longest} edges at their rims together are passed over.

Round holes are punched at random vertices of public scans and models, every second one at a
border where there is one, so that it runs into it; radii are in mean edge lengths there. They are
filled by `meshlab_lowrank.inpaint(detail="{detail}", closerim=True)`, and by CGAL's
`triangulate_refine_and_fair_hole` with what lies around. Counted are folded edges (of flat caps
not those at the rim) and pairs of a new face and any other that cross. *Worse* is the number of
places at which ours has more of both together than CGAL, *better* that at which it has fewer.
Places that one of the two leaves open are left out of the sums.

Fills that cross something are tried in several ways, also with edges up to three times as long as
those of the rim, and the record says which it was; so some of ours have fewer faces than CGAL's, as
the tables say. Ours is still worse at some outer rims, where each way crosses the sheet, where
other parts of the mesh pass through a hole, and at rims that cross themselves.
A hole took {median:.1f} s of one processor at half of the places or less, and {most:.0f} s at most.
"""


def page(rows: Sequence[dict[str, Any]], detail: str, longest: int) -> str:
    """Write the page.

    Parameters
    ----------
    rows : sequence of dict
        Lines of the results.
    detail : str
        What our fills were made with.
    longest : int
        Most edges of the rims at a place.
    """
    took = [row["fills"]["ours"]["seconds"] / len(row["edges"]) for row in rows]
    figures = {"median": median(took), "most": max(took)}
    parts = [_HEAD.format(places=len(rows), detail=detail, longest=longest, **figures)]
    for radius in sorted({row["radius"] for row in rows}):
        chosen = [row for row in rows if row["radius"] == radius]
        parts.append(f"\n## Radius {radius:g}\n\n{_table(chosen)}")
    return "".join(parts)


def _table(rows: Sequence[dict[str, Any]]) -> str:
    head = (
        "| file | places | at a border | ours open | CGAL open | folds, ours | CGAL "
        "| crossings, ours | CGAL | faces, ours | CGAL | worse | better |"
    )
    lines = [head, "|---|" + "---:|" * 12]
    groups = {name: [r for r in rows if r["file"] == name] for name in _names(rows)}
    for name, group in {**groups, "**all**": list(rows)}.items():
        lines.append(f"| {name} | " + " | ".join(map(str, _figures(group))) + " |")
    return "\n".join(lines) + "\n"


def _names(rows: Sequence[dict[str, Any]]) -> list[str]:
    return sorted({row["file"] for row in rows})


def _figures(rows: Sequence[dict[str, Any]]) -> list[object]:
    fills = [(row["fills"]["ours"], row["fills"]["cgal"]) for row in rows]
    left = [sum(pair[side]["status"] != "filled" for pair in fills) for side in (0, 1)]
    both = [pair for pair in fills if all(fill["status"] == "filled" for fill in pair)]
    sums = [sum(pair[side][flaw] for pair in both) for flaw in _SUMMED for side in (0, 1)]
    more = [sum(ours[flaw] - other[flaw] for flaw in _FLAWS) for ours, other in both]
    borders = sum(row["at_border"] for row in rows)
    worse, better = sum(n > 0 for n in more), sum(n < 0 for n in more)
    return [len(rows), borders, *left, *sums, worse, better]
