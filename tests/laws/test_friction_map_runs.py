"""Friction by points over speed and pressure in time: against roots, and integrated apart."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from spring_reference import Block
from test_friction_map import PRESSURES, SLOW, judge, pair, values
from test_lumped_springs import BAND, BLOCK

import squealstudy as sq

SLIPS = np.linspace(0.0, 2.4, 241)  # m/s
# the map at 100 N, smooth for an integrator of high order: it is that of the judge to 3e-4
RATIO = CubicSpline(SLIPS, [float(judge(slip, 100.0)) for slip in SLIPS])


def test_growth_in_time_is_that_of_the_root(tmp_path):
    """A run of the whole law grows or decays as the linearised one: contact pressure varies."""
    system = pair(tmp_path).at(N=260.0)
    lam = system.modes(SLOW).lam
    run = system.simulate(duration=0.4, step=5e-6, perturbation=1e-5, band=SLOW)
    assert run.summary().iloc[0]["growth_rate"] == pytest.approx(lam.real.max(), rel=0.01)


class Mapped(Block):
    """The block with this map, under its load."""

    def drag(self, slip):
        return self.force * self.friction * float(RATIO(abs(slip)))


def block(folder, **more):
    """A point of another area: pressures are forces over it."""
    (folder / "block.toml").write_text(BLOCK)
    area = sq.model(str(folder / "block.toml"), gap=1.0).at().assembly.contact.area[0]
    given = values(pressures=np.array(PRESSURES) / area)
    return sq.model(str(folder / "block.toml"), friction_law="map", gap=1.0, **given, **more)


@pytest.mark.full_size
def test_stick_and_slip_against_event_located_integration(tmp_path):
    """Mean and RMS of the friction force, and frequency; between two pressures of the map."""
    case = Mapped(0.15)
    expected = case.levels(0.8, 0.4, 0.05)
    runs = block(tmp_path, **{"contact.regularisation_speed": 2e-4}).at(sliding_speed=case.speed)
    row = runs.simulate(duration=0.8, step=2e-5, perturbation=0.05, band=BAND).summary().iloc[0]
    assert row["class"] == "limit_cycle"
    assert row["torque_mean"] == pytest.approx(expected["mean"], rel=3e-3)
    assert row["torque_rms"] == pytest.approx(expected["rms"], rel=6e-3)
    assert row["frequency_hz"] == pytest.approx(expected["frequency_hz"], rel=1e-3)
