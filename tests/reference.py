"""Slow readable twins: the same physics written plainly, without the package's own arithmetic."""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.optimize import brentq
from scipy.special import ive, ivp, jv, jvp, kve, kvp, yv, yvp


# -- contact laws ------------------------------------------------------------------------------
def contact_pressure(kind, a, b, g):
    """p(g) of one point (THEORY.md eq. (4), (5))."""
    if kind == "exponential":
        return a * math.exp(-b * g)
    if kind == "bilateral":
        return -a * g
    if kind == "cubic":
        return -a * g - b * g**3
    depth = max(-g, 0.0)
    return a * depth if kind == "unilateral" else a * depth**b


def contact_tangent(kind, a, b, g):
    """-dp/dg of one point."""
    if kind == "exponential":
        return a * b * math.exp(-b * g)
    if kind == "bilateral":
        return a
    if kind == "cubic":
        return a + 3 * b * g * g
    if g >= 0:
        return 0.0
    return a if kind == "unilateral" else a * b * (-g) ** (b - 1)


# -- full-order equations: THEORY.md eq. (17), (19) ---------------------------------------------
def static_stiffness(assembly):
    """K of the static problem: components and the springs that are there at rest."""
    K = assembly.K_el.copy()
    for spring in assembly.springs:
        if spring.in_static:
            K = K + spring.B.T @ sp.diags(spring.stiffness) @ spring.B
    return K.tocsr()


def static_imbalance(assembly, q, p, operating):
    """K q - f - N^T A p + T^T mu A p: zero at steady sliding."""
    c = assembly.contact
    f = operating.brake_pressure * assembly.load + assembly.constant_load
    force = c.area * p
    friction = operating.friction * c.frictional * force
    return static_stiffness(assembly) @ q - f - c.N.T @ force + c.T.T @ friction


def newton_equilibrium(assembly, operating, q, tolerance=1e-10, max_iterations=30):
    """Full-order Newton in the displacements from q, steps limited in the gaps. Returns q, p."""
    c, law = assembly.contact, operating.law
    K = static_stiffness(assembly)
    mu = operating.friction * c.frictional
    a, b = law.parameters  # an exponential law
    f = operating.brake_pressure * assembly.load + assembly.constant_load
    for _ in range(max_iterations):
        g = c.gap0 + c.N @ q
        p = np.array([contact_pressure(law.kind, a, b, x) for x in g])
        k_n = c.area * np.array([contact_tangent(law.kind, a, b, x) for x in g])
        F = K @ q - f - c.N.T @ (c.area * p) + c.T.T @ (mu * c.area * p)
        if np.abs(F).max() < tolerance * np.abs(f).max():
            return q, p
        J = K + c.N.T @ sp.diags(k_n) @ c.N - c.T.T @ sp.diags(mu * k_n) @ c.N
        step = spla.spsolve(J.tocsc(), -F)
        q = q + step * min(1.0, 3.0 / (b * np.abs(c.N @ step).max()))
    raise AssertionError("the reference Newton did not converge")


def linearised(assembly, p, k_n, operating):
    """M, C, K about a sliding state with pressures p [Pa] and contact stiffnesses k_n [N/m]."""
    c = assembly.contact
    mu = operating.friction * c.frictional
    K = assembly.K_el.copy()
    for spring in assembly.springs:
        K = K + spring.B.T @ sp.diags(spring.stiffness) @ spring.B
    K = K + c.N.T @ sp.diags(k_n) @ c.N - c.T.T @ sp.diags(mu * k_n) @ c.N
    damper = mu * c.area * p / operating.sliding_speed
    return assembly.M, (c.T_perp.T @ sp.diags(damper) @ c.T_perp).tocsr(), K.tocsr()


def quadratic_roots(M, C, K):
    """All 2n roots of lambda^2 M + lambda C + K, dense, by the first companion pencil."""
    n = len(M)
    eye, zero = np.eye(n), np.zeros((n, n))
    return la.eig(
        np.block([[zero, eye], [-K, -C]]), np.block([[eye, zero], [zero, M]]), right=False
    )


def residuals(M, C, K, lam, psi):
    """|Q(lambda) psi| / |K psi| of each pair."""
    R = M @ (psi * lam**2) + C @ (psi * lam) + K @ psi
    return np.linalg.norm(R, axis=0) / np.linalg.norm(K @ psi, axis=0)


# -- closed forms ------------------------------------------------------------------------------
def hulten_flutter(w1, w2):
    """Friction at flutter and merged frequency of Hulten's model."""
    return abs(w1**2 - w2**2) / (2 * w1 * w2), math.sqrt((w1**2 + w2**2) / 2)


W1, W2 = 2 * np.pi * 100.0, 2 * np.pi * 75.0  # rad/s, of the catalogue
MU_C = hulten_flutter(W1, W2)[0]


def hulten_stiffness(mu, w1=W1, w2=W2):
    """K of Hulten's model, whose mass is one."""
    return np.array([[w1**2, -mu * w2**2], [mu * w1**2, w2**2]])


def oscillating_modes(C, K):
    """Roots of lam^2 + lam C + K above the real axis and unit shapes, ascending in |lambda|."""
    n = len(K)
    lam, z = np.linalg.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]]))
    kept = np.flatnonzero(lam.imag > 0)
    kept = kept[np.argsort(np.abs(lam[kept]))]
    shapes = z[:n, kept].T
    return lam[kept], shapes / np.linalg.norm(shapes, axis=1, keepdims=True)


def free_beam_frequency(mode, E, inertia, rho_A, length):
    """Bending of a slender free-free beam (Euler-Bernoulli), Hz; mode from 1."""
    guess = (mode + 0.5) * math.pi
    beta = brentq(lambda x: math.cos(x) - 1 / math.cosh(x), guess - 0.2, guess + 0.2, xtol=1e-14)
    return (beta / length) ** 2 * math.sqrt(E * inertia / rho_A) / (2 * math.pi)


def thin_ring_frequency(n, E, inertia, rho_A, radius):
    """In-plane inextensional bending with n waves around, Hz."""
    factor = n**2 * (n**2 - 1) ** 2 / (n**2 + 1)
    return math.sqrt(factor * E * inertia / (rho_A * radius**4)) / (2 * math.pi)


def _free_edge_rows(n, nu, k, r):
    """Bending moment and Kirchhoff shear of J, Y, I, K at radius r (Leissa, NASA SP-160)."""
    x = k * r
    values = [jv(n, x), yv(n, x), ive(n, x) * math.exp(x), kve(n, x) * math.exp(-x)]
    slopes = [k * d(n, x) for d in (jvp, yvp, ivp, kvp)]
    rows = np.empty((2, 4))
    for i, (R, dR, sign) in enumerate(zip(values, slopes, (-1, -1, 1, 1), strict=True)):
        laplacian, d_laplacian = sign * k**2 * R, sign * k**2 * dR
        d2R = laplacian - dR / r + n**2 * R / r**2
        rows[0, i] = d2R + nu * (dR / r - n**2 * R / r**2)
        rows[1, i] = d_laplacian - (1 - nu) * n**2 / r**2 * (dR - R / r)
    return rows


def free_annulus_parameter(n, circle, nu, ratio):
    """lambda^2 = omega a^2 sqrt(rho h / D) of a thin free annulus, inner/outer radius `ratio`.

    n nodal diameters; `circle`-th root (0 the lowest) of the characteristic determinant.
    """

    def determinant(k):
        A = np.vstack([_free_edge_rows(n, nu, k, 1.0), _free_edge_rows(n, nu, k, ratio)])
        return la.det(A / np.linalg.norm(A, axis=0))

    ks = np.linspace(0.5, 12.0, 1200)
    d = [determinant(k) for k in ks]
    roots = [
        brentq(determinant, ks[i], ks[i + 1], xtol=1e-13)
        for i in range(len(ks) - 1)
        if d[i] * d[i + 1] < 0
    ]
    return roots[circle] ** 2
