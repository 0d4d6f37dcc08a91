"""Own matrices with contact, springs that are not linear and loads: those of the same masses."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from lumped_files import TWO_PADS, write_minimal
from study_runs import command
from test_lumped_springs import HARD

import squealstudy as sq

BAND = (1.0, 20000.0)
SIDES = ("both", "tension", "compression")


def combination(row):
    row = row.toarray().ravel() if sp.issparse(row) else np.asarray(row)
    return "{" + ", ".join(f"{i + 1} = {float(row[i])!r}" for i in np.flatnonzero(row)) + "}"


def as_matrices(path: Path) -> Path:
    """The file of own matrices that hold a lumped model's masses, linear springs and dampers.

    What is not linear stands beside them, each motion as a sum of coordinates.
    """
    a = sq.model(str(path)).at().assembly
    matrices = {"M": a.M, "K": a.K, "C": a.C}
    text = ""
    for letter, matrix in matrices.items():
        if matrix is not None:
            scipy.io.mmwrite(path.with_name(f"{letter}.mtx"), sp.coo_matrix(matrix), precision=17)
            text += f'[[term]]\nmatrix = "{letter}"\nfile = "{letter}.mtx"\n'
            text += 'coefficient = "stiffer"\n' if letter == "K" else ""
    c = a.contact
    n_contacts = len(c.area) - len(c.spring_points)
    for i in range(n_contacts):
        text += f"[[contact]]\nnormal = {combination(c.N[i])}\n"
        text += f"sliding = {combination(-c.T[i])}\narea = {float(c.area[i])!r}\n"
        text += f"across = {combination(-c.T_perp[i])}\n" if c.T_perp[i].count_nonzero() else ""
        text += f"gap = {float(c.gap0[i])!r}\nfriction_factor = {float(c.frictional[i])!r}\n"
    for row, (stiffness, cubic, gap, side, _) in zip(
        c.N[n_contacts:], c.spring_points.tolist(), strict=True
    ):
        text += f"[[spring]]\nalong = {combination(row)}\nstiffness = {stiffness!r}\n"
        text += f'cubic = {cubic!r}\ngap = {gap!r}\nside = "{SIDES[int(side)]}"\n'
    for i, force in enumerate(np.ravel(a.load).tolist()):
        text += f"[[load]]\nalong = {i + 1}\nforce = {force!r}\n" if force else ""
    text += "[parameters]\nstiffer = 1.0\n"
    for name, default in tomllib.loads(path.read_text())["parameters"].items():
        text += f'"{name}" = {default!r}\n' if isinstance(default, float) else ""
    to = path.with_name(f"{path.stem}_matrices.toml")
    to.write_text(text)
    return to


def five_masses(path: Path, seed: int) -> Path:
    """Random masses on random springs, two contacts, a cubic spring and a stop."""
    draw = np.random.default_rng(seed)
    text = ""
    for name in "abcde":
        text += f'[[mass]]\nname = "{name}"\nmass = {draw.uniform(0.5, 3.0)}\n'
        text += 'directions = ["x", "y"]\n'
    for a, b in ("ab", "bc", "cd", "de", "ae", "bd"):
        x, y = draw.uniform(-1, 1, 2).tolist()
        text += f'[[spring]]\nbetween = ["{a}", "{b}"]\ndirection = [{x}, {y}]\n'
        text += f"stiffness = {draw.uniform(1e6, 5e6)}\n"
        text += f'[[damper]]\nbetween = ["{a}", "{b}"]\ndirection = [{y}, {x}]\ndamping = 30.0\n'
    for name in "abcde":
        for axis in "xy":
            text += f'[[spring]]\nbetween = ["{name}", "ground"]\ndirection = "{axis}"\n'
            text += f"stiffness = {draw.uniform(1e5, 2e6)}\n"
    text += """\
[[spring]]
between = ["c", "ground"]
direction = "x"
stiffness = 1e5
cubic = 4e13
[[spring]]
between = ["d", "e"]
direction = [1, 0.3]
stiffness = 8e6
gap = 2e-5
side = "tension"
[[contact]]
between = ["a", "disc"]
normal = "y"
sliding = "-x"
stiffness = 3e6
[[contact]]
between = ["b", "d"]
normal = "y"
sliding = "-x"
stiffness = 2e6
friction_factor = 0.7
[[load]]
on = "a"
direction = "-y"
force = 400.0
[[load]]
on = "b"
direction = "-y"
force = 300.0
[[load]]
on = "d"
direction = "y"
force = 300.0
[parameters]
friction = 0.5
sliding_speed = 0.5
damping_ratio = 0.002
"friction_law.static_ratio" = 1.5
"friction_law.decay_speed" = 0.3
"""
    path.write_text(text)
    return path


# slides along x and across it, on a slant: both tangential directions move
IN_SPACE = """\
[[mass]]
name = "pad"
mass = 2.0
directions = ["x", "y", "z"]
[[spring]]
between = ["pad", "ground"]
direction = [1, 0.4, 0.3]
stiffness = 4e6
[[spring]]
between = ["pad", "ground"]
direction = [-0.5, 1, 0.2]
stiffness = 2e6
[[spring]]
between = ["pad", "ground"]
direction = [0.2, 0.5, 1]
stiffness = 1e6
[[contact]]
between = ["pad", "disc"]
normal = "z"
sliding = [-1, 0.7]
stiffness = 3e6
[[load]]
on = "pad"
direction = "-z"
force = 200.0
[parameters]
sliding_speed = 0.3
"""


def written(name, folder):
    if name == "five":
        return five_masses(folder / "five.toml", 5)
    if name == "in_space":
        path = folder / "in_space.toml"
        path.write_text(IN_SPACE)
        return path
    if name == "two_pads":
        path = folder / "two_pads.toml"
        path.write_text(TWO_PADS)
        return path
    return write_minimal(folder, name)


def pair(name, folder):
    path = written(name, folder)
    return sq.model(str(path)), sq.model(str(as_matrices(path)))


@pytest.mark.parametrize("name", ["hoffmann", "belt", "hulten", "two_pads", "five", "in_space"])
def test_matrices_with_contact_are_the_masses_that_they_are_of(name, tmp_path):
    """Roots, steady sliding, sensitivities, one by one and as a batch."""
    masses, matrices = pair(name, tmp_path)
    batch = {"friction": np.linspace(0.05, 0.7, 7), "sliding_speed": np.linspace(0.4, 2.0, 7)}
    for values in (batch, {k: float(v[3]) for k, v in batch.items()}):
        a, b = masses.at(**values), matrices.at(**values)
        assert a.steady.force == pytest.approx(b.steady.force, rel=1e-9, abs=1e-7)
        of_masses, of_matrices = a.modes(BAND), b.modes(BAND)
        size = np.nanmax(np.abs(of_masses.lam))
        assert np.allclose(of_masses.lam, of_matrices.lam, rtol=0, atol=1e-9 * size, equal_nan=True)
    names = ["friction", "sliding_speed", "damping_ratio"]
    a, b = (m.at().sensitivities(*names, modes=4, band=BAND) for m in (masses, matrices))
    scale = np.abs(a.derivative).max(axis=0)
    one, other = (x.derivative[np.argsort(x.lam.imag)] for x in (a, b))  # growth may be round-off
    assert np.allclose(other, one, rtol=1e-6, atol=1e-8 * scale.max())


@pytest.mark.parametrize("law", ["bilateral", "unilateral", "exponential"])
def test_runs_in_time_are_those_of_the_masses(law, tmp_path):
    """Two contacts, a cubic spring and a stop, with every sort of contact law."""
    masses, matrices = pair("five", tmp_path)
    runs = [
        sq.model(str(m.definition.path), contact_law=law)
        .at()
        .simulate(duration=0.02, step=5e-6, perturbation=0.2, band=BAND)
        for m in (masses, matrices)
    ]
    a, b = (run.summary().iloc[0] for run in runs)
    for key in ("torque_mean", "torque_rms", "stick_share", "open_share"):
        assert b[key] == pytest.approx(a[key], rel=1e-7, abs=1e-9), key


def test_limit_cycles_are_those_of_the_masses(tmp_path):
    """Of a cubic spring: each cycle, its level and whether it attracts."""
    path = tmp_path / "hard.toml"
    path.write_text(HARD)
    values = {"friction": 0.9, "damping_ratio": 0.01, "sliding_speed": 5.0}
    a, b = (
        sq.model(str(p), **values).at().limit_cycles(band=(1.0, 1000.0)).to_pandas()
        for p in (path, as_matrices(path))
    )
    assert len(a) > 0
    assert list(a["stable"]) == list(b["stable"])
    for key in ("frequency_hz", "torque_rms", "contact_velocity"):
        assert b[key].to_numpy() == pytest.approx(a[key].to_numpy(), rel=1e-6), key


class Pads:
    """Two pads on inclined springs in coordinates that mix them: own equations, by Runge-Kutta.

    No masses on springs have these matrices: none of them has an entry of zero.
    """

    speed, friction, cubic = 5.0, np.array([0.8, 0.24]), 1e14
    rotation = 20.0  # rad/s, of gyroscopic terms
    contact = np.array([4e6 / 3, 1.7e6])

    def __init__(self):
        angles = np.deg2rad([150.0, 30.0])
        along = np.column_stack([np.cos(angles), np.sin(angles)])
        block = along.T @ np.diag([178632.8, 2488033.87]) @ along
        apart = np.array([1.0, 0.0, -1.0, 0.0])
        K = 2e5 * np.outer(apart, apart)
        K[:2, :2] += block
        K[2:, 2:] += 1.3 * block
        C = 2e-5 * K + np.diag([15.0, 15.0, 25.0, 25.0])
        self.mixed = np.random.default_rng(3).standard_normal((4, 4))
        turning = np.zeros((4, 4))
        turning[[0, 1, 2, 3], [1, 0, 3, 2]] = [1.0, -1.0, -0.5, 0.5]
        self.M, self.K, self.C, self.G = (
            self.mixed.T @ A @ self.mixed for A in (np.diag([1.0, 1.0, 0.7, 0.7]), K, C, turning)
        )
        self.N = np.eye(4)[[1, 3]] @ self.mixed
        self.T = np.eye(4)[[0, 2]] @ self.mixed
        self.spring = np.array([*along[1], 0.0, 0.0]) @ self.mixed
        self.load = np.array([0.0, -400.0, 0.0, -300.0]) @ self.mixed

    def write(self, folder):
        """The model file, with names of the coordinates."""
        np.savez(folder / "pads.npz", **self.terms)
        text = 'coordinates = ["one", "two", "three", "four"]\n'
        for letter in self.terms:
            text += f'[[term]]\nmatrix = "{letter}"\nfile = "pads.npz"\nvariable = "{letter}"\n'
        text += 'coefficient = "speed"\n'  # of the last: gyroscopic
        for i in (0, 1):
            text += f"[[contact]]\nnormal = {self.named(self.N[i])}\n"
            text += f"sliding = {self.named(-self.T[i])}\nstiffness = {self.contact[i]}\n"
            text += f"friction_factor = {self.friction[i] / self.friction[0]}\n"
        text += f"[[spring]]\nalong = {self.named(self.spring)}\nstiffness = 0.0\n"
        text += f"cubic = {self.cubic}\n"
        text += f"[[load]]\nalong = {self.named(self.load)}\nforce = 1.0\n"
        text += f"[parameters]\nfriction = {self.friction[0]}\nsliding_speed = {self.speed}\n"
        text += f"speed = {self.rotation}\n"
        (folder / "pads.toml").write_text(text)
        return str(folder / "pads.toml")

    @property
    def terms(self):
        return {"M": self.M, "K": self.K, "C": self.C, "G": self.G}

    @staticmethod
    def named(row):
        names = zip(("one", "two", "three", "four"), row.tolist(), strict=True)
        return "{" + ", ".join(f"{name} = {part!r}" for name, part in names) + "}"

    def pressed(self, q):
        return np.maximum(-self.contact * (self.N @ q), 0.0)

    def levels(self, kick, duration, h):
        """Mean and RMS of the friction force, and its frequency [Hz], of the second half."""
        inverse = np.linalg.inv(self.M)
        pull = self.N.T - self.T.T * self.friction
        rates = self.C + self.rotation * self.G

        def acceleration(q, v):
            slid = np.sign(self.speed + self.T @ v)
            assert (slid > 0).all()  # as `pull` has it
            bent = self.cubic * (self.spring @ q) ** 3 * self.spring
            return inverse @ (self.load + pull @ self.pressed(q) - self.K @ q - rates @ v - bent)

        q = np.linalg.solve(self.K + pull @ np.diag(self.contact) @ self.N, self.load)
        v = kick * np.linalg.solve(self.mixed, [1.0, 0.0, 0.0, 0.0])
        drag = []
        for _ in range(round(duration / h)):
            a = acceleration(q, v)
            b = acceleration(q + h / 2 * v, v + h / 2 * a)
            c = acceleration(q + h / 2 * v + h * h / 4 * a, v + h / 2 * b)
            d = acceleration(q + h * v + h * h / 2 * b, v + h * c)
            q, v = q + h * v + h * h / 6 * (a + b + c), v + h / 6 * (a + 2 * b + 2 * c + d)
            drag.append(self.friction @ self.pressed(q))
        x = np.array(drag[len(drag) // 2 :])
        swing = x - x.mean()
        up = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
        crossed = up - swing[up] / (swing[up + 1] - swing[up])
        whole = x[up[0] : up[-1]]
        return whole.mean(), whole.std(), (len(up) - 1) / (crossed[-1] - crossed[0]) / h


@pytest.mark.full_size  # by default against masses: above
def test_full_matrices_against_own_equations(tmp_path):
    """Kicked from stable sliding: levels of a run, of the cycle that attracts, and of the judge."""
    pads = Pads()
    mean, rms, hz = pads.levels(3.0, 0.5, 4e-5)
    system = sq.model(pads.write(tmp_path), contact_law="unilateral").at()
    assert system.modes((1.0, 1000.0)).growth_rate.max() < 0.0
    cycles = system.limit_cycles(band=(1.0, 1000.0)).to_pandas()
    assert set(cycles["verdict"]) == {"squeals_if_kicked"}
    loud = cycles[cycles["stable"].astype(bool)].iloc[0]
    run = system.simulate(duration=0.6, step=1e-5, perturbation=1.0, band=(1.0, 1000.0))
    found = run.summary().iloc[0]
    for levels, within in ((loud, 5e-4), (found, 2e-4)):
        assert levels["torque_mean"] == pytest.approx(mean, rel=within)
        assert levels["torque_rms"] == pytest.approx(rms, rel=within)
        assert levels["frequency_hz"] == pytest.approx(hz, rel=within)


FED = """\
coordinates = ["x", "y"]
[[term]]
matrix = "M"
file = "fed.npz"
variable = "M"
[[term]]
matrix = "C"
file = "fed.npz"
variable = "C"
coefficient = "feed"
[[term]]
matrix = "K"
file = "fed.npz"
variable = "K"
[[contact]]
normal = "y"
sliding = "x"
stiffness = 1e5
[[load]]
along = "-y"
force = 100.0
[parameters]
friction = 0.1
sliding_speed = 1.0
feed = 1.0
"""


def test_negative_damping_feeds_motion_in_time_and_cycles(tmp_path):
    """The growth of matrices by hand in each kind."""
    M, K = np.diag([1.0, 2.0]), np.array([[3e5, -1e5], [-1e5, 2e5]])
    C = np.array([[-8.0, 2.0], [2.0, 3.0]])
    np.savez(tmp_path / "fed.npz", M=M, K=K, C=C)
    (tmp_path / "fed.toml").write_text(FED)
    whole = K + 1e5 * np.array([[0.0, 0.1], [0.0, 1.0]])
    zero = np.zeros((2, 2))
    A = np.block([[zero, np.eye(2)], [-np.linalg.solve(M, whole), -np.linalg.solve(M, C)]])
    growth = np.linalg.eigvals(A).real.max()
    system = sq.model(str(tmp_path / "fed.toml")).at()
    assert system.modes((1.0, 1000.0)).growth_rate.max() == pytest.approx(growth, rel=1e-9)
    run = system.simulate(duration=1.0, step=1e-5, perturbation=1e-3).summary().iloc[0]
    assert run["predicted_growth_rate"] == pytest.approx(growth, rel=1e-9)
    assert run["growth_rate"] == pytest.approx(growth, rel=1e-4)
    assert abs(run["energy_balance"]) < 1e-6
    assert not run["invalid_reason"]
    (_, family), *_ = system.limit_cycles(band=(80.0, 100.0)).families
    assert family.verdict == "squeals"
    assert family.lam.real == pytest.approx(growth, rel=1e-9)


def test_derivatives_by_coefficients(tmp_path):
    """A factor on K: those of finite changes."""
    model = sq.model(str(as_matrices(five_masses(tmp_path / "five.toml", 5))))
    found = model.at().sensitivities("stiffer", modes=5, band=BAND)
    low, high = (model.at(stiffer=1.0 + h).modes(BAND).lam for h in (-1e-5, 1e-5))
    for lam, derivative in zip(found.lam, found.derivative[:, 0], strict=True):
        k = np.abs(high - lam).argmin()
        finite = (high[k] - low[np.abs(low - lam).argmin()]) / 2e-5
        assert derivative == pytest.approx(finite, rel=1e-5, abs=1e-3)


STUDY = """\
[study]
name = "own"
kind = "{kind}"
[model]
file = "belt_matrices.toml"
[[sweep]]
parameter = "stiffer"
values = [0.8, 1.0]
[modes]
band = [1.0, 1000.0]
"""


def test_studies_follow_the_matrices(tmp_path, capsys):
    """Three kinds; other matrices are other points; results are read without the files."""
    file = as_matrices(write_minimal(tmp_path, "belt"))
    kinds = {
        "complex_modes": "",
        "sensitivity": '[sensitivity]\nparameters = ["stiffer", "friction"]\n',
        "transient": "[transient]\nduration = 0.2\nstep = 2e-5\nperturbation = 0.1\n",
    }
    for kind, table in kinds.items():
        (tmp_path / f"{kind}.toml").write_text(STUDY.format(kind=kind) + table)
        results = sq.run(tmp_path / f"{kind}.toml", tmp_path / kind, jobs=1)
        assert (results.points["status"] == "ok").all(), kind
    first = sq.open_results(tmp_path / "complex_modes").points["point_id"]
    modes = sq.open_results(tmp_path / "complex_modes").modes
    hz = modes.groupby("point_id")["frequency_hz"].min().sort_values()
    assert hz.to_numpy() == pytest.approx(100.0 * np.sqrt([0.8, 1.0]), rel=1e-3)
    scipy.io.mmwrite(tmp_path / "M.mtx", sp.coo_matrix(2.0 * np.eye(2)))
    with pytest.warns(UserWarning, match="0 of 2 design points solved before"):
        other = sq.run(tmp_path / "complex_modes.toml", tmp_path / "complex_modes", jobs=1)
    assert not set(first) & set(other.points["point_id"])
    capsys.readouterr()
    assert command("inspect", str(file)) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "K 2 x 2 stiffer K.mtx" in shown
    assert "contact contact_1 2, slides -1" in shown
    file.unlink()
    assert len(sq.open_results(tmp_path / "complex_modes").modes) == len(other.modes)


def test_the_shipped_pads_squeal_if_kicked():
    """Two cycles beside stable sliding, one of which attracts."""
    path = Path(__file__).resolve().parents[2] / "studies" / "lumped" / "two_pads.toml"
    system = sq.model(str(path), contact_law="unilateral", friction=0.75).at()
    assert system.modes((10.0, 1000.0)).growth_rate.max() < 0.0
    cycles = system.limit_cycles(band=(10.0, 1000.0)).to_pandas()
    assert list(cycles["stable"]) == [False, True]
    assert cycles["frequency_hz"].iloc[1] == pytest.approx(170.6, abs=0.05)
