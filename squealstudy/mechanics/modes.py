"""Complex modes of a design point, or of a batch, in arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.linalg.companion import all_pairs
from squealstudy.linalg.dense_qep import pairs_inside
from squealstudy.mechanics.defaults import MODE_TOLERANCE, STABILITY_TOLERANCE
from squealstudy.modes.judged_roots import (
    damping_ratios,
    settled,
    stability_names,
    uncertain_roots,
)
from squealstudy.root_pairs import least_assignment

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.mechanics.linear import LinearSystem

UNITS = {
    "point": "",
    "mode": "",
    "frequency_hz": "Hz",
    "growth_rate": "1/s",
    "damping_ratio": "",
    "residual": "",
    "error_rung": "1/s",
    "error_reduction": "1/s",
    "error_estimate": "1/s",
}
OWN_COLUMNS = {*UNITS, "unstable", "stability", "overdamped", "method"}  # columns
LEFT_CIRCLE_FACTOR = 1.01  # of the largest root: the circle in which left vectors are looked for


@dataclass(frozen=True, eq=False)
class ComplexModes:
    """Roots of (lam^2 M + lam C + K) x = 0 in a band, oscillating ones first, with errors.

    Arrays of a batch have a leading axis (m, ...); design points have different numbers of modes,
    and what a row has not is NaN: `counts` tells.

    Attributes
    ----------
    lam : ndarray (k,) complex
        rad/s; one of each conjugate pair, ascending in modulus, then real roots.
    right : ndarray (n, k) complex
        Right vectors x, of 2-norm 1 without unit, in the coordinates of `System.linear`.
    residual : ndarray (k,)
        Normwise backward error of each pair.
    error_rung, error_reduction : ndarray (k,)
        Estimated errors of the eigenproblem with its working point, and of the reduction against
        the unreduced model, rad/s.
    energies : ndarray (parts, k)
        Shares of elastic energy, in the order of `parts`.
    counts : int or ndarray (m,)
        Modes of each design point; 0 where it failed.
    status, message : str or ndarray (m,) of str
        ``ok``; ``inaccurate`` where a light or growing root may be wrong by more than 1e-4; or
        why there are none.
    parts : tuple of str
        Components, then interfaces; empty of a family of matrices.
    method : str
        How roots were found.
    varied : mapping of str -> ndarray (m,)
        Values of what varies in a batch.
    linear_of : callable
        Number of a design point -> its linearised system, for left vectors.

    Examples
    --------
    >>> import numpy as np, squealstudy as sq
    >>> modes = sq.model("hulten", friction=0.5).at().modes()
    >>> modes.counts, modes.right.shape
    (2, (2, 2))
    >>> batch = sq.model("hulten").at(friction=np.linspace(0.0, 0.6, 4)).modes()
    >>> batch.lam.shape, batch.unstable.any(axis=1).tolist()
    ((4, 2), [False, False, True, True])
    """

    lam: np.ndarray
    right: np.ndarray
    residual: np.ndarray
    error_rung: np.ndarray
    error_reduction: np.ndarray
    energies: np.ndarray
    counts: int | np.ndarray
    status: str | np.ndarray
    message: str | np.ndarray
    parts: tuple[str, ...]
    method: str
    varied: Mapping[str, np.ndarray] = field(default_factory=dict)
    linear_of: Callable[[int], LinearSystem] | None = field(default=None, repr=False)

    @property
    def error(self) -> np.ndarray:
        """Estimated abs(lam - lam of the unreduced model) (k,), rad/s."""
        return self.error_rung + self.error_reduction

    @property
    def frequency_hz(self) -> np.ndarray:
        """abs(lam) / 2 pi (k,), Hz."""
        hertz: np.ndarray = np.abs(self.lam) / (2 * np.pi)
        return hertz

    @property
    def growth_rate(self) -> np.ndarray:
        """Re lam (k,), 1/s."""
        growth: np.ndarray = self.lam.real
        return growth

    @property
    def damping_ratio(self) -> np.ndarray:
        """-Re lam / abs(lam) (k,), without unit: a ratio."""
        return damping_ratios(self.lam)

    @property
    def overdamped(self) -> np.ndarray:
        """Whether a root is real (k,)."""
        is_real: np.ndarray = self.lam.imag == 0
        return is_real

    @property
    def unstable(self) -> np.ndarray:
        """Whether a mode grows by more than its error (k,), its damping ratio below -1e-7."""
        with np.errstate(invalid="ignore"):
            judged = settled(self.lam, self.error_rung, MODE_TOLERANCE)
            is_unstable: np.ndarray = damping_ratios(judged) < -STABILITY_TOLERANCE
        return is_unstable

    @property
    def uncertain(self) -> np.ndarray:
        """Whether a mode may be stable or unstable within its error (k,); False where none is."""
        is_solved = ~np.isnan(self.lam.real)
        return is_solved & uncertain_roots(self.lam, self.error, STABILITY_TOLERANCE)

    @cached_property
    def left(self) -> np.ndarray:
        """Left vectors y (n, k), y^H Q(lam) = 0, scaled so that y^H (2 lam M + C) x = 1.

        With these d lam / dp = -y^H (lam^2 M_p + lam C_p + K_p) x. Their unit is that of 1/lam [s].
        """
        assert self.linear_of is not None
        if not isinstance(self.counts, np.ndarray):
            return left_vectors(self.linear_of(0), self.lam, self.right)
        left_modes = np.full_like(self.right, np.nan)
        for number, count in enumerate(self.counts):
            if count:
                lam, right = self.lam[number, :count], self.right[number, :, :count]
                left_modes[number, :, :count] = left_vectors(self.linear_of(number), lam, right)
        return left_modes

    def to_pandas(self) -> pd.DataFrame:
        """A row a mode, columns as those of the modes table of a study, units in ``attrs``.

        Of a batch with ``point``, the number of the design point from 0, and what varies in it;
        points that failed have no rows.
        """
        import pandas as pd

        counts = np.atleast_1d(self.counts)
        is_mode = np.arange(self.lam.shape[-1]) < counts[:, None]

        def flat(array: np.ndarray) -> np.ndarray:
            """Values of the modes there are, one after the other."""
            values_of_modes: np.ndarray = np.atleast_2d(array)[is_mode]
            return values_of_modes

        point = np.repeat(np.arange(len(counts)), counts)
        table: dict[str, Any] = {}
        if isinstance(self.counts, np.ndarray):
            table["point"] = point
            table |= {name: x[point] for name, x in self.varied.items() if name not in OWN_COLUMNS}
        table["mode"] = (np.nonzero(is_mode)[1] + 1).astype(np.int32)
        unstable, uncertain = flat(self.unstable), flat(self.uncertain)
        table |= {
            "frequency_hz": flat(self.frequency_hz),
            "growth_rate": flat(self.growth_rate),
            "damping_ratio": flat(self.damping_ratio),
            "unstable": unstable,
            "stability": stability_names(unstable, uncertain),
            "overdamped": flat(self.overdamped),
            "residual": flat(self.residual),
            "error_rung": flat(self.error_rung),
            "error_reduction": flat(self.error_reduction),
            "error_estimate": flat(self.error),
            "method": self.method,
        }
        for number, part in enumerate(self.parts):
            table[f"energy_{part}"] = flat(self.energies[..., number, :])
        frame = pd.DataFrame(table)
        shares = {f"energy_{part}": "" for part in self.parts}
        units = UNITS | shares
        frame.attrs["units"] = {name: units[name] for name in table if name in units}
        return frame


def left_vectors(system: LinearSystem, lam: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Left vectors (n, k) of roots lam (k,) with right vectors (n, k), biorthonormal to these.

    y_i^H (M (lam_i + lam_j) + C) x_j is 1 for i = j and vanishes otherwise (THEORY.md eq. (33)).
    """
    if not len(lam):
        return np.zeros_like(right)
    M, C, K = system.M, system.C, system.K
    unit = np.array_equal(M, np.eye(len(M)))
    if not unit:
        C, K = np.hsplit(np.linalg.solve(M, np.hstack([C, K])), 2)
    pairs = pairs_inside(C, K, LEFT_CIRCLE_FACTOR * float(np.abs(lam).max()))
    if len(pairs.lam) < len(lam):
        pairs = all_pairs(C, K)
    partners = _partners(lam, pairs.lam)
    Y = pairs.Y[:, partners]
    G = (Y.conj().T @ right) * (lam[:, None] + lam) + Y.conj().T @ (C @ right)
    biorthonormal = np.linalg.solve(G, Y.conj().T).conj().T
    return biorthonormal if unit else np.linalg.solve(M.T, biorthonormal)


def _partners(lam: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Index (k,) of the root that is each of lam, no root twice."""
    columns: np.ndarray = least_assignment(np.abs(lam[:, None] - others))[1]
    return columns
