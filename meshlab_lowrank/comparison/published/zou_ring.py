"""The ring of least area between two closed chains of points."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.comparison.published.least_area import least_areas, pieces
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import edges_of

RING_WORK = 10**9  # steps, some ten seconds

_BOTH_SIDES = 2


def ring_work(one: int, other: int) -> int:
    """Count the steps that a ring between chains of so many points takes."""
    return (one * other) ** 2 * (one + other) // 2


def triangulated_ring(one: FloatArray, other: FloatArray, banned: BoolArray) -> IntArray | None:
    """Join two closed chains of points by the ring of triangles with the least area.

    A ring has edges from chain to chain; between two that follow each other lies a triangle that
    passes one side of a chain, or several, whose piece is triangulated by itself. So it is the
    shortest closed way through all such edges, tried from each of them.

    Parameters
    ----------
    one : (p, 3) float64
    other : (q, 3) float64
        Both in the order of a fill.
    banned : (p + q, p + q) bool
        Pairs between which no edge may run.

    Returns
    -------
    (p + q, 3) int64 or None
        Numbers from p on are of the other chain. None where the bans leave no ring, or that of
        the least area would have an edge twice.
    """
    p, q = len(one), len(other)
    back = np.arange(q)[::-1]  # a ring passes the other chain against its order
    costs, apex = _costs(one, other[back], banned[:p, :p])
    other_costs, other_apex = _costs(other[back], one, banned[p:, p:][np.ix_(back, back)])
    least = _least(costs, other_costs, banned[:p, p:][:, back])
    a, b = np.unravel_index(np.argmin(least[p, q]), (p, q))
    if not np.isfinite(least[p, q, a, b]):
        return None
    triangles: list[tuple[int, int, int]] = []
    i, j = p, q
    while i + j > 0:
        g, h = _step(least[:, :, a, b], costs, other_costs, (int(a), int(b)), (i, j))
        here, there = int(a + i) % p, int(b + j) % q
        if g > 0:
            start = (here - g) % p
            triangles.append((start, here, p + int(back[there])))
            triangles += [(x % p, y % p, z % p) for x, y, z in pieces(apex, start, start + g)]
        else:
            start = (there - h) % q
            triangles.append((p + int(back[there]), p + int(back[start]), here))
            triangles += [
                (p + int(back[z % q]), p + int(back[y % q]), p + int(back[x % q]))
                for x, y, z in pieces(other_apex, start, start + h)
            ]
        i, j = i - g, j - h
    found = np.array(triangles, dtype=np.int64)
    return found if int(edges_of(found).face_count.max()) <= _BOTH_SIDES else None


def _costs(own: FloatArray, other: FloatArray, banned: BoolArray) -> tuple[FloatArray, IntArray]:
    """Areas (p, p, q) of passing sides of a chain from a point on, seen from one of the other.

    Also the third corners at the chords of the chain, gone round twice, for `pieces`.
    """
    p = len(own)
    twice = np.concatenate([own, own])
    weight, apex = least_areas(twice, np.tile(banned, (2, 2)), p - 1)
    costs = np.full((p, p, len(other)), np.inf)
    a = np.arange(p)
    for g in range(1, p):
        side = twice[a + g] - own
        across = np.cross(side[:, None], other[None] - own[:, None])
        costs[:, g] = 0.5 * np.linalg.norm(across, axis=2) + weight[a, a + g, None]
    return costs, apex


def _least(costs: FloatArray, other_costs: FloatArray, blocked: BoolArray) -> FloatArray:
    """Least areas (p + 1, q + 1, p, q) after so many sides of both, by the edge that was first."""
    p, q = blocked.shape
    least = np.full((p + 1, q + 1, p, q), np.inf)
    a, b = np.arange(p)[:, None], np.arange(q)
    least[0, 0] = np.where(blocked, np.inf, 0.0)
    for i, j in np.ndindex(p + 1, q + 1):
        here, there = (a + i) % p, (b + j) % q
        best = least[i, j]
        if i > 0:
            g = np.arange(1, min(i, p - 1) + 1)[:, None, None]
            before = least[i - g[:, 0, 0], j]
            best = np.minimum(best, (before + costs[(here - g) % p, g, there]).min(axis=0))
        if j > 0:
            g = np.arange(1, min(j, q - 1) + 1)[:, None, None]
            before = least[i, j - g[:, 0, 0]]
            best = np.minimum(best, (before + other_costs[(there - g) % q, g, here]).min(axis=0))
        least[i, j] = np.where(blocked[here, there], np.inf, best)
    return least


def _step(
    least: FloatArray,
    costs: FloatArray,
    other_costs: FloatArray,
    start: tuple[int, int],
    end: tuple[int, int],
) -> tuple[int, int]:
    """Give the sides of both chains that the last triangle of a way passes, one of them none."""
    (i, j), (p, q) = end, (len(costs), len(other_costs))
    here, there = (start[0] + i) % p, (start[1] + j) % q
    g = np.arange(1, min(i, p - 1) + 1)
    h = np.arange(1, min(j, q - 1) + 1)
    ways = np.concatenate(
        [
            least[i - g, j] + costs[(here - g) % p, g, there],
            least[i, j - h] + other_costs[(there - h) % q, h, here],
        ]
    )
    best = int(np.argmin(ways))
    return (best + 1, 0) if best < len(g) else (0, best - len(g) + 1)
