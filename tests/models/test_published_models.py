"""Lumped models of others, of `studies/lumped/published`, with the numbers that they published."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from study_runs import command

import squealstudy as sq
from squealstudy.cli.shape import reasons
from squealstudy.extensions import load_extension
from squealstudy.kinds.complex_modes.error_text import unseen_text

FILES = Path(__file__).parents[2] / "studies" / "lumped" / "published"
# speed of the belt: share of 5,000 starts in [-2, 2] x [0, 2] that come to rest, and its standard
# error, of bSTAB's MATLAB runs as the repository adrianwix/pyBasin has them (friction_case1 and 2)
SHARES = {
    1.25: (0.0800, 0.0038), 1.325: (0.1478, 0.0050), 1.4: (0.2130, 0.0058),
    1.475: (0.2776, 0.0063), 1.5: (0.3040, 0.0065), 1.55: (0.3544, 0.0068),
    1.625: (0.4202, 0.0070), 1.7: (0.4922, 0.0071), 1.775: (0.5678, 0.0070),
}  # fmt: skip
BAND = (0.01, 1.0)
# of Leine et al. (1998): the most that the block comes to, as the repository andreassommer/ifdiff
# has it, where it slides steadily, and its period and share of sticking by own located events
LEINE_MOST, LEINE_STEADY, LEINE_PERIOD, LEINE_STICKS = 1.133944669704, 0.625, 12.001031, 0.642031
# of Meijaard et al. (2007), table 2, as tests of other programs transcribe it: the roots that
# oscillate, by speed, and where these turn stable
WEAVE = {
    4.0: 0.41325331521125 + 3.07910818603206j,
    5.0: -0.77534188219585 + 4.46486771378823j,
    10.0: -3.72016840437287 + 10.90681139476287j,
}
WEAVE_SPEED = 4.29238253634111


@pytest.fixture(scope="module")
def block():
    return sq.model(str(FILES / "stender_block.toml"))


def share_at_rest(cycle, speed):
    """Share of the starts that an unstable cycle encloses: those come to rest."""
    angle = np.linspace(0.0, 2 * np.pi, 4001)
    k = np.arange(1, cycle.motion.harmonics + 1)
    mean, cosines, sines = np.split(cycle.motion.Q[:, 0], [1, 1 + len(k)])
    series = np.exp(1j * np.outer(angle, k)) @ (cosines - 1j * sines)
    rate = np.exp(1j * np.outer(angle, k)) @ (1j * k * (cosines - 1j * sines))
    # a mode's sign is free: friction falls with speed, so that on average the belt pulls more
    sign = np.sign(mean[0])
    steady = 0.5 * (1.0 + np.exp(-speed / 0.5))
    x = np.clip(steady + sign * (mean[0] + series.real), -2.0, 2.0)
    v = np.clip(sign * cycle.motion.omega * rate.real, 0.0, 2.0)
    return abs(np.trapezoid(v, x)) / 8.0


@pytest.mark.parametrize("speed", SHARES)
def test_shares_of_starts_that_come_to_rest(speed, block):
    """By the unstable cycle, against bSTAB's runs."""
    cycles = [c for _, c in block.at(sliding_speed=speed).limit_cycles(band=BAND).cycles]
    inner = next(c for c in cycles if c.attracts is False)
    published, error = SHARES[speed]
    assert abs(share_at_rest(inner, speed) - published) < 2 * error


@pytest.mark.parametrize(
    ("speed", "kick", "lasts"),
    [
        (1.1, 0.05, True),
        (1.5, 1.1, False),
        (1.5, 1.4, True),
        (1.775, 1.9, True),
        (1.85, 2.0, False),
    ],
)
def test_where_stick_and_slip_last(speed, kick, lasts, block):
    """From any start at 1.1 (bSTAB: all of 5,000), from none at 1.85, from large ones between."""
    run = block.at(sliding_speed=speed).simulate(
        duration=800.0 if kick < 0.1 else 300.0, step=5e-3, perturbation=kick, band=BAND
    )
    assert run.summary()["class"][0] == ("limit_cycle" if lasts else "stable")


def test_mode_coupling_of_hoffmann():
    """Hoffmann et al. (2002): s^2 = -2 +- sqrt(1 - D) with D = mu k3; growth from D = 1 on.

    Equations and roots as read in "How a Brake Squeals", repository endofwave/engineering-tools.
    """
    D = np.array([0.0, 0.3, 0.75, 0.999, 1.001, 1.4, 2.0])
    lam = sq.model(str(FILES / "hoffmann_belt.toml")).at(friction=D * 3 / 4).modes((0.1, 0.4)).lam
    assert (lam**2 + 2.0) ** 2 == pytest.approx((1.0 - D)[:, None] * np.ones(2), abs=1e-12)
    assert (lam**2).sum(axis=1) == pytest.approx(-4.0, abs=1e-12)
    assert list(lam.real.max(axis=1) > 1e-6) == list(D > 1.0)


def test_onset_of_hoffmann(tmp_path):
    """The shipped study finds D = 1, at the frequency sqrt(2)."""
    results = sq.run(FILES / "hoffmann_2002.toml", tmp_path, jobs=1)
    onset = results.onsets.iloc[0]
    assert onset["onset"] == pytest.approx(0.75, abs=1e-3)
    assert onset["frequency_hz"] == pytest.approx(np.sqrt(2.0) / (2 * np.pi), rel=1e-2)
    why = dict(reasons(results, [2]))  # at D = 2; the real modes of D = 0 are at 1 and sqrt(3)
    assert "at 0.159 Hz without friction, 50.0 % of that at 0.276 Hz" in why["made of"]
    assert "locked in" in why["made of"]
    assert unseen_text(results) == ""  # errors there and elsewhere, less than 0.001 % both


@pytest.mark.parametrize("duration", [120.0, 240.0])
def test_stick_slip_of_leine(duration):
    """How far the block comes, for how long it sticks, and its period, at a coarse step.

    Over twenty periods, too, it is a limit cycle: the first of them, of the start, is left out.
    """
    load_extension(FILES / "hyperbolic_fall.py")
    model = sq.model(
        str(FILES / "leine_block.toml"),
        friction_law="hyperbolic_fall",
        **{"contact.regularisation_speed": 1e-5},
    )
    run = model.at().simulate(
        duration=duration, step=1e-3, perturbation=0.1, band=BAND, save_every=1
    )
    found = run.summary().iloc[0]
    assert found["class"] == "limit_cycle"
    assert 1.0 / found["frequency_hz"] == pytest.approx(LEINE_PERIOD, rel=1e-4)
    late = run.motions[0].sensed_q[-13000:, 0]
    assert LEINE_STEADY + min(-late.min(), late.max()) == pytest.approx(LEINE_MOST, rel=1e-4)


def test_onset_of_veraszto():
    """The boundary by the formula of Veraszto and Stepan (2017): 0.1906 m/s; frequency 18.1 Hz."""
    model = sq.model(str(FILES / "veraszto_block.toml"))
    speeds = np.linspace(0.15, 0.25, 101)
    growth = model.at(sliding_speed=speeds).modes((1.0, 100.0)).growth_rate[:, 0]
    boundary = np.interp(0.0, -growth, speeds)
    published = np.log(10 * 4 / (5.746 + 0.2)) / 10
    assert published == pytest.approx(0.1906, abs=5e-5)
    assert boundary == pytest.approx(published, rel=1e-5)


def test_weave_of_the_benchmark_bicycle(tmp_path, capsys):
    """Roots of lean and steer to all digits, and the speed from which they decay."""
    study = str(FILES / "meijaard_2007.toml")
    assert command("run", study, "-j", "1", "-o", str(tmp_path / "found"), "--no-pictures") == 0
    assert "T1 at 0.597 Hz first at v 0.75 or less, no longer from 4.292 on" in " ".join(
        capsys.readouterr().out.split()
    )
    results = sq.open_results(tmp_path / "found")
    modes = results.modes.merge(results.points[["point_id", "v"]], on="point_id")
    for speed, published in WEAVE.items():
        (row,) = modes[np.isclose(modes["v"], speed) & ~modes["overdamped"]].itertuples()
        assert row.growth_rate == pytest.approx(published.real, abs=1e-11)
        assert 2 * np.pi * row.frequency_hz == pytest.approx(abs(published), rel=1e-12)
    (out,) = results.onsets[results.onsets["direction"] == "out"]["onset"]
    assert out == pytest.approx(WEAVE_SPEED, rel=1e-3)
    told = " ".join(text for _, text in reasons(results, [1]))
    assert "friction" not in told  # matrices have no contact here,
    assert "that no stiffness holds" in told  # and at rest the bicycle falls
    assert "locked in" not in told
