"""Random families of matrices as studies of complex modes, and their roots by numpy.

M = I, C and K of a few coordinates, a skew coupling that grows with x, and a stiffness that falls
with y: crossings and veerings of frequencies, tongues and islands of flutter, defective points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.sparse as sp

BAND_HZ = (1.0, 400.0)
HZ = 2.0 * np.pi
SORTS = ("coupled", "crossing", "veering", "island", "defective")
TEXT = """\
[study]
name = "modes"
kind = "complex_modes"
[model]
name = "matrices"
folder = "{folder}"
{terms}
[parameters]
x = {x:r}
y = 0.0
{sweeps}
[modes]
band = [{band[0]}, {band[1]}]
reference_points = 0
"""


@dataclass(frozen=True, eq=False)
class Family:
    """M lam^2 + C lam + K0 + coupling(x) S + y D with M = I, and the values of a study.

    Attributes
    ----------
    sort : str
        One of SORTS.
    C, K0, S, D : ndarray (n, n)
    x, y : ndarray
        Values of the sweeps in the order of the file.
    expression : str
        The coupling as a function of x.
    """

    sort: str
    C: np.ndarray
    K0: np.ndarray
    S: np.ndarray
    D: np.ndarray
    x: np.ndarray
    y: np.ndarray
    expression: str

    def coupling(self, x: float) -> float:
        """Value of the expression."""
        return x * (2.0 - x) if self.expression == "x*(2-x)" else x

    def roots(self, x: float, y: float = 0.0) -> np.ndarray:
        """All roots of non-negative imaginary part, rad/s, by LAPACK's QR in numpy."""
        n, s = len(self.C), 1e3
        K = self.K0 + self.coupling(x) * self.S + y * self.D
        A = np.block([[np.zeros((n, n)), s * np.eye(n)], [-K / s, -self.C]])
        lam = np.linalg.eigvals(A)
        return lam[lam.imag >= 0]

    @cached_property
    def places(self) -> list[tuple[float, float]]:
        """The design points in the order of the tables."""
        return [(float(a), float(b)) for b in self.y for a in self.x]

    def text(self, folder: Path) -> str:
        """The study file; its matrices are written into a folder."""
        parts = {"m": ("M", np.eye(len(self.C)), "1"), "c": ("C", self.C, "1")}
        parts |= {"k": ("K", self.K0, "1"), "s": ("K", self.S, self.expression)}
        parts |= {"d": ("K", self.D, "y")}
        terms = ""
        for name, (letter, A, coefficient) in parts.items():
            sp.save_npz(folder / f"{name}.npz", sp.csr_matrix(A))
            terms += f'[[model.term]]\nmatrix = "{letter}"\nfile = "{name}.npz"\n'
            terms += f'coefficient = "{coefficient}"\n'
        sweeps = ""
        for name, values in (("x", self.x), ("y", self.y)):
            if len(values) > 1 or name == "x":
                listed = ", ".join(repr(float(v)) for v in values)
                sweeps += f'[[sweep]]\nparameter = "{name}"\nvalues = [{listed}]\n'
        return TEXT.replace("{x:r}", repr(float(self.x[0]))).format(
            folder=folder.as_posix(), terms=terms, sweeps=sweeps, band=BAND_HZ
        )


def random_family(seed: int, number: int) -> Family:
    """Case `number` of a seed: its sort in turn, all else by chance."""
    rng = np.random.default_rng([seed, number])
    sort = SORTS[number % len(SORTS)]
    n = int(rng.integers(2, 6))
    f = np.sort(rng.uniform(40.0, 350.0, n))
    if sort == "crossing":  # decoupled pairs: one frequency falls through another
        f[1] = f[0] * rng.uniform(1.02, 1.1)
    K0 = np.diag((HZ * f) ** 2)
    skew = np.triu(rng.standard_normal((n, n)), 1)
    level = np.diff(np.sort(np.diag(K0))).mean() if n > 1 else 1e5
    S = level * rng.uniform(0.2, 1.5) * (skew - skew.T)
    even = rng.standard_normal((n, n))
    D = level * 0.3 * (even + even.T)
    C = np.diag(rng.uniform(0.2, 8.0, n))
    if sort == "crossing":
        S[0, :] = S[:, 0] = 0.0
        D[0, :] = D[:, 0] = 0.0
        S[0, 0] = rng.uniform(0.5, 2.0) * (HZ**2) * (f[-1] ** 2 - f[0] ** 2)
    elif sort == "veering":
        K0 = K0 + 0.05 * level * (even + even.T)
    elif sort == "defective":  # equal damping: at the coalescence a true exceptional point
        C = np.eye(n) * rng.uniform(0.2, 4.0)
    count = int(rng.integers(5, 12))
    x = np.unique(np.round(rng.uniform(0.0, 1.6, count), 4))
    if rng.random() < 0.5:
        x = np.linspace(0.0, float(rng.uniform(0.6, 1.6)), count)
    if rng.random() < 0.3:
        x = rng.permutation(x)
    y = np.linspace(-0.5, 0.5, 3) if rng.random() < 0.3 else np.zeros(1)
    expression = "x*(2-x)" if sort == "island" else "x"
    return Family(sort, C, K0, S, D, x, y, expression)
