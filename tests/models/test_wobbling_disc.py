"""The shipped disc of two tilts, by Euler's equations of finite tilts; gyroscopic own matrices."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import squealstudy as sq
from squealstudy.errors import StudyFileError

STUDY = Path(__file__).parents[2] / "studies" / "lumped" / "wobbling_disc.toml"
SPEEDS = [5.0, 20.0, 40.0, 100.0]


class FiniteTilts:
    """Moments on a rigid disc between two pins at any tilt, from positions and directions alone."""

    def __init__(self, **values):
        self.__dict__ |= values

    def axes(self, q):
        """The axis that the second tilt is about, and the disc's own."""
        (s1, s2), (c1, c2) = np.sin(q), np.cos(q)
        return np.array([0.0, c1, s1]), np.array([s2, -s1 * c2, c1 * c2])

    def turning(self, q, rate):
        second, own = self.axes(q)
        return rate[0] * np.array([1.0, 0.0, 0.0]) + rate[1] * second + self.omega * own

    def momentum(self, q, rate):
        _, own = self.axes(q)
        w = self.turning(q, rate)
        along = (w @ own) * own
        return self.theta * (w - along) + self.phi * along

    def pins(self, q):
        """Heights of the two pins on the faces."""
        own = self.axes(q)[1]
        return (np.array([0.5, -0.5]) * self.h - self.r * own[1]) / own[2]

    def moments(self, q, rate):
        """Of pins, springs and dampers along the axes of the tilts."""
        second, own = self.axes(q)
        step = 1e-6
        heights = self.pins(q)
        speeds = (self.pins(q + step * rate) - self.pins(q - step * rate)) / (2 * step)
        total = np.zeros(3)
        for side, z, speed in zip((1.0, -1.0), heights, speeds, strict=True):
            place = np.array([0.0, self.r, z])
            past = np.cross(self.turning(q, rate), place) - np.array([0.0, 0.0, speed])
            past = past - (past @ own) * own
            past = past / np.linalg.norm(past)
            pressed = self.n0 + side * (self.k * (z - side * self.h / 2) + self.d * speed)
            normal = pressed / (own[2] + side * self.mu * past[2])
            total += np.cross(place, -side * normal * own - self.mu * normal * past)
        held = self.k_t * q + self.d_t * rate
        return np.array([total[0], total @ second]) - held

    def residual(self, q, rate, acceleration):
        """Change of angular momentum less the moments, along the axes of the tilts."""
        step = 1e-6
        ends = [
            self.momentum(q + s * rate + s * s / 2 * acceleration, rate + s * acceleration)
            for s in (-step, step)
        ]
        change = (ends[1] - ends[0]) / (2 * step)
        return np.array([change[0], change @ self.axes(q)[0]]) - self.moments(q, rate)

    def linear(self):
        """M, C, K about no tilt, by central differences."""
        columns = {}
        still = np.zeros(2)
        for name, size in (("M", 1.0), ("C", 1e-3), ("K", 1e-6)):
            columns[name] = np.zeros((2, 2))
            for j in range(2):
                x = size * np.eye(2)[j]
                at = {"M": (still, still, x), "C": (still, x, still), "K": (x, still, still)}[name]
                ahead, back = self.residual(*at), self.residual(*(-a for a in at))
                columns[name][:, j] = (ahead - back) / (2 * size)
        return columns["M"], columns["C"], columns["K"]


def by_frequency(lam):
    lam = lam[lam.imag > 0]
    return lam[np.argsort(lam.imag)]


def eigenvalues(M, C, K):
    n = len(M)
    below = np.hstack([-np.linalg.solve(M, K), -np.linalg.solve(M, C)])
    return by_frequency(np.linalg.eigvals(np.vstack([np.eye(n, 2 * n, n), below])))


def solved(folder, name="disc", **values):
    """Tables of the shipped study at four speeds, with other values of its parameters."""
    text = re.sub(r"start = 2.0\nstop = 100.0\nnum = 50", f"values = {SPEEDS}", STUDY.read_text())
    for key, value in values.items():
        text = re.sub(rf"(?m)^{key} = \S+", f"{key} = {value}", text)
    path = folder / f"{name}.toml"
    path.write_text(text.replace("[model]\n", f'[model]\nfolder = "{STUDY.parent}"\n'))
    return sq.run(path, folder / name, jobs=1)


def roots(results):
    """Oscillating roots by speed, 1/s."""
    table = results.modes.merge(results.points[["point_id", "omega"]], on="point_id")
    table["size"] = 2 * np.pi * table["frequency_hz"]
    imaginary = np.sqrt(table["size"] ** 2 - table["growth_rate"] ** 2)
    table["lam"] = table["growth_rate"] + 1j * imaginary
    return {omega: by_frequency(t["lam"].to_numpy()) for omega, t in table.groupby("omega")}


@pytest.fixture(scope="module")
def parameters():
    return tomllib.loads(STUDY.read_text())["parameters"]


def test_the_study_has_the_equations_of_finite_tilts(parameters, tmp_path):
    """Roots over speed, and the speed from which friction makes the disc wobble."""
    results = solved(tmp_path)
    judged = {w: FiniteTilts(**parameters | {"omega": w}).linear() for w in SPEEDS}
    for omega, lam in roots(results).items():
        M, C, K = judged[omega]
        expected = eigenvalues(M, C, K)
        assert lam.imag == pytest.approx(expected.imag, rel=1e-8)
        assert lam.real == pytest.approx(expected.real, abs=2e-3)
    grows = results.points.set_index("omega")["n_unstable"] > 0
    assert grows.to_dict() == {w: w > 31.56 for w in SPEEDS}
    assert results.onsets["onset"].to_list() == pytest.approx([31.56], abs=0.02)


def test_without_gyroscopic_terms_it_stays(tmp_path):
    """They alone let friction feed the disc."""
    assert (solved(tmp_path, phi=0.0).points["n_unstable"] == 0).all()


def test_a_free_rotor_splits_as_its_closed_form(parameters, tmp_path):
    """Forward and backward: sqrt(k / theta + (phi omega / 2 theta)^2) -+ phi omega / 2 theta."""
    free = dict.fromkeys(("mu", "n0", "k", "d", "d_t"), 0.0)
    stiffness, inertia = parameters["k_t"], parameters["theta"]
    for omega, lam in roots(solved(tmp_path, **free)).items():
        half = parameters["phi"] * omega / (2 * inertia)
        middle = np.sqrt(stiffness / inertia + half**2)
        assert lam.imag == pytest.approx([middle - half, middle + half], rel=1e-12)
        assert lam.real == pytest.approx([0.0, 0.0], abs=1e-7)


def test_a_disc_that_turns_splits_its_roots(tmp_path):
    """Forward and backward, by closed form; one by one, as a batch, by rates of speed, in time."""
    theta, phi, k = 0.16, 0.32, 1.88e7
    np.savez(
        tmp_path / "disc.npz",
        M=theta * np.eye(2), K=k * np.eye(2), G=phi * np.array([[0.0, 1.0], [-1.0, 0.0]]),
    )  # fmt: skip
    text = "".join(
        f'[[term]]\nmatrix = "{x}"\nfile = "disc.npz"\nvariable = "{x}"\n' for x in "MKG"
    )
    text += 'coefficient = "speed"\n[[contact]]\nnormal = 1\nsliding = 2\nstiffness = 1e-3\n'
    text += "[[load]]\nalong = -1\nforce = 1\n[parameters]\nspeed = 50.0\nfriction = 0.0\n"
    (tmp_path / "disc.toml").write_text(text)
    model = sq.model(str(tmp_path / "disc.toml"))

    def expected(speed):
        half = phi * speed / (2 * theta)
        return np.sqrt(k / theta + half**2) + np.array([-half, half])

    speeds = np.array([0.0, 50.0, -200.0, 400.0])
    batch = model.at(speed=speeds).modes((500.0, 3000.0))
    for i, speed in enumerate(speeds):
        one = model.at(speed=float(speed)).modes((500.0, 3000.0))
        for lam in (batch.lam[i], one.lam):
            assert lam.imag == pytest.approx(np.sort(expected(speed)), rel=1e-9)
            assert np.abs(lam.real).max() < 1e-6
    found = model.at().sensitivities("speed", modes=2, band=(500.0, 3000.0))
    rates = (expected(50.001) - expected(49.999)) / 0.002
    assert found.derivative[:, 0].imag == pytest.approx(rates, rel=1e-4)
    run = model.at().simulate(duration=0.05, step=2e-6, perturbation=0.1, band=(500.0, 3000.0))
    summary = run.summary().iloc[0]
    hz = expected(50.0) / (2 * np.pi)
    assert np.abs(hz - summary["frequency_hz"]).min() < 0.1
    assert abs(summary["energy_balance"]) < 1e-4
    assert abs(summary["growth_rate"]) < 1e-2


SPINNING = """\
[[mass]]
name = "disc"
inertia = 0.16
directions = ["rx", "ry", "rz"]
spin = "phi * speed"
spin_axis = [AXIS]
[[spring]]
between = ["disc", "ground"]
direction = "rx"
stiffness = 1.88e7
[[spring]]
between = ["disc", "ground"]
direction = "ry"
stiffness = 2e7
[[spring]]
between = ["disc", "ground"]
direction = "rz"
stiffness = 1e7
[[contact]]
between = ["disc", "belt"]
normal = "z"
sliding = "x"
stiffness = 1e7
at = [0.05, 0.13, 0.01]
[[load]]
on = "disc"
direction = "-z"
force = 100
at = [0.05, 0.13, 0.01]
[parameters]
friction = 0.3
sliding_speed = 2.0
phi = { default = 0.32, unit = "kg m2" }
speed = { default = 100.0, unit = "rad/s" }
"""


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (2.0, -1.0, 2.0)])
def test_a_mass_that_spins(axis, tmp_path):
    """Roots with contact beside numpy's, about z and about a slanted axis; tilts that are not."""
    path = tmp_path / "disc.toml"
    text = SPINNING.replace("AXIS", ", ".join(map(str, axis)))
    path.write_text(text)
    model = sq.model(str(path))
    e = np.array(axis) / np.linalg.norm(axis)
    arm = np.array([0.05, 0.13, 0.01])
    sliding, across, normal = (np.cross(arm, direction) for direction in np.eye(3))
    K = np.diag([1.88e7, 2e7, 1e7]) + 1e7 * np.outer(normal + 0.3 * sliding, normal)
    pressed = -1e7 * normal @ np.linalg.solve(K, -100.0 * normal)
    C = 0.3 * pressed / 2.0 * np.outer(across, across)  # of friction, across the sliding
    speeds = np.array([0.0, 100.0, -400.0])
    batch = model.at(speed=speeds).modes((100.0, 5000.0))
    for i, speed in enumerate(speeds):
        G = 0.32 * speed * np.array([np.cross(tilt, e) for tilt in np.eye(3)]).T
        expected = eigenvalues(0.16 * np.eye(3), C + G, K)
        one = model.at(speed=float(speed)).modes((100.0, 5000.0))
        for lam in (one.lam, batch.lam[i]):
            assert np.abs(by_frequency(lam) - expected).max() < 1e-9 * np.abs(expected).max()
    path.write_text(text.replace('["rx", "ry", "rz"]', '["rx"]'))
    with pytest.raises(StudyFileError, match="two rotations across spin_axis"):
        sq.model(str(path))
