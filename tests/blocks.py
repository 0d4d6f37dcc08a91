"""Two elastic blocks on each other: the brake's structure at 180 degrees of freedom."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.laws import contact_law
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.operating import OperatingPoint

NX, NZ = 5, 6  # nodes of each block along the contact and through its height
OPERATING = OperatingPoint(0.5, 1.0, 0.2, contact_law("exponential", p0=1e5, lam=1e6))


def block(name, seed):
    """A lattice of masses and springs, three directions a node."""
    rng = np.random.default_rng(seed)
    n = NX * NZ
    K = np.zeros((3 * n, 3 * n))
    for i in range(NX):
        for j in range(NZ):
            for a, b in ((1, 0), (0, 1), (1, 1), (1, -1)):
                if i + a < NX and 0 <= j + b < NZ:
                    direction = np.array([a, 0.6 * rng.standard_normal(), b], dtype=float)
                    e = np.zeros(3 * n)
                    k, m = 3 * (i * NZ + j), 3 * ((i + a) * NZ + j + b)
                    e[k : k + 3], e[m : m + 3] = direction, -direction
                    K += 4e7 * np.outer(e, e)
                    K[k : k + 3, k : k + 3] += 1e6 * np.eye(3)
                    K[m : m + 3, m : m + 3] += 1e6 * np.eye(3)
                    K[k : k + 3, m : m + 3] -= 1e6 * np.eye(3)
                    K[m : m + 3, k : k + 3] -= 1e6 * np.eye(3)
    M = np.repeat(0.01 * rng.uniform(0.8, 1.2, n), 3)
    return Component(name, sp.csr_matrix(np.diag(M)), sp.csr_matrix(K))


def blocks():
    """The upper block is pressed on the lower one, both are held by inclined springs."""
    parts = (block("upper", 1), block("lower", 2))
    n, half = 6 * NX * NZ, 3 * NX * NZ
    bottom = 3 * NZ * np.arange(NX)
    top = half + 3 * (NZ * np.arange(NX) + NZ - 1)
    N, T, P = (sp.lil_matrix((NX, n)) for _ in range(3))
    for i in range(NX):
        for rows, axis in ((T, 0), (P, 1), (N, 2)):
            rows[i, bottom[i] + axis], rows[i, top[i] + axis] = 1.0, -1.0
    area = np.full(NX, 1e-4)
    law = OPERATING.law
    one = np.ones(NX)
    contact = ContactInterface(
        N.tocsr(), T.tocsr(), P.tocsr(), area, 0 * one, 0.1 * one, law, one.copy()
    )
    B = sp.lil_matrix((5 * NX, n))
    for i in range(NX):
        high, low = 3 * (NZ * i + NZ - 1), half + 3 * NZ * i
        B[5 * i, high], B[5 * i, high + 2] = 0.6, 0.8
        B[5 * i + 1, high + 1] = 1.0
        B[5 * i + 2, low], B[5 * i + 2, low + 2] = 0.8, 0.6
        B[5 * i + 3, low + 1], B[5 * i + 3, low + 2] = 0.6, 0.8
        B[5 * i + 4, low] = 1.0
    load = np.zeros(n)
    load[3 * (NZ * np.arange(NX) + NZ - 1) + 2] = -20.0
    springs = SpringInterface("supports", B.tocsr(), np.full(5 * NX, 2e6))
    return Assembly(parts, contact, (springs,), load, np.zeros(n))
