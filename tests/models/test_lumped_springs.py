"""Springs with a third power, with a gap or of one side in lumped models: every kind, judged."""

from __future__ import annotations

import numpy as np
import pytest
from lumped_files import HOFFMANN
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipk
from spring_reference import Block
from study_runs import command
from test_lumped import by_frequency, changed

import squealstudy as sq
from squealstudy.errors import ConvergenceError, StudyFileError
from squealstudy.laws import spring
from squealstudy.study.lumped import read_lumped

BLOCK = """\
[[mass]]
name = "block"
mass = 1.0
directions = ["x", "y"]

[[spring]]
name = "main"
between = ["block", "ground"]
direction = "x"
stiffness = 4e4
cubic = "c"

[[spring]]
name = "stop"
between = ["block", "ground"]
direction = "x"
stiffness = "ks"
cubic = "cs"
gap = "gap"
side = "both"

[[damper]]
between = ["block", "ground"]
direction = "x"
damping = "d"

[[contact]]
between = ["block", "belt"]
normal = "y"
sliding = "-x"
stiffness = 1e7

[[load]]
on = "block"
direction = "-y"
force = 100.0

[[load]]
on = "block"
direction = "x"
force = "push"

[parameters]
friction = 0.4
sliding_speed = 0.3
"friction_law.static_ratio" = 2.0
"friction_law.decay_speed" = 0.2
c = { default = 0.0, unit = "N/m3" }
cs = { default = 0.0, unit = "N/m3" }
ks = { default = 0.0, unit = "N/m" }
gap = { default = 1e-3, unit = "m" }
d = { default = 4.0, unit = "N s/m" }
push = { default = 0.0, unit = "N" }
"""
SIDES = {0.0: "both", 1.0: "tension", -1.0: "compression"}
FREE = {"friction": 0.0, "d": 0.0}  # nothing damps or drives
BAND = (1.0, 1000.0)


def block_model(folder, side=0.0, text=BLOCK, **values):
    path = folder / f"block_{SIDES[side]}.toml"
    path.write_text(text.replace('side = "both"', f'side = "{SIDES[side]}"'))
    return sq.model(str(path), **values)


@pytest.mark.parametrize(("gap", "side"), [(0.0, 0.0), (3e-4, 0.0), (3e-4, 1.0), (-2e-4, -1.0)])
def test_force_energy_and_mean_force_belong_together(gap, side):
    """The energy is the integral of the force, its mean the difference of energies over a step."""
    numbers = (2e4, 3e10, gap, side)
    for e in np.linspace(-1e-3, 1e-3, 41) + 1e-5:
        energy = quad(lambda x: -spring.spring_pressure(x, *numbers)[0], 0.0, e, points=[gap, -gap])
        rest = spring.spring_potential(0.0, *numbers)
        assert spring.spring_potential(e, *numbers) - rest == pytest.approx(energy[0], abs=1e-13)
        width = 7e-4
        ends = [spring.spring_potential(e + s * width / 2, *numbers) for s in (-1, 1)]
        mean = spring.mean_spring_pressure(e, width, *numbers)
        assert mean == pytest.approx((ends[0] - ends[1]) / width, abs=1e-9)
        p, kappa = spring.spring_pressure(e, *numbers)
        assert spring.mean_spring_pressure(e, 0.0, *numbers) == pytest.approx(p, abs=1e-12)
        of_array = spring.evaluate_springs(np.array([e]), np.array([numbers]))
        assert (of_array[0][0], of_array[1][0]) == (p, kappa)
        h = 1e-9
        slope = (
            spring.spring_pressure(e - h, *numbers)[0] - spring.spring_pressure(e + h, *numbers)[0]
        )
        assert kappa == pytest.approx(slope / (2 * h), rel=1e-5, abs=1e-4)
    assert np.isnan(spring.spring_pressure(np.nan, *numbers)[0])


@pytest.mark.parametrize("velocity", [0.1, 1.0, 3.0])
def test_free_vibration_of_a_cubic_spring_has_the_period_of_duffing(velocity, tmp_path):
    """By the complete elliptic integral of the amplitude that the energy gives."""
    k, c = 4e4, 3e10
    run = (
        block_model(tmp_path, c=c, **FREE)
        .at()
        .simulate(duration=0.5, step=1e-5, perturbation=velocity, band=BAND)
    )
    square = (-k + np.sqrt(k * k + 2 * c * velocity**2)) / c
    modulus = c * square / (2 * (k + c * square))
    period = 4 * ellipk(modulus) / np.sqrt(k + c * square)
    found = run.summary().iloc[0]
    assert found["frequency_hz"] == pytest.approx(1 / period, rel=1e-5)
    assert abs(found["energy_balance"]) < 1e-5


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_stop_without_a_gap_halves_two_periods(side, tmp_path):
    """Stiffness k one way and k + ks the other: pi / w1 + pi / w2, at any size."""
    model = block_model(tmp_path, side, ks=1.2e5, gap=1e-8, **FREE)
    for velocity in (0.1, 1.0):
        run = model.at().simulate(duration=0.5, step=1e-5, perturbation=velocity, band=BAND)
        period = np.pi / np.sqrt(4e4) + np.pi / np.sqrt(1.6e5)
        assert run.summary()["frequency_hz"][0] == pytest.approx(1 / period, rel=2e-5)


@pytest.mark.parametrize("method", ["newmark", "exponential"])
def test_integrators_keep_the_energy_of_a_stop(method, tmp_path):
    """Nothing is dissipated, and the largest motion stays."""
    model = block_model(tmp_path, ks=2e5, cs=1e11, gap=1e-3, c=1e10, **FREE)
    run = model.at().simulate(duration=1.0, step=1e-5, perturbation=1.0, method=method, band=BAND)
    assert abs(run.summary()["energy_balance"][0]) < 1e-4


def test_a_batch_its_points_and_steady_sliding_by_hand(tmp_path):
    """Deflections by bisection, roots from the tangents there; one by one and at once."""
    values = {
        "c": np.array([0.0, 3e10, 1e11, 3e10]),
        "ks": np.array([2e5, 2e5, 0.0, 1e5]),
        "cs": np.array([0.0, 1e11, 1e10, -1e10]),
        "gap": np.array([2e-4, 5e-4, 1e-4, 5.0]),
    }
    model = block_model(tmp_path, -1.0)
    batch = model.at(**values)
    roots, steady = batch.modes(BAND), batch.steady
    assert list(roots.status) == ["ok"] * 4
    for i in range(4):
        own = {name: float(v[i]) for name, v in values.items()}
        judge = Block(0.3, cubic=own["c"], stop=own["ks"], stop_cubic=own["cs"], gap=own["gap"],
                      side=-1.0)  # fmt: skip
        x = judge.steady()
        assert steady.gap[i, 1:] == pytest.approx([x, x], rel=1e-9)
        h = 1e-8
        k = (judge.pull(x - h, 0.0) - judge.pull(x + h, 0.0)) / (2 * h)
        slope = (judge.drag(0.3 + 1e-6) - judge.drag(0.3 - 1e-6)) / 2e-6
        expected = -(4.0 + slope) / 2 + 1j * np.sqrt(k - ((4.0 + slope) / 2) ** 2)
        one = model.at(**own)
        for lam in (roots.lam[i], one.modes(BAND).lam):
            assert by_frequency(lam)[0] == pytest.approx(expected, rel=1e-6)
        assert one.steady.gap == pytest.approx(steady.gap[i], rel=1e-12)
        own = by_frequency(one.modes(BAND).lam)
        assert own == pytest.approx(by_frequency(roots.lam[i, : roots.counts[i]]), rel=1e-12)


def test_a_cubic_spring_of_no_third_power_and_one_without_a_gap_are_linear(tmp_path):
    """Roots, sensitivities and a run are those of a linear spring, to round-off."""
    plain = BLOCK.replace('cubic = "c"\n', "").replace('c = { default = 0.0, unit = "N/m3" }\n', "")
    start = plain.index('[[spring]]\nname = "stop"')
    plain = plain[:start] + plain[plain.index("[[damper]]") :]
    for name in ("cs", "ks", "gap"):
        plain = "".join(x for x in plain.splitlines(True) if not x.startswith(f"{name} ="))
    (tmp_path / "plain.toml").write_text(plain)
    linear = sq.model(str(tmp_path / "plain.toml"))
    model = block_model(tmp_path, ks=1.0, gap=5.0)
    a, b = model.at(), linear.at()
    assert a.modes(BAND).lam == pytest.approx(b.modes(BAND).lam, rel=1e-12)
    one, two = (
        s.simulate(duration=0.3, step=2e-5, perturbation=0.1, band=BAND).summary() for s in (a, b)
    )
    for column in ("torque_mean", "torque_rms", "stick_share", "open_share"):
        assert one[column][0] == pytest.approx(two[column][0], rel=1e-8), column


@pytest.mark.parametrize("name", ["gap", "ks", "cs", "c", "push"])
def test_derivatives_by_the_numbers_of_springs(name, tmp_path):
    """Those of finite changes, of a batch and of one design point."""
    values = {"push": 150.0, "c": 3e10, "ks": 2e5, "cs": 1e10, "gap": 4e-4}
    model, h = block_model(tmp_path, 1.0, **values), 1e-6
    low, high = (
        by_frequency(model.at(**{name: values[name] * (1 + s * h)}).modes(BAND).lam)[0]
        for s in (-1, 1)
    )
    finite = (high - low) / (2 * h * values[name])
    one = model.at().sensitivities(name, modes=1, band=BAND).derivative[0, 0]
    many = model.at(push=np.array([150.0, 160.0])).sensitivities(name, modes=1, band=BAND)
    assert one == pytest.approx(finite, rel=1e-6)
    assert many[0].derivative[0, 0] == pytest.approx(finite, rel=1e-6)


def test_the_derivative_by_the_gap_of_a_contact(tmp_path):
    """A gap moves steady sliding: a unilateral contact of an exponent is stiffer when it closes."""
    text = BLOCK.replace("stiffness = 1e7", 'stiffness = 1e7\ngap = "g0"').replace(
        "[parameters]\n", '[parameters]\ng0 = { default = -1e-5, unit = "m" }\n'
    )
    text = text.replace('cubic = "c"', "").replace('c = { default = 0.0, unit = "N/m3" }\n', "")
    text += '\n[[spring]]\nbetween = ["block", "ground"]\ndirection = "y"\nstiffness = 1e7\n'
    path = tmp_path / "gap.toml"
    path.write_text(text)
    model = sq.model(str(path), contact_law="power")
    h = 1e-9
    low, high = (by_frequency(model.at(g0=-1e-5 + s * h).modes((1, 5000)).lam) for s in (-1, 1))
    finite = (high - low) / (2 * h)
    assert np.abs(finite).max() > 1e5
    one = model.at().sensitivities("g0", modes=2, band=(1.0, 5000.0))
    order = np.argsort(one.lam.imag)
    assert one.derivative[order, 0] == pytest.approx(finite, rel=1e-4, abs=1.0)
    many = model.at(g0=np.array([-1e-5, -2e-5])).sensitivities("g0", modes=2, band=(1.0, 5000.0))
    order = np.argsort(many[0].lam.imag)
    assert many[0].derivative[order, 0] == pytest.approx(finite, rel=1e-4, abs=1.0)


CASES = [
    Block(0.3, stop=2e5, gap=5e-4, side=1.0),
    pytest.param(Block(0.3, cubic=3e10), marks=pytest.mark.full_size),
    pytest.param(Block(0.3, stop=2e5, gap=1.2e-3), marks=pytest.mark.full_size),
    pytest.param(
        Block(0.3, stop=1e5, stop_cubic=1e12, gap=1e-3, side=-1.0), marks=pytest.mark.full_size
    ),
]


@pytest.mark.parametrize("case", CASES)
def test_stick_and_slip_against_event_located_integration(case, tmp_path):
    """Levels of the friction force and the frequency; regularisation costs .2 % of the RMS."""
    judge = case.levels(0.8, 0.4, 0.1)
    model = block_model(
        tmp_path, case.side, c=case.cubic, ks=case.stop, cs=case.stop_cubic, gap=case.gap,
        **{"contact.regularisation_speed": 2e-4},
    )  # fmt: skip
    runs = model.at().simulate(duration=0.8, step=2e-5, perturbation=0.1, band=BAND)
    found = runs.summary().iloc[0]
    assert found["status"] == "ok"
    assert found["class"] == "limit_cycle"
    assert found["torque_mean"] == pytest.approx(judge["mean"], rel=2e-3)
    assert found["torque_rms"] == pytest.approx(judge["rms"], rel=4e-3)
    assert found["frequency_hz"] == pytest.approx(judge["frequency_hz"], rel=5e-4)


HARD = changed(
    HOFFMANN.replace("[parameters]\n", '[parameters]\nc = { default = 1e14, unit = "N/m3" }\n'),
    'stiffness = "k2"',
    'stiffness = "k2"\ncubic = "c"',
)


def flutter(duration):
    """RMS and frequency of Hoffmann's oscillator with a third power in one spring: own equations.

    Returns the RMS of the friction force and the frequency, Hz.
    """
    a, b = (np.array([np.cos(x), np.sin(x)]) for x in np.deg2rad([150.0, 30.0]))
    k1, k2, kc, N, c, mu = (
        178632.7949540818,
        2488033.871712585,
        1333333.3333333333,
        100.0,
        1e14,
        0.9,
    )

    def force(q):
        e = b @ q
        pressed = -kc * q[1]
        held = k1 * (a @ q) * a + (k2 * e + c * e**3) * b
        return np.array([-mu * max(pressed, 0.0), pressed - N]) - held

    q = np.array([-4.7e-5, -2.7e-5])
    for _ in range(50):
        J = np.column_stack([(force(q + d) - force(q - d)) / 2e-9 for d in 1e-9 * np.eye(2)])
        q = q - np.linalg.solve(J, force(q))
    tangent = k1 * np.outer(a, a) + (k2 + 3 * c * (b @ q) ** 2) * np.outer(b, b)
    w2, phi = np.linalg.eigh(tangent + kc * np.diag([0.0, 1.0]))
    C = phi @ np.diag(2 * 0.01 * np.sqrt(w2)) @ phi.T
    start = np.concatenate([q, [0.05, 0.0]])
    times = np.arange(0.6 * duration, duration, 1e-5)
    found = solve_ivp(
        lambda t, y: np.concatenate([y[2:], force(y[:2]) - C @ y[2:]]),
        (0.0, duration), start, "DOP853", times, rtol=1e-10, atol=1e-13, max_step=2e-4,
    ).y  # fmt: skip
    friction = mu * np.maximum(-kc * found[1], 0.0)
    x = friction - friction.mean()
    up = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    crossed = times[up] - x[up] * 1e-5 / (x[up + 1] - x[up])
    whole = slice(up[0], up[-1])
    return friction[whole].std(), (len(up) - 1) / (crossed[-1] - crossed[0])


@pytest.mark.full_size  # by default cycles of cubic contact: test_cycles.py
def test_a_limit_cycle_that_a_third_power_bounds(tmp_path):
    """By harmonic balance, by a run, and by own equations."""
    rms, hz = flutter(0.6)
    path = tmp_path / "hard.toml"
    path.write_text(HARD)
    system = sq.model(str(path), friction=0.9, damping_ratio=0.01, sliding_speed=5.0).at()
    cycles = system.limit_cycles(band=BAND).to_pandas()
    quiet = cycles.loc[cycles["contact_velocity"].idxmin()]
    assert bool(quiet["stable"])
    assert quiet["torque_rms"] == pytest.approx(rms, rel=5e-4)
    assert quiet["frequency_hz"] == pytest.approx(hz, rel=1e-4)
    run = system.simulate(duration=0.5, step=2e-5, perturbation=0.05, band=BAND).summary().iloc[0]
    assert run["torque_rms"] == pytest.approx(rms, rel=2e-3)


def test_a_spring_that_just_touches_has_no_tangent(tmp_path):
    """One design point raises, of a batch it is the row's; a run from there would be of it too."""
    model = block_model(tmp_path, 1.0, friction=0.0, ks=1e5, gap=0.0)
    batch = model.at(push=np.array([0.0, 10.0, -10.0]))
    modes = batch.modes(BAND)
    assert list(modes.status) == ["working_point", "ok", "ok"]
    assert "just touches in steady sliding" in modes.message[0]
    hz = np.abs(modes.lam[1:, 0]) / (2 * np.pi)
    assert hz == pytest.approx(np.sqrt([1.4e5, 4e4]) / (2 * np.pi))
    with pytest.raises(ConvergenceError, match="just touches"):
        model.at().modes(BAND)


def test_free_play_is_taken_up_by_a_load(tmp_path):
    """A mass that two stops hold alone: a load presses it on one of them; without, it is free."""
    text = BLOCK.replace("stiffness = 4e4", "stiffness = 0.0")
    text = text.replace("ks = { default = 0.0", "ks = { default = 1e5")
    model = block_model(tmp_path, text=text, friction=0.0, ks=1e5, gap=1e-3)
    batch = model.at(push=np.array([50.0, -50.0]))
    assert batch.steady.gap[:, 2] == pytest.approx([1.5e-3, -1.5e-3])
    assert batch.modes(BAND).lam[:, 0].imag == pytest.approx(np.sqrt([1e5, 1e5]), rel=1e-4)
    with pytest.raises(ConvergenceError):
        model.at().modes(BAND)


BAD = [
    ('gap = "gap"', 'gap = "-gap"', "spring[2].gap", "at least 0"),
    ('stiffness = "ks"', 'stiffness = "ks - 1"', "spring[2].stiffness", "at least 0"),
    ('side = "both"', 'side = "left"', "spring[2].side", "'both', 'tension' or 'compression'"),
    ('cubic = "c"', 'cubic = "c + q"', "spring[1].cubic", "no parameter 'q'"),
    ("stiffness = 4e4", "stiffness = 0", "mass[1].name", "nothing holds 'block' along x"),
    ('damping = "d"', 'damping = "d"\ngap = 1e-3', "damper[1]", "gap"),
]


@pytest.mark.parametrize(("old", "new", "key", "words"), BAD)
def test_bad_input_is_one_sentence(old, new, key, words, tmp_path):
    """With file, line and key, and what was expected."""
    path = tmp_path / "bad.toml"
    path.write_text(changed(BLOCK, old, new))
    with pytest.raises(StudyFileError) as told:
        read_lumped(path)
    assert words in str(told.value)
    assert key in told.value.key or key in str(told.value)


STUDY = """\
[study]
name = "stops"
kind = "{kind}"
[model]
file = "block_compression.toml"
[parameters]
c = 3e10
ks = 2e5
"""
SWEEP = '[[sweep]]\nparameter = "gap"\nvalues = [2e-4, 1e-3, 3e-3]\n[modes]\nband = [1.0, 1000.0]\n'


def test_studies_of_them(tmp_path, capsys):
    """Complex modes, sensitivities, runs and cycles of a range of gaps; export and inspect."""
    block_model(tmp_path, -1.0)
    kinds = {
        "complex_modes": "",
        "sensitivity": '[sensitivity]\nparameters = ["gap", "ks", "cs", "c"]\n',
        "transient": "[transient]\nduration = 0.4\nstep = 2e-5\nperturbation = 0.1\n",
    }
    tables = {}
    for kind, own in kinds.items():
        path = tmp_path / f"{kind}.toml"
        path.write_text(STUDY.format(kind=kind) + SWEEP + own)
        tables[kind] = sq.run(path, tmp_path / f"results_{kind}", jobs=1)
        assert (tables[kind].points["status"] == "ok").all(), kind
    points, modes = tables["complex_modes"].points, tables["complex_modes"].modes
    hz = modes.groupby("point_id")["frequency_hz"].min()
    gaps = points.set_index("point_id")["gap"]
    assert hz.loc[gaps.sort_values().index].is_monotonic_decreasing
    runs = tables["transient"].points
    assert runs.sort_values("gap")["frequency_hz"].is_monotonic_decreasing
    pressed = points[["contact_pressure_min", "contact_pressure_max"]]
    assert pressed.to_numpy() == pytest.approx(100.0 / (1e7 / 5e11))
    assert (runs["open_share"] == 0.0).all()
    folder = tmp_path / "exported"
    assert command("export", str(tmp_path / "complex_modes.toml"), "-o", str(folder)) == 0
    with np.load(next(folder.glob("*.npz"))) as file:
        assert file["springs"] == pytest.approx(
            np.array([[4e4, 3e10, 0, 0, 0], [2e5, 0, 1e-3, -1, 0]])
        )
        assert len(file["gap"]) == 3
    assert command("inspect", str(tmp_path / "block_compression.toml")) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "gap 0.001 m, compression" in shown
    assert "springs alone 1 free, 31.8 Hz" in shown
