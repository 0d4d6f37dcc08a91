"""Reduced hunts for false sensitivities and designs of small models; the judge's own pencils."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "studies" / "benchmarks"))

import mode_designs
import mode_slopes
from small_models import HZ, MODELS, random_model


def _wrong(numbers):
    table = pd.DataFrame([vars(t) for t in numbers])
    bad = ~table["right"].astype(bool) & ~table["flagged"]
    return table, table[bad].to_string() if bad.any() else ""


@pytest.mark.parametrize("number", [0, 1])
def test_sensitivities_are_central_differences_of_numpy(number):
    table, wrong = _wrong(mode_slopes.random_numbers(1, number))
    assert not wrong, wrong
    columns = {"d_growth_rate", "d_damping_ratio", "growth_per_percent", "finite_frequency"}
    assert columns <= set(table["column"])


@pytest.mark.full_size  # by default against closed forms: test_design.py
@pytest.mark.parametrize("number", [1, 2])
def test_designs_are_those_of_brute_force(number, monkeypatch):
    monkeypatch.setattr(mode_designs, "GRID", 15)
    table, wrong = _wrong(mode_designs.random_numbers(1, number))
    assert not wrong, wrong
    assert {"designs", "design points", "verdict"} <= set(table["table"])


def test_the_judge_sees_a_wrong_slope(tmp_path: Path) -> None:
    model = random_model(np.random.default_rng(0), "hulten")
    own = model.roots()[0]
    growth, frequency, zeta = mode_slopes.figures(own)
    row = {"parameter": "mass", "change": 0.01 * model.given["mass"], "near_coalescence": False}
    row |= {"value": model.given["mass"], "growth_per_percent": 0.0, "validity_range": 1.0}
    row |= {"growth_rate": growth, "frequency_hz": frequency, "damping_ratio": zeta}
    row |= dict.fromkeys(("d_growth_rate", "d_frequency_hz", "d_damping_ratio"), 1.0)
    row |= {f"finite_{n}_change": 0.1 for n in ("growth", "frequency", "damping")}
    told = list(mode_slopes._row_numbers(model, row))
    assert [t.right for t in told if t.column == "root"] == [True]
    assert not any(t.right for t in told if t.column.startswith(("d_", "finite_")))


@pytest.mark.parametrize("name", MODELS)
def test_pencils_of_the_judge_have_the_lock_in_of_their_closed_form(name):
    """Hulten: |w1^2 - w2^2| / (2 w1 w2); Hoffmann with the published springs: 0.75."""
    model = random_model(np.random.default_rng(3), name)
    values = dict(model.given, damping_ratio=0.0, stiffness_damping=0.0)
    values["friction_law.static_ratio"] = 1.0
    lock_in = 0.75
    if name == "hulten":
        w1, w2 = HZ * values["frequency_1"], HZ * values["frequency_2"]
        lock_in = abs(w1**2 - w2**2) / (2.0 * w1 * w2)
    else:
        springs = {"k1": 2 / 3 * (2 - 3**0.5) * 1e6, "k2": 2 / 3 * (2 + 3**0.5) * 1e6}
        values |= {**springs, "contact_stiffness": 4 / 3 * 1e6, "alpha1": 150.0, "alpha2": 30.0}
    below, above = (model.roots(**{**values, "friction": f * lock_in}) for f in (0.999, 1.001))
    assert np.abs(below.real).max() < 1e-8 * np.abs(below).max()
    assert above.real.max() > 1e-4 * np.abs(above).max()
