"""An operating parameter from one file outside the package: swept at the operating point."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command import run, run_here

FILE = "my_operating_parameter.py"
MU, K3 = 1.0, 4e6 / 3
TEMPERATURES = np.linspace(20.0, 320.0, 7)
ANGLES = np.deg2rad([150.0, 30.0])
SPRINGS = 2 / 3 * np.array([2 - 3**0.5, 2 + 3**0.5]) * 1e6
ROWS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
K_S = ROWS.T @ (SPRINGS[:, None] * ROWS)
STUDY = f"""
[study]
name = "warm"
kind = "{{kind}}"
extensions = ["{FILE}"]
[model]
name = "hoffmann"
friction_law = "warm"
contact_law = "warm"
[parameters]
friction = {MU}
damping_ratio = 0.0
[modes]
band = [1.0, 1000.0]
"""
SWEEP = """
[[sweep]]
parameter = "temperature"
start = 20.0
stop = 320.0
num = 7
"""


def growing_root(temperature):
    """Root [rad/s] of largest real part: friction fades and the contact softens."""
    mu = MU * (1 - 1e-3 * (temperature - 20))
    k3 = K3 * (1 - 2e-3 * (temperature - 20))
    K = K_S + k3 * np.array([[0.0, -mu], [0.0, 1.0]])
    roots = np.sqrt(-np.linalg.eigvals(K).astype(complex))
    roots = np.concatenate([roots, -roots])
    return max(roots, key=lambda root: (round(root.real, 6), root.imag))


def test_a_sweep_of_it_gives_the_roots_of_the_closed_form_with_one_structure(tmp_path):
    tables = run(STUDY.format(kind="complex_modes") + SWEEP, tmp_path, FILE, jobs=2)
    points = tables["points"].set_index("point_id")
    largest = tables["modes"].groupby("point_id")["growth_rate"].max()
    largest.index = points.loc[largest.index, "temperature"]
    expected = [growing_root(t).real for t in TEMPERATURES]
    assert expected[0] > 50  # flutter when cold
    assert min(expected) < 1e-6  # and none when warm
    np.testing.assert_allclose(largest.sort_index(), expected, rtol=1e-8, atol=1e-6)
    manifest = json.loads((tmp_path / "study" / "manifest.json").read_text())
    assert len(manifest["structures"]) == 1


def test_its_sensitivity_is_that_of_both_laws(tmp_path):
    text = STUDY.format(kind="sensitivity") + '[sensitivity]\nparameters = ["temperature"]\n'
    text = text.replace("damping_ratio = 0.0", "damping_ratio = 0.0\ntemperature = 60.0")
    found = run_here(text, tmp_path)["sensitivities"]
    (slope,) = found.loc[found["unstable"], "d_growth_rate"]
    expected = (growing_root(60.1) - growing_root(59.9)).real / 0.2
    assert slope == pytest.approx(expected, rel=1e-6)
