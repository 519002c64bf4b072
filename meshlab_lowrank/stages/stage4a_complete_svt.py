"""Stage 4, completion: singular value thresholding of each group (Eq. 3 to 5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage3_similar import Groups
from meshlab_lowrank.stages.stage4a_complete import Completed


@dataclass(frozen=True)
class SingularValueThresholding(Stage):
    """The paper's completion of Omega_p, the target its first column (Fig. 8); see `Complete`.

    Parameters
    ----------
    tau, delta : float
        Threshold and step (section 3.4.1).
    niter : int
    tol : float
        See `svt_complete`.
    """

    tau: float = 0.9
    delta: float = 0.1
    niter: int = 500
    tol: float = 1e-4

    def __call__(self, values: FloatArray, weights: FloatArray, groups: Groups) -> Completed:
        """Complete the targets that miss something; what is known stays (Eq. 4)."""
        result = values.copy()
        partly = np.flatnonzero((weights == 0.0).any(axis=1))
        seen = weights[partly, None] > 0.0  # (p, 1, sp)
        others = np.ones_like(seen) if groups.observed is None else groups.observed[partly]
        others = np.broadcast_to(others, (len(partly), groups.columns.shape[1], seen.shape[2]))
        observed = np.repeat(np.concatenate([seen, others], axis=1), 3, axis=2)
        targets = values[partly].reshape(len(partly), 1, 3 * seen.shape[2])
        packed = np.concatenate([targets, groups.columns[partly]], axis=1)  # (p, k + 1, 3 sp)
        whole = svt_complete(
            packed.transpose(0, 2, 1),
            observed.transpose(0, 2, 1),
            tau=self.tau,
            delta=self.delta,
            niter=self.niter,
            tol=self.tol,
        )
        column = whole[:, :, 0].reshape(len(partly), seen.shape[2], 3)
        result[partly] = np.where(seen[:, 0, :, None], values[partly], column)
        return Completed(result, np.zeros(len(values)))


def shrink(Y: FloatArray, tau: float) -> FloatArray:
    """Soft-threshold the singular values: the proximal operator of ``tau * nuclear norm``.

    ``D_tau(s) = max(0, s - tau)`` on every singular value s (section 3.4.1).

    Parameters
    ----------
    Y : (..., a, b) float64
        One matrix or a stack of matrices.
    tau : float

    Returns
    -------
    (..., a, b) float64

    Notes
    -----
    With ``Y^T Y = V S^2 V^T`` of the smaller side, ``shrink(Y) = Y V diag(D_tau(s) / s) V^T``.
    Squaring costs no digits that matter: only values above tau survive, and their error is about
    ``1e-16 * s_max^2 / tau``.
    """
    if Y.shape[-2] < Y.shape[-1]:
        return shrink(Y.swapaxes(-1, -2), tau).swapaxes(-1, -2)
    squared, V = np.linalg.eigh(Y.swapaxes(-1, -2) @ Y)
    s = np.sqrt(np.maximum(squared, 0.0))
    factor = np.divide(s - tau, s, out=np.zeros_like(s), where=s > tau)
    return np.asarray(Y @ ((V * factor[..., None, :]) @ V.swapaxes(-1, -2)))


def svt_complete(
    groups: FloatArray,
    observed: BoolArray,
    *,
    tau: float = 0.9,
    delta: float = 0.1,
    niter: int = 500,
    tol: float = 1e-4,
    callback: Callable[[FloatArray], object] | None = None,
) -> FloatArray:
    """Complete a stack of matrices by singular value thresholding.

    Solves ``min |X|_*  s.t.  P(X) = P(Omega)`` (Eq. 4, the convex stand-in for the rank in Eq. 3)
    by, from Y = 0::

        X^t = shrink(Y^(t-1), tau)
        Y^t = Y^(t-1) + delta P(Omega - X^t)                                            (Eq. 5)

    Eq. 5 is printed with ``P(Y - X)``, which never leaves Y = 0; ``P(Omega - X)`` is the iteration
    of Cai, Candes and Shen that the paper cites. Its limit minimises
    ``tau |X|_* + |X|_F^2 / 2`` under the constraint: small tau pulls unobserved entries to zero.

    Parameters
    ----------
    groups : (t, a, b) float64
        Matrices Omega; entries that are not observed are never read.
    observed : (t, a, b) bool
        Entries that the sampling operator P keeps.
    tau : float
        Threshold on the singular values.
    delta : float
        Step; the iteration converges for 0 < delta < 2.
    niter : int
        Most iterations.
    tol : float
        A matrix is done when ``|P(Omega - X)|_F <= tol |P(Omega)|_F``.
    callback : callable, optional
        Called with the residual of each matrix, (t,) float64, after every iteration.

    Returns
    -------
    (t, a, b) float64
        X, on observed entries too.

    References
    ----------
    Cai, Candes and Shen, A singular value thresholding algorithm for matrix completion, 2010.
    """
    known = np.where(observed, groups, 0.0)
    scale = np.linalg.norm(known, axis=(1, 2))
    residual = scale.copy()
    X, Y = np.zeros_like(known), np.zeros_like(known)
    active = np.flatnonzero(scale > 0.0)
    for _ in range(niter):
        if len(active) == 0:
            break
        X[active] = shrink(Y[active], tau)
        step = np.where(observed[active], known[active] - X[active], 0.0)
        Y[active] += delta * step
        residual[active] = np.linalg.norm(step, axis=(1, 2))
        if callback is not None:
            callback(residual)
        active = active[residual[active] > tol * scale[active]]
    return X
