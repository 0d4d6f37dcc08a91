"""Roots of modes tables, and what other finite-element codes print of them."""

from __future__ import annotations

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError

REQUIRED_COLUMNS = ("frequency_hz", "growth_rate", "overdamped")
UNITS = {"damped_frequency_hz": "Hz", "stability_hz": "Hz", "effective_damping": ""}


def roots_of(modes: pd.DataFrame) -> np.ndarray:
    """Roots lambda (n,) [rad/s] of a modes table, from abs(lambda) and Re lambda.

    Near critical damping, at a damping ratio of 1 - d, Im lambda has a relative error of 1e-16 / d.

    Raises
    ------
    ResultsError
        A table without the columns of complex modes.
    """
    if missing := [name for name in REQUIRED_COLUMNS if name not in modes]:
        raise ResultsError(
            f"expected a table of complex modes, this one has no column {', '.join(missing)}"
        )
    size, growth = 2 * np.pi * modes["frequency_hz"].to_numpy(), modes["growth_rate"].to_numpy()
    imag = np.sqrt(np.maximum((size - growth) * (size + growth), 0.0))
    roots: np.ndarray = growth + 1j * np.where(modes["overdamped"].to_numpy(bool), 0.0, imag)
    return roots


def other_codes(modes: pd.DataFrame) -> pd.DataFrame:
    """Numbers as other codes print them, row by row: ``modes.join(other_codes(modes))``.

    With lambda = sigma + i omega in rad/s, the frequency of this table being abs(lambda) / 2 pi.

    Parameters
    ----------
    modes : DataFrame
        Table of modes, or some of its rows.

    Returns
    -------
    DataFrame
        With the index of `modes` and units in ``attrs``:

        ``damped_frequency_hz``
            abs(omega) / 2 pi: the frequency of Abaqus and of Nastran, the imaginary part of ANSYS.
            0 of a real root.
        ``stability_hz``
            sigma / 2 pi: the real part of ANSYS, positive where the mode grows.
        ``effective_damping``
            -2 sigma / abs(omega): Abaqus's effective damping and Nastran's coefficient g, negative
            where the mode grows; about twice the damping ratio. NaN of a real root, which has none.

    Raises
    ------
    ResultsError
        A table without the columns of complex modes.

    Examples
    --------
    >>> import squealstudy as sq
    >>> modes = sq.model("hulten", friction=0.5, damping_ratio=0.01).modes()
    >>> sq.other_codes(modes)["effective_damping"].round(3).tolist()
    [-0.357, 0.395]
    """
    lam = roots_of(modes)
    omega = np.abs(lam.imag)
    table = pd.DataFrame(
        {
            "damped_frequency_hz": omega / (2 * np.pi),
            "stability_hz": lam.real / (2 * np.pi),
            "effective_damping": -2 * lam.real / np.where(omega > 0, omega, np.nan),
        },
        index=modes.index,
    )
    table.attrs["units"] = UNITS
    return table
