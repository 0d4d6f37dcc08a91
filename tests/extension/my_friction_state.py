"""Friction with a state, in complex modes: a bristle is a coordinate without mass.

LuGre's law (Canudas de Wit et al. 1995, doi 10.1109/9.376053) of a mass on a belt, with
w = speed - x':

    m x'' + c x' + k x = force (sigma_0 z + sigma_1 z'),    z' = w - sigma_0 |w| z / g(w)

About steady sliding, z = g / sigma_0, deviations of z obey

    z' + (speed g' / g) x' + (sigma_0 speed / g) z = 0.

It is used in a program, `bristle().sweep(speed=[0.05, 0.1])`; no study names it.
"""

from __future__ import annotations

import numpy as np

import squealstudy as sq
from squealstudy.mechanics.model import Model

G = "(0.4 + 0.2 * exp(-speed / 0.5))"  # friction over speed
SLOPE = "(-0.4 * exp(-speed / 0.5))"  # dG/dspeed, s/m

X_BY_Z, Z_BY_X, Z_BY_Z = (np.eye(2)[[i]].T @ np.eye(2)[[j]] for i, j in ((0, 1), (1, 0), (1, 1)))
MASS, DAMPING, STIFFNESS = 1.0, 5.0, 1e6  # kg, N s/m, N/m


def bristle() -> Model:
    """The model over its parameters speed [m/s], force [N], sigma_0 [1/m] and sigma_1 [s/m]."""
    return sq.matrices(
        np.diag([MASS, 0.0]),
        {
            "1": np.diag([STIFFNESS, 0.0]),
            "force * sigma_0": -X_BY_Z,
            f"sigma_0 * speed / {G}": Z_BY_Z,
        },
        C={
            "1": np.diag([DAMPING, 1.0]),
            "force * sigma_1": -X_BY_Z,
            f"speed * {SLOPE} / {G}": Z_BY_X,
        },
        speed=0.1,
        force=500.0,
        sigma_0=1e4,
        sigma_1=0.0,
    )
