"""Whether what is called the truth is the surface of the mesh, in the same place."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, edge_lengths
from meshlab_lowrank.mesh.triangle_sampling import sample_surface

_FAR = (
    0.25  # mean edge lengths of the coarser mesh; another triangulation is nearer nearly all over
)
_MOST_FAR = 0.1  # of the surface
_MEDIAN = 0.1  # mean edge lengths
_SAMPLES = 4_000, 20_000  # least and most


@dataclass(frozen=True, kw_only=True)
class TruthDistance:
    """How far the known surface is from the truth.

    Attributes
    ----------
    limit : float
        Distance from which a place counts as far, in mean edge lengths of the mesh.
    share_far : float
        Part of the known surface that is far.
    median_in_edges, median_over_diagonal : float
        Of the distance, in mean edge lengths and in diagonals of the bounding box of the mesh.
    same : bool
        Whether the truth is the same surface, for all that another triangulation does.
    """

    limit: float
    share_far: float
    median_in_edges: float
    median_over_diagonal: float
    same: bool

    def as_dict(self) -> dict[str, float]:
        """Give the figures by name."""
        return asdict(self)

    def warning(self, name: str, truth: str) -> str:
        """Give a sentence on a truth that is another surface; empty if it is the same.

        Parameters
        ----------
        name, truth : str
            Of the mesh and the truth.

        Returns
        -------
        str
        """
        if self.same:
            return ""
        return (
            f"The truth {truth} is not the surface of {name}, or not in the same place: "
            f"{self.share_far:.0%} of the known surface is farther from it than {self.limit:.2g} "
            f"mean edge lengths, and the median distance is {self.median_in_edges:.2g} "
            f"({100.0 * self.median_over_diagonal:.2g} % of the diagonal); errors against it tell "
            "nothing."
        )


def truth_distance(
    mesh: tuple[FloatArray, IntArray], truth: tuple[FloatArray, IntArray]
) -> TruthDistance:
    """Measure how far a mesh with holes is from the truth.

    Parameters
    ----------
    mesh, truth : (vertices, faces)

    Returns
    -------
    TruthDistance
    """
    own, other = (float(edge_lengths(*each).mean()) for each in (mesh, truth))
    least, most = _SAMPLES
    samples = sample_surface(*mesh, own, least=least, most=most)
    distances = TriangleIndex(*truth).closest(samples.points).distances
    unit = max(own, other)
    share = float(np.mean(distances > _FAR * unit))
    median = float(np.median(distances))
    return TruthDistance(
        limit=_FAR * unit / own,
        share_far=share,
        median_in_edges=median / own,
        median_over_diagonal=median / float(np.linalg.norm(np.ptp(mesh[0], axis=0))),
        same=share <= _MOST_FAR and median <= _MEDIAN * unit,
    )
