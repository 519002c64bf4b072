"""Walk the boundary of a mesh: chains of half-edges, split into loops without repetition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import (
    FloatArray,
    IntArray,
    corner_angles,
    corner_sum,
    normalized,
)
from meshlab_lowrank.mesh.topology import faces_at, half_edge_ends, vertex_adjacency

_ROUND = 2.0 * np.pi
_LEVEL = 0.3  # least cosine between fans that meet at a vertex and their mean normal
_LEANING = 0.5 * np.pi  # most by which the angle of such a fan may differ, seen along that normal
_SMOOTHING = 5
_SMOOTHED_RINGS = 3


@dataclass(frozen=True)
class Loop:
    """One loop, as a face that fills it would run through it.

    Attributes
    ----------
    vertices : (k,) int64
        Each vertex once, the smallest index first.
    faces : (k,) int64
        The face at the edge from vertices[i] to vertices[i + 1].
    turning : float
        Sum of pi minus the angle of the smoothed surface at each vertex. Of a chain that is split
        where the angle can't be told, the loop with the largest flat area has that of the whole
        chain, and the pockets that it encloses have -2 pi.
    loose : bool
        Whether it comes from `loose_chains`.
    """

    vertices: IntArray
    faces: IntArray
    turning: float
    loose: bool = False

    def order(self) -> tuple[int, ...]:
        """Key to sort by: longest first, equally long ones by their first vertices."""
        return (-len(self.vertices), *self.vertices[:2].tolist())


class BoundaryWalk:
    """The boundary half-edges of a mesh, walked with the surface on the left, the gap on the right.

    Attributes
    ----------
    half_edges, tails, heads : (b,) int64
        Half-edge 3 f + i of face f, and the vertices it joins.
    following : (b,) int64
        Place of the half-edge that comes next along the gap. Where several fans of faces meet at
        the head it is that of the next fan, if they lie side by side there like the sectors of a
        disc, and otherwise, as elsewhere, of the same fan.
    pinched : (n,) bool
        Vertices with more than one fan.
    faces : (m, 3) int64
        The faces with a vertex of its own, from n on, for each fan at a pinched vertex.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, half_edges: IntArray) -> None:
        n = len(vertices)
        self.half_edges = half_edges
        self.tails, self.heads = half_edge_ends(faces, half_edges)
        self.pinched = np.bincount(self.tails, minlength=n) > 1
        leaving = np.full(n, -1, dtype=np.int64)
        leaving[self.tails] = np.arange(len(half_edges))
        near = faces[faces_at(leaving >= 0, faces)]
        smooth = _smoothed(vertices, faces, self.tails, self.heads)
        fans = corner_sum(near, corner_angles(smooth, near).ravel(), n)
        self.following = leaving[self.heads]
        self._around_fan = self.following
        self._fan_angles = fans[self.heads]
        self._arriving, self._leaving = (np.full(len(half_edges), np.nan) for _ in range(2))
        self.faces = faces
        if self.pinched.any():
            self.faces = faces.copy()
            self._walk_fans(smooth)

    def _walk_fans(self, vertices: FloatArray) -> None:
        """Correct what follows, and the angle, where the head has more than one fan."""
        around = np.flatnonzero(faces_at(self.pinched, self.faces))
        faces = self.faces[around]
        angles = corner_angles(vertices, faces)
        turn = {}  # in a face with corners a, b, c: (a, b) to c, the angle at b and where b stands
        for i in range(3):
            a, b, c = np.roll(faces, 1 - i, axis=1).T.tolist()
            here = angles[:, i].tolist()
            where = (3 * around + i).tolist()
            turn.update({pair[:2]: pair[2:] for pair in zip(a, b, c, here, where, strict=True)})
        outgoing = np.flatnonzero(self.pinched[self.tails])
        ends = zip(self.tails[outgoing].tolist(), self.heads[outgoing].tolist(), strict=True)
        place = dict(zip(ends, outgoing.tolist(), strict=True))
        arriving = np.flatnonzero(self.pinched[self.heads])
        meeting: dict[int, list[int]] = {}
        normals = np.zeros((len(arriving), 3))
        for fan, edge in enumerate(arriving):
            spoke, hub = int(self.tails[edge]), int(self.heads[edge])
            total = 0.0
            corners = []
            while (hub, spoke) not in place:
                first = vertices[spoke] - vertices[hub]
                spoke, angle, corner = turn[spoke, hub]
                normals[fan] += np.cross(vertices[spoke] - vertices[hub], first)
                total += angle
                corners.append(corner)
            self.following[edge] = place[hub, spoke]
            self._fan_angles[edge] = total
            self.faces.ravel()[corners] = len(vertices) + fan
            meeting.setdefault(hub, []).append(fan)
        self._around_fan = self.following.copy()
        for fans in meeting.values():
            self._cross_gaps(vertices, arriving[fans], normals[fans])

    def _cross_gaps(self, vertices: FloatArray, edges: IntArray, normals: FloatArray) -> None:
        """Go on to the next fan where fans meet like the sectors of a disc.

        ``edges`` arrive at their common head, one for each fan, ``normals`` are those of the fans.
        """
        normals = normalized(normals)
        upright = normalized(normals.sum(axis=0)[None])[0]
        if (normals @ upright < _LEVEL).any():
            return
        hub = vertices[self.heads[edges[0]]]
        left = self._around_fan[edges]
        first = np.cross(upright, np.eye(3)[np.argmin(np.abs(upright))])
        plane = np.stack([first, np.cross(upright, first)])
        arrived, gone = (
            np.arctan2(*(plane @ (vertices[ends] - hub).T)[::-1])
            for ends in (self.tails[edges], self.heads[left])
        )
        order = np.argsort(gone)  # seen from outside a fan runs from where it is left anticlockwise
        arrived, gone, edges, left = arrived[order], gone[order], edges[order], left[order]
        width = np.mod(arrived - gone, _ROUND)
        apart = np.mod(np.roll(gone, -1) - gone, _ROUND)
        if (width >= apart).any() or (np.abs(width - self._fan_angles[edges]) > _LEANING).any():
            return
        self.following[edges] = np.roll(left, -1)
        self._arriving[edges], self._leaving[left] = arrived, gone

    def loops(self, vertices: FloatArray) -> list[Loop]:
        """Walk every chain and split it where it meets a vertex again; longest loops first."""
        found = []
        seen = [False] * len(self.following)
        following, heads = self.following.tolist(), self.heads.tolist()
        for start in range(len(seen)):
            edge = start
            path: list[int] = []
            at: dict[int, int] = {}  # vertex to the place on the path of the edge that came there
            loops = []
            while not seen[edge]:
                seen[edge] = True
                met = at.get(heads[edge])
                if met is None:
                    at[heads[edge]] = len(path)
                    path.append(edge)
                else:
                    loops.append([*path[met + 1 :], edge])
                    for other in path[met + 1 :]:
                        del at[heads[other]]
                    del path[met + 1 :]
                edge = following[edge]
            if path:
                found += self._loops_of_chain([*loops, path], vertices)
        found.sort(key=Loop.order)
        return found

    def _loops_of_chain(self, paths: list[list[int]], vertices: FloatArray) -> list[Loop]:
        """Turn closed paths round, so that they run as the faces of a fill would."""
        loops = []
        for path in paths:
            turning = self._turning(np.array(path), np.roll(path, -1))
            edges = np.array(path[::-1])
            edges = np.roll(edges, -int(np.argmin(self.heads[edges])))
            loops.append(Loop(self.heads[edges], self.half_edges[edges] // 3, turning))
        if not np.isnan([loop.turning for loop in loops]).any():
            return loops
        chain = np.concatenate(paths)
        whole = self._turning(chain, self.following[chain])
        largest = max(range(len(loops)), key=lambda i: flat_area(vertices[loops[i].vertices]))
        return [
            replace(loop, turning=whole if i == largest else -_ROUND)
            for i, loop in enumerate(loops)
        ]

    def _turning(self, edges: IntArray, following: IntArray) -> float:
        """Sum the turning from edges to those that follow them; NaN where it can't be told."""
        gap = np.mod(self._leaving[following] - self._arriving[edges], _ROUND)
        same = following == self._around_fan[edges]
        return float(np.where(same, np.pi - self._fan_angles[edges], gap - np.pi).sum())


def loose_chains(faces: IntArray, half_edges: IntArray, loops: Sequence[Loop]) -> list[Loop]:
    """Join the boundary half-edges that no loop has to chains.

    Parameters
    ----------
    faces : (m, 3) int64
    half_edges : (b,) int64
        All boundary half-edges.
    loops : sequence of Loop

    Returns
    -------
    list of Loop
        Each as long as it goes on; it need not close, may meet a vertex again, and its turning
        is 0.
    """
    tails, heads = (ends.tolist() for ends in half_edge_ends(faces, half_edges))
    walked = {
        ends
        for loop in loops
        for ends in zip(loop.vertices.tolist(), np.roll(loop.vertices, -1).tolist(), strict=True)
    }
    leaving: dict[int, list[int]] = {}
    for edge in reversed(range(len(half_edges))):
        if (heads[edge], tails[edge]) not in walked:
            leaving.setdefault(heads[edge], []).append(edge)
    chains = []
    for start in sorted(leaving):
        while leaving[start]:
            path, at = [], start
            while leaving.get(at):
                path.append(leaving[at].pop())
                at = tails[path[-1]]
            vertices = np.array([heads[edge] for edge in path])
            chains.append(Loop(vertices, half_edges[path] // 3, 0.0, loose=True))
    return chains


def flat_area(points: FloatArray) -> float:
    """Area of a polygon (k, 3) seen along its mean normal."""
    return float(np.linalg.norm(area_vector(points)))


def area_vector(points: FloatArray) -> FloatArray:
    """Mean normal of a polygon (k, 3), as long as the area seen along it."""
    spokes = points - points.mean(axis=0)
    normal: FloatArray = 0.5 * np.cross(spokes, np.roll(spokes, -1, axis=0)).sum(axis=0)
    return normal


def rim_centre(points: FloatArray) -> FloatArray:
    """Give the centre of mass (d,) of a closed polygon (k, d), wherever its corners are dense."""
    following = np.roll(points, -1, axis=0)
    lengths = np.linalg.norm(following - points, axis=1)
    if not lengths.any():
        return np.asarray(points.mean(axis=0))
    return np.asarray(np.average(0.5 * (points + following), axis=0, weights=lengths))


def _smoothed(
    vertices: FloatArray, faces: IntArray, tails: IntArray, heads: IntArray
) -> FloatArray:
    """Smooth the surface near its boundary edges, and these as curves.

    Without this the noise of a scan adds up along its rim to several times pi of turning.
    """
    near = np.zeros(len(vertices), dtype=np.bool_)
    near[tails] = True
    for _ in range(_SMOOTHED_RINGS):
        near[faces[faces_at(near, faces)]] = True
    used, local = np.unique(faces[~faces_at(~near, faces)], return_inverse=True)
    n = len(used)
    ends = (np.searchsorted(used, tails), np.searchsorted(used, heads))
    curve = sparse.coo_array((np.ones(len(tails)), ends), shape=(n, n)).tocsr()
    inside = np.ones(n)
    inside[ends[0]] = 0.0
    surface = sparse.diags_array(inside) @ vertex_adjacency(local.reshape(-1, 3), n)
    neighbours = sparse.csr_array(surface + curve + curve.T)
    degree = np.asarray(neighbours.sum(axis=1)).reshape(-1, 1)
    points = vertices[used]
    for _ in range(_SMOOTHING):
        points = 0.5 * (points + (neighbours @ points) / degree)
    result = vertices.copy()
    result[used] = points
    return result
