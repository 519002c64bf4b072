"""Extend attributes from known vertices into a patch."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, cotangent_laplacian
from meshlab_lowrank.mesh.topology import edges_of

_LEAST_WEIGHT = 1e-3  # an edge opposite obtuse angles has none, and would cut vertices off


def harmonic_extension(
    vertices: FloatArray, faces: IntArray, known: BoolArray, values: FloatArray
) -> FloatArray:
    """Extend values harmonically from known vertices to the others.

    Every edge has a positive weight, so each result lies between the least and the greatest known
    value, and a constant is extended as itself.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        Each vertex that isn't known is used by one, and connected to a known one.
    known : (n,) bool
    values : (n, d) float64
        Rows of vertices that aren't known are not read.

    Returns
    -------
    (n, d) float64
        The rows of known vertices are those given.

    Raises
    ------
    InvalidMeshError
        If vertices are connected to no known one.

    References
    ----------
    Pinkall and Polthier, Computing discrete minimal surfaces and their conjugates, 1993.
    """
    if known.all() or values.shape[1] == 0:
        return values.copy()
    weights = _edge_weights(vertices, faces)
    _check_reached(weights, known)
    degree = np.asarray(weights.sum(axis=1)).ravel()
    laplacian = sparse.csr_array(sparse.diags_array(degree) - weights)
    return minimise_with_fixed(laplacian, known, values)


def _edge_weights(vertices: FloatArray, faces: IntArray) -> sparse.csr_array:
    """Cotangent weights, none of them zero, as a symmetric (n, n) matrix."""
    ends = edges_of(faces).vertices
    shape = (len(vertices), len(vertices))
    least = sparse.coo_array((np.full(len(ends), _LEAST_WEIGHT), ends.T), shape=shape)
    laplacian = cotangent_laplacian(vertices, faces)
    cotangents = sparse.diags_array(laplacian.diagonal()) - laplacian
    return sparse.csr_array(cotangents + least + least.T)


def _check_reached(weights: sparse.csr_array, known: BoolArray) -> None:
    _, component = csgraph.connected_components(weights, directed=False)
    reached = np.isin(component, component[known])
    if not reached.all():
        msg = (
            f"{np.count_nonzero(~reached)} vertices are connected to no known vertex, so there is "
            "nothing to extend to them; leave their faces out."
        )
        raise InvalidMeshError(msg)
