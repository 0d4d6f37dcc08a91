"""Complex modes of a design point, or of a batch, in arrays."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.linalg.companion import all_pairs, all_roots
from squealstudy.linalg.dense_qep import pairs_inside
from squealstudy.mechanics.defaults import MODE_TOLERANCE, STABILITY_TOLERANCE
from squealstudy.modes.judged_roots import (
    damping_ratios,
    settled,
    stability_names,
    uncertain_roots,
)
from squealstudy.root_pairs import least_assignment
from squealstudy.wording import band_text

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
LARGEST_SEARCHED = 100  # coordinates up to which the mode nearest to an empty band is looked for
LEFT_CIRCLE_FACTOR = 1.01  # radius of the circle searched for left vectors, over the largest root


@dataclass(frozen=True, eq=False)
class ComplexModes:
    """Roots of (lam^2 M + lam C + K) x = 0 in a band, with vectors and errors.

    Arrays of a batch have a leading axis (m, ...). Design points may have different numbers of
    modes, which `counts` gives; entries beyond them are NaN.

    Attributes
    ----------
    lam : ndarray (k,) complex
        Roots, rad/s: one of each conjugate pair, ascending in modulus, then real roots.
    right : ndarray (n, k) complex
        Right vectors x, of 2-norm 1, without unit, in the coordinates of `System.linear`.
    residual : ndarray (k,)
        Normwise backward error of each root with its vector, without unit.
    error_rung, error_reduction : ndarray (k,)
        Estimated errors of each root, rad/s: that of solving the working point and eigenproblem,
        and that of the reduction against the unreduced model.
    energies : ndarray (parts, k)
        Share of each part in the elastic energy, 0 to 1, in the order of `parts`.
    counts : int or ndarray (m,)
        Number of modes of each design point; 0 where it failed.
    status, message : str or ndarray (m,) of str
        ``ok``; ``inaccurate`` where `error_rung` of a light or growing root exceeds 1e-4 of its
        modulus; or why there are no modes.
    parts : tuple of str
        Names of the components, then of the interfaces; empty for a family of matrices.
    method : str
        Name of the method that found the roots.
    varied : mapping of str -> ndarray (m,)
        Values of the parameters that vary in a batch, by name.
    linear_of : callable
        Takes the number of a design point, returns its linearised system, for left vectors.

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
        """Whether a mode grows (k,): its damping ratio is below -1e-7.

        A mode that grows by no more than its `error_rung` counts as neutral, unless that error
        exceeds 1e-4 of the root's modulus. `error_reduction` does not count here (`uncertain`).
        """
        with np.errstate(invalid="ignore"):
            judged = settled(self.lam, self.error_rung, MODE_TOLERANCE)
            is_unstable: np.ndarray = damping_ratios(judged) < -STABILITY_TOLERANCE
        return is_unstable

    @property
    def uncertain(self) -> np.ndarray:
        """Whether a mode may be stable or unstable within its `error` (k,); False where NaN."""
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
        """A table with a row for each mode and the columns of a study's modes; units in ``attrs``.

        A batch adds ``point``, the number of the design point from 0, and the values that vary.
        Points that failed have no rows.
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


def warn_of_empty_band(modes: ComplexModes, band_hz: tuple[float, float]) -> None:
    """Warn where a solved design point has no mode in a band [Hz] that nobody chose.

    The warning names the mode that is nearest to the band, where the matrices are small.
    """
    counts, status = np.atleast_1d(modes.counts), np.atleast_1d(modes.status)
    empty = np.flatnonzero((counts == 0) & (status == "ok"))
    if not len(empty):
        return
    assert modes.linear_of is not None
    system = modes.linear_of(int(empty[0]))
    text = f"no mode lies {band_text(band_hz)}, the default band"
    if len(counts) > 1:
        text += f", at {len(empty)} of {len(counts)} design points"
    if len(system.K) <= LARGEST_SEARCHED and np.linalg.matrix_rank(system.M) == len(system.M):
        C, K = np.hsplit(np.linalg.solve(system.M, np.hstack([system.C, system.K])), 2)
        hertz = np.abs(all_roots(C, K)) / (2 * np.pi)
        hertz = hertz[hertz > 0]
        if len(hertz):
            nearest = hertz[np.abs(np.log(hertz / np.clip(hertz, *band_hz))).argmin()]
            text += f"; the nearest has {nearest:g} Hz"
        else:  # of no band
            warnings.warn("no mode has a frequency: all roots are 0", stacklevel=3)
            return
    warnings.warn(f"{text}: modes(band=(low, high)) looks elsewhere", stacklevel=3)


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
    """Index (k,) in `others` of the root that matches each of lam, no root twice."""
    columns: np.ndarray = least_assignment(np.abs(lam[:, None] - others))[1]
    return columns
