"""A friction curve from one file outside the package, used through a study file."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command import in_time, run, run_here
from scipy.optimize import brentq

FILE = "my_friction_curve.py"
MU, FADE, FORCE, K3 = 1.9, 5e7, 100.0, 4e6 / 3
AREA = K3 / 5e11
ANGLES = np.deg2rad([150.0, 30.0])
SPRINGS = 2 / 3 * np.array([2 - 3**0.5, 2 + 3**0.5]) * 1e6
ROWS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
K_S = ROWS.T @ (SPRINGS[:, None] * ROWS)
STUDY = f"""
[study]
name = "fading"
kind = "{{kind}}"
extensions = ["{FILE}"]
[model]
name = "hoffmann"
friction_law = "fading"
[parameters]
friction = {MU}
damping_ratio = 0.0
"friction_law.fade_pressure" = {FADE}
[modes]
band = [1.0, 1000.0]
"""


def friction_of(force, mu_d=MU, fade=FADE):
    """mu and mu + p dmu/dp under a contact force [N]: mu_d / (1 + x), mu_d / (1 + x)^2."""
    share = 1 / (1 + force / AREA / fade)
    return mu_d * share, mu_d * share**2


def contact_force(mu_d=MU, fade=FADE):
    """Of steady sliding [N], from the balance K_s q = (-mu F, F - 100 N), -q_2 = F / k_3."""

    def gap_error(F):
        drag = friction_of(F, mu_d, fade)[0] * F
        return np.linalg.solve(K_S, np.array([-drag, F - FORCE]))[1] + F / K3

    return brentq(gap_error, 1e-6, 1e4, xtol=1e-12, rtol=1e-14)


def flutter_root(mu_d=MU, fade=FADE):
    """Root [rad/s] that grows: closing adds (mu + p dmu/dp) k_3 to the force of friction."""
    _, coupling = friction_of(contact_force(mu_d, fade), mu_d, fade)
    K = K_S + K3 * np.array([[0.0, -coupling], [0.0, 1.0]])
    roots = np.sqrt(-np.linalg.eigvals(K).astype(complex))  # of positive real part
    return roots[np.argmax(roots.real)]


def test_modes_are_those_of_the_closed_form(tmp_path):
    tables = run(STUDY.format(kind="complex_modes"), tmp_path, FILE)
    modes, (point,) = tables["modes"], tables["points"].itertuples()
    assert point.contact_pressure_min == point.contact_pressure_max  # one contact point
    assert point.contact_pressure_max == pytest.approx(contact_force() / AREA, rel=1e-9)
    mu, coupling = friction_of(contact_force())
    assert coupling < 0.8 * mu  # the fall with pressure matters
    unstable = modes.loc[modes["growth_rate"].idxmax()]
    root = flutter_root()
    assert root.real > 10
    assert unstable["growth_rate"] == pytest.approx(root.real, rel=1e-8)
    assert unstable["frequency_hz"] == pytest.approx(abs(root) / (2 * np.pi), rel=1e-9)


def test_sensitivities_are_those_of_the_closed_form(tmp_path):
    text = STUDY.format(kind="sensitivity")
    text += '[sensitivity]\nparameters = ["friction", "friction_law.fade_pressure"]\n'
    found = run_here(text, tmp_path)["sensitivities"]
    found = found[found["unstable"]].set_index("parameter")["d_growth_rate"]
    for name, at in (("friction", 0), ("friction_law.fade_pressure", 1)):
        values = np.array([MU, FADE])
        step = 1e-5 * values * (np.arange(2) == at)
        slope = (flutter_root(*(values + step)) - flutter_root(*(values - step))) / (2 * step[at])
        assert found[name] == pytest.approx(slope.real, rel=1e-6)


def test_in_time_it_grows_at_the_rate_of_the_closed_form(tmp_path):
    text = in_time(STUDY.format(kind="transient"), 0.1, 1e-6)
    tables = run_here(text, tmp_path)
    (found,) = tables["growth"].query("unstable").itertuples()
    assert found.growth_rate == pytest.approx(flutter_root().real, rel=1e-8)
    assert found.fitted_growth_rate == pytest.approx(flutter_root().real, rel=0.01)


LIBRARY = f"""
import my_friction_curve, squealstudy as sq
values = {{"friction": {MU}, "friction_law.fade_pressure": {FADE}}}
system = sq.model("hoffmann", friction_law="fading").at(**values)
grown = max(system.modes((1.0, 1000.0)).lam, key=lambda lam: lam.real)
print(repr(complex(grown)), repr(float(system.steady.force[0, 0])))
"""


def test_the_library_knows_a_curve_that_was_imported():
    folder = Path(__file__).parent
    done = subprocess.run(
        [sys.executable, "-c", LIBRARY], cwd=folder, capture_output=True, text=True, check=True
    )
    lam, force = done.stdout.split()
    grown, root = complex(lam), flutter_root()  # one of a conjugate pair
    assert complex(grown.real, abs(root.imag)) == pytest.approx(grown, rel=1e-8)
    assert grown.real == pytest.approx(root.real, rel=1e-8)
    assert float(force) == pytest.approx(contact_force(), rel=1e-9)


def statements(text):
    """Of a module, without docstrings and `from __future__`."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef) and ast.get_docstring(node):
            node.body = node.body[1:]
    return [ast.unparse(node) for node in tree.body if "__future__" not in ast.unparse(node)]


def test_the_page_shows_this_law():
    page = Path(__file__).parents[2] / "docs" / "howto" / "own-law.md"
    (shown,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert statements(shown) == statements(Path(__file__).with_name(FILE).read_text("utf-8"))
