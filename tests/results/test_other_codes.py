"""Figures of other codes: by their definitions, of roots of every kind."""

import numpy as np
import pandas as pd
import pytest

import squealstudy
from squealstudy.errors import ResultsError
from squealstudy.tables.other_codes import roots_of

LAM = np.array([-3 + 4j, 50 + 2e4j, 0 + 1e4j, -1e4 + 1e3j, -700 + 0j, 20 + 0j])


def table(lam):
    """Columns of a modes table, with an index that is not 0, 1, ..."""
    size = np.abs(lam)
    columns = {
        "frequency_hz": size / (2 * np.pi),
        "growth_rate": lam.real,
        "damping_ratio": -lam.real / size,
        "overdamped": lam.imag == 0,
    }
    return pd.DataFrame(columns, index=10 + np.arange(len(lam)))


def test_roots_come_back():
    assert roots_of(table(LAM)) == pytest.approx(LAM, rel=1e-12)


def test_figures_are_those_of_their_definitions():
    modes = table(LAM)
    found = squealstudy.other_codes(modes)
    assert found.index.equals(modes.index)
    assert found["damped_frequency_hz"].to_numpy() == pytest.approx(
        np.abs(LAM.imag) / (2 * np.pi), rel=1e-12
    )
    assert found["stability_hz"].to_numpy() * 2 * np.pi == pytest.approx(LAM.real, rel=1e-15)
    # a sine that grows by exp(sigma t): its logarithmic decrement is pi g
    assert found["effective_damping"].iloc[0] == pytest.approx(1.5, rel=1e-12)
    assert found["effective_damping"].iloc[1] == pytest.approx(-0.005, rel=1e-12)
    assert found["effective_damping"].iloc[2] == 0
    zeta = modes["damping_ratio"].iloc[:4]
    assert found["effective_damping"].iloc[:4].to_numpy() == pytest.approx(
        (2 * zeta / np.sqrt(1 - zeta**2)).to_numpy(), rel=1e-9
    )


def test_real_roots_do_not_oscillate():
    found = squealstudy.other_codes(table(LAM)).iloc[4:]
    assert (found["damped_frequency_hz"] == 0).all()
    assert found["effective_damping"].isna().all()
    assert (found["stability_hz"] * [-1, 1] > 0).all()


def test_round_off_makes_no_oscillation_of_a_real_root():
    modes = table(LAM[4:])
    modes["frequency_hz"] *= 1 + 1e-15
    assert (squealstudy.other_codes(modes)["damped_frequency_hz"] == 0).all()


def test_units_and_other_tables():
    modes = table(LAM)
    assert squealstudy.other_codes(modes).attrs["units"]["stability_hz"] == "Hz"
    assert squealstudy.other_codes(modes.iloc[:0]).empty
    with pytest.raises(ResultsError, match="no column growth_rate, overdamped"):
        squealstudy.other_codes(modes[["frequency_hz"]])
