"""The page that `benchmarks.rims` writes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

_FLAWS = ("folds", "crossings")
_HEAD = """# Rims as they come

The first {} places of those that are measured by

    python -m benchmarks.rims ../shared/scans ../shared/models --page docs/rims.md

Round holes are punched at random vertices of public scans and models, every second one at a
border where there is one, so that it runs into it; radii are in mean edge lengths there. They are
filled by `meshlab_lowrank.inpaint(detail="{}", closerim=True)`, and by CGAL's
`triangulate_refine_and_fair_hole` with what lies around. Counted are folded edges (of flat caps
not those at the rim) and pairs of a new face and any other that cross. *Worse* is the number of
holes at which ours has more of both together than CGAL, *better* that at which it has fewer.
Holes that one of the two leaves open are left out of the sums.

Where ours is worse: outer rims whose fill crosses their sheet more than four times a face are
taken to lie on it, and are not closed otherwise; rims of more than 300 edges are not triangulated
by themselves; and where another part of the mesh passes through a hole, more faces cross it more
often.
"""


def page(rows: Sequence[dict[str, Any]], detail: str) -> str:
    """Write the page.

    Parameters
    ----------
    rows : sequence of dict
        Lines of the results.
    detail : str
        What our fills were made with.
    """
    parts = [_HEAD.format(len(rows), detail)]
    for radius in sorted({row["radius"] for row in rows}):
        chosen = [row for row in rows if row["radius"] == radius]
        parts.append(f"\n## Radius {radius:g}\n\n{_table(chosen)}")
    return "".join(parts)


def _table(rows: Sequence[dict[str, Any]]) -> str:
    head = (
        "| file | holes | at a border | ours open | CGAL open | folds, ours | CGAL "
        "| crossings, ours | CGAL | worse | better |"
    )
    lines = [head, "|---|" + "---:|" * 10]
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
    sums = [sum(pair[side][flaw] for pair in both) for flaw in _FLAWS for side in (0, 1)]
    more = [sum(ours[flaw] - other[flaw] for flaw in _FLAWS) for ours, other in both]
    borders = sum(row["at_border"] for row in rows)
    worse, better = sum(n > 0 for n in more), sum(n < 0 for n in more)
    return [len(rows), borders, *left, *sums, worse, better]
