"""Stage 5: refinement with the truncated gamma norm (Eq. 6 to 16).

``f(x) = (1 + gamma) x / (gamma + x)`` rises from 0 to almost 1 within a few gamma, so that f summed
over the singular values beyond the first m (Eq. 7, 8) stands in for the rank of Eq. 6. The first m
are taken off by a trace, ``f(Tr(U Omega_D V^T))`` (Eq. 9 to 11), since f is subadditive (Eq. 10).
With a copy W of Omega_D (Eq. 12) the augmented Lagrangian of Eq. 13 falls into two subproblems::

    Omega_D:  min -f(Tr(U Omega_D V^T)) + mu/2 |Omega'_M - Omega_D|^2
                                        + beta/2 |Omega_D - W + Z/beta|^2               (Eq. 14)
    W:        min |W|_gamma + beta/2 |Omega_D - W + Z/beta|^2                           (Eq. 15)
    Z <- Z + beta (Omega_D - W)                                                         (Eq. 16)

The limits of the sums are printed as ``i = 0 .. m`` and ``i = m + 1 .. a - 1``, which leaves out
m + 1 values; the text says that m are left out, and U and V of Eq. 9 have m rows. m it is here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage4b_diffuse import Omega


@dataclass(frozen=True)
class TruncatedGammaNorm(Stage):
    """The paper's refinement; see `Refine` and, for the settings, `refine`."""

    mu: float = 0.01
    beta: float = 0.01
    gamma: float = 0.01
    m: int = 5
    niter: int = 500
    tol: float = 1e-6

    def __call__(self, omega: Omega) -> Omega:
        """Refine all patches as one matrix (3 sp, w), one patch a column."""
        refined = refine(
            global_matrix(omega.values),
            mu=self.mu,
            beta=self.beta,
            gamma=self.gamma,
            m=self.m,
            niter=self.niter,
            tol=self.tol,
        )
        return replace(omega, values=refined.T.reshape(omega.values.shape))


def global_matrix(values: FloatArray) -> FloatArray:
    """Pack patches into the global normal patch group matrix Omega_M (Fig. 7).

    Parameters
    ----------
    values : (w, sp, 3) float64

    Returns
    -------
    (3 sp, w) float64
        One patch a column: x, y, z of its first normal, then of its second, ...
    """
    return values.reshape(len(values), -1).T


def gamma_function(x: FloatArray, gamma: float) -> FloatArray:
    """Evaluate ``f(x) = (1 + gamma) x / (gamma + x)`` for x >= 0 (under Eq. 9)."""
    return (1.0 + gamma) * x / (gamma + x)


def truncated_gamma_norm(singular_values: FloatArray, gamma: float, m: int) -> float:
    """Evaluate the truncated gamma norm, Eq. 7: f summed over all but the m largest values.

    Parameters
    ----------
    singular_values : (a,) float64
        In any order.
    gamma : float
    m : int
        0 gives the full sum, which is the norm in Eq. 8 to 15.
    """
    falling = np.sort(singular_values)[::-1]
    return float(gamma_function(falling[m:], gamma).sum())


def refine(
    omega: FloatArray,
    *,
    mu: float,
    beta: float,
    gamma: float = 0.01,
    m: int = 5,
    niter: int = 500,
    tol: float = 1e-6,
    callback: Callable[[FloatArray], object] | None = None,
) -> FloatArray:
    """Low rank approximation Omega_D of the completed patches Omega'_M.

    The saddle point of Eq. 13 is sought by turns from Omega_D = W = Omega'_M, Z = 0. U and V
    (Eq. 9) are the leading m singular vectors of the current Omega_D; they attain the maximum in
    Eq. 11.

    All iterates keep the singular vectors P, Q of Omega'_M: if Omega_D, W and Z are
    ``P diag(.) Q^T``, so are ``U^T V`` (ones on the leading m), the linear combination that solves
    Eq. 14, the proximal map of Eq. 15 and the sum of Eq. 16. So the iteration runs on diagonals,
    and the one decomposition that is needed is that of the Gram matrix of the short side. The
    square costs no digits that matter: what is kept lies far above ``1e-8 s_max``.

    Parameters
    ----------
    omega : (3 sp, w) float64
        Omega'_M.
    mu : float
        Weight of the data term.
    beta : float
        Weight of the augmented term.
    gamma : float
    m : int
        Leading singular values that the norm leaves out.
    niter : int
        Most iterations.
    tol : float
        Done when neither Omega_D - W nor the step of W exceeds ``tol |Omega'_M|_F``.
    callback : callable, optional
        Called with the singular values of W, (a,) float64, after every iteration.

    Returns
    -------
    (3 sp, w) float64
    """
    if omega.shape[0] > omega.shape[1]:
        wide = refine(
            omega.T, mu=mu, beta=beta, gamma=gamma, m=m, niter=niter, tol=tol, callback=callback
        )
        return wide.T
    squared, P = np.linalg.eigh(omega @ omega.T)
    s = np.sqrt(np.maximum(squared, 0.0))
    d, w, z = s, s, np.zeros_like(s)
    for _ in range(niter):
        d = solve_omega(s, w, z, leading_signs(d, m), mu=mu, beta=beta, gamma=gamma)
        before, w = w, solve_w(d + z / beta, beta=beta, gamma=gamma)
        z = z + beta * (d - w)  # Eq. 16
        if callback is not None:
            callback(w)
        moved = max(np.linalg.norm(d - w), np.linalg.norm(w - before))
        if moved <= tol * np.linalg.norm(s):
            break
    factor = np.divide(d, s, out=np.zeros_like(s), where=s > 0.0)
    return np.asarray((P * factor) @ (P.T @ omega))


def leading_signs(d: FloatArray, m: int) -> FloatArray:
    """Diagonal of ``P^T U^T V Q``: the sign of the m entries of d that are largest in size.

    With it ``Tr(U Omega_D V^T)`` is the sum of the m largest singular values (equality in Eq. 9).
    """
    signs = np.zeros_like(d)
    leading = np.argsort(-np.abs(d), kind="stable")[:m]
    signs[leading] = np.sign(d[leading])
    return signs


def solve_omega(
    s: FloatArray,
    w: FloatArray,
    z: FloatArray,
    signs: FloatArray,
    *,
    mu: float,
    beta: float,
    gamma: float,
) -> FloatArray:
    """Solve the subproblem for Omega_D, Eq. 14, on diagonals.

    Setting the derivative to zero gives, with the trace ``t = <signs, d>``::

        (mu + beta) d = mu s + beta w - z + f'(t) signs,   f'(t) = gamma (1 + gamma) / (gamma + t)^2

    The paper re-weights: f'(t) of the last iterate makes it linear. Only the number t couples the
    entries, so the fixed point of the re-weighting is found directly, as the one root of a rising
    function of t.

    Parameters
    ----------
    s, w, z : (a,) float64
        Diagonals of Omega'_M, W and Z.
    signs : (a,) float64
        From `leading_signs`.
    mu, beta, gamma : float

    Returns
    -------
    (a,) float64
        The diagonal of Omega_D, the exact minimiser of Eq. 14 among those with t >= 0.
    """
    linear = (mu * s + beta * w - z) / (mu + beta)
    reach = float(signs @ signs) / (mu + beta)
    start = float(signs @ linear)

    def slope(t: float) -> float:
        return gamma * (1.0 + gamma) / (gamma + t) ** 2

    def excess(t: float) -> float:
        return t - start - reach * slope(t)

    top = max(start, 0.0) + reach * slope(0.0)
    t = 0.0 if excess(0.0) >= 0.0 else brentq(excess, 0.0, top, xtol=1e-14, rtol=1e-14)
    return linear + (slope(t) / (mu + beta)) * signs


def solve_w(a: FloatArray, *, beta: float, gamma: float) -> FloatArray:
    """Solve the subproblem for W, Eq. 15: the proximal map of the full gamma norm.

    Each singular value x solves ``min f(x) + beta/2 (x - a)^2`` over x >= 0. Stationary points are
    roots of the cubic ``(y - A) y^2 + q`` in ``y = x + gamma``, ``A = a + gamma``,
    ``q = gamma (1 + gamma) / beta``; its largest root is the only local minimum off zero and is
    compared with x = 0.

    Parameters
    ----------
    a : (a,) float64
        Diagonal of ``Omega_D + Z / beta``; a negative entry is a singular value -a.
    beta, gamma : float

    Returns
    -------
    (a,) float64
        The diagonal of W.
    """
    size = np.abs(a)
    A, q = size + gamma, gamma * (1.0 + gamma) / beta
    cosine = np.maximum(1.0 - 13.5 * q / A**3, -1.0)  # below -1: no minimum off zero, 0 will win
    x = np.maximum(A / 3.0 * (1.0 + 2.0 * np.cos(np.arccos(cosine) / 3.0)) - gamma, 0.0)
    gain = 0.5 * beta * (size**2 - (x - size) ** 2) - gamma_function(x, gamma)
    return np.sign(a) * np.where(gain > 0.0, x, 0.0)
