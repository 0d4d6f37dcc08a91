"""Elements by the names of Abaqus and CalculiX: shape, integration points, strains."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Literal

import numpy as np

from squealstudy.models.element_shapes import SHAPES, Shape

MassRule = Literal["full", "as_stiffness", "lumped"]
Strains = Literal["plain", "mean_dilatation", "incompatible"]


@dataclass(frozen=True)
class Rule:
    """Integration points (q, 3) in reference coordinates, and their weights (q,)."""

    points: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True)
class Formulation:
    """An element formulation.

    Attributes
    ----------
    name : str
        As in keyword files; ``C3D8_BBAR`` is what Abaqus calls C3D8.
    shape : Shape
    stiffness, mass : str
        Names of rules of `integration`, for the stiffness and for the full mass. CalculiX
        integrates the mass at the points of the stiffness: `MassRule` "as_stiffness".
    strains : str
        plain; mean_dilatation: the change of volume is the element's mean (B-bar; Hughes 1980);
        incompatible: nine inner displacements, condensed (Taylor, Beresford, Wilson 1976).
    verified : str
        What CalculiX 2.20 confirms to 1e-10 (test_component_judge.py); else "published".
    """

    name: str
    shape: Shape
    stiffness: str
    mass: str
    strains: Strains = "plain"
    verified: str = "K and M by CalculiX"

    def mass_rule(self, rule: MassRule) -> Rule:
        """Integration rule of the consistent mass matrix."""
        return integration(self.stiffness if rule == "as_stiffness" else self.mass)

    @property
    def condensed(self) -> bool:
        """Whether inner displacements are condensed.

        The stiffness is then not linear in the single moduli, only in a factor on all of them.
        """
        return self.strains == "incompatible"


def _line(n: int) -> tuple[np.ndarray, np.ndarray]:
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2


@cache
def integration(name: str) -> Rule:
    """Integration rule of a name.

    hex2 has 2 x 2 x 2 Gauss points, tet4 has four points, wedge3x2 has three in each triangle and
    two along the axis, pyramid2 has the 2 x 2 x 2 points of a brick with a top shrunk to a point.
    """
    from skfem import refdom
    from skfem.quadrature import get_quadrature

    kind = next(k for k in ("tet", "pyramid", "wedge", "hex") if name.startswith(k))
    size = name.removeprefix(kind)
    if kind == "hex":
        x, w = _line(int(size))
        points = np.array(list(product(x, repeat=3)))
        return Rule(points, np.array([np.prod(c) for c in product(w, repeat=3)]))
    if kind == "tet":
        X, W = get_quadrature(refdom.RefTet, {1: 1, 4: 2, 14: 5}[int(size)])
        return Rule(X.T, W)
    if kind == "pyramid":
        from scipy.special import roots_jacobi

        x, w = _line(int(size))
        h, v = roots_jacobi(int(size), 2, 0)  # of the weight (1 - z)^2
        z, v = (1 + h) / 2, v / 8
        points = np.array([[a * (1 - c), b * (1 - c), c] for a, b, c in product(x, x, z)])
        return Rule(points, np.array([np.prod(c) for c in product(w, w, v)]))
    across, along = (int(n) for n in size.split("x"))
    if across == 1:
        X, W = np.full((2, 1), 1 / 3), np.array([0.5])
    else:
        X, W = get_quadrature(refdom.RefTri, {3: 2, 6: 4}[across])
    z, w = _line(along)
    points = np.array([[*xy, h] for h in z for xy in X.T])
    return Rule(points, np.array([a * b for b in w for a in W]))


COLLAPSED = "K of parallelograms as base, by a collapsed C3D8 of CalculiX; else published"
FORMULATIONS = {
    f.name: f
    for f in (
        Formulation("C3D4", SHAPES["tet4"], "tet1", "tet4"),
        Formulation("C3D10", SHAPES["tet10"], "tet4", "tet14"),
        Formulation("C3D5", SHAPES["pyramid5"], "pyramid2", "pyramid2", verified=COLLAPSED),
        Formulation("C3D13", SHAPES["pyramid13"], "pyramid3", "pyramid3", verified="published"),
        Formulation("C3D6", SHAPES["wedge6"], "wedge1x2", "wedge3x2"),
        Formulation("C3D15", SHAPES["wedge15"], "wedge3x3", "wedge6x3"),
        Formulation("C3D8", SHAPES["hex8"], "hex2", "hex2"),
        Formulation(
            "C3D8_BBAR", SHAPES["hex8"], "hex2", "hex2", "mean_dilatation", "M; K published"
        ),
        Formulation(
            "C3D8I",
            SHAPES["hex8"],
            "hex2",
            "hex2",
            "incompatible",
            "parallelepipeds; else published",
        ),
        Formulation("C3D20", SHAPES["hex20"], "hex3", "hex3"),
        Formulation("C3D20R", SHAPES["hex20"], "hex2", "hex3"),
    )
}
