"""Lumped models of files: equal to the catalogue's, and to judges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from groan_reference import Groan
from lumped_files import BELT, HOFFMANN, write_minimal
from study_runs import command

import squealstudy as sq
from squealstudy.cli import model_commands
from squealstudy.errors import ModelError, StudyFileError
from squealstudy.study.lumped import read_lumped

STUDIES = Path(__file__).resolve().parents[2] / "studies" / "lumped"

# two masses and a turn: every table, and numbers of several parameters
ROCKER = """\
[[mass]]
name = "pad"
mass = "total - caliper"
inertia = "total * arm**2"
directions = ["x", "y", "rz"]

[[mass]]
name = "caliper"
mass = "caliper"
directions = ["x", "y"]

[[spring]]
name = "abutment"
between = ["pad", "caliper"]
direction = "x"
stiffness = "k"
at = [0.0, 0.03, 0.0]

[[spring]]
between = ["pad", "caliper"]
direction = [1, "slant"]
stiffness = "k / 2"
at = [0.01, 0.02, 0.0]

[[spring]]
between = ["caliper", "ground"]
direction = "x"
stiffness = "k"

[[spring]]
between = ["caliper", "ground"]
direction = "y"
stiffness = "k"

[[spring]]
between = ["pad", "ground"]
direction = "rz"
stiffness = 40.0

[[damper]]
between = ["pad", "caliper"]
direction = "x"
damping = "c"

[[contact]]
name = "leading"
between = ["pad", "disc"]
normal = "y"
sliding = "-x"
area = "arm * 1e-4"
at = ["REPLACED", -0.01, 0.0]

[[contact]]
name = "trailing"
between = ["pad", "disc"]
normal = "y"
sliding = "-x"
area = 2e-6
at = [0.02, -0.01, 0.0]

[[load]]
on = "pad"
direction = "-y"
area = 1e-4

[parameters]
pressure = "20 bar"
total = { default = 3.0, unit = "kg" }
caliper = { default = 2.0, unit = "kg" }
arm = { default = "30 mm", unit = "m" }
k = { default = "3 MN/m", unit = "N/m" }
slant = 0.5
c = { default = 30.0, unit = "N s/m" }
""".replace('"REPLACED"', "-0.02")


def by_frequency(lam):
    return lam[np.argsort(lam.imag)]


def model_of(tmp_path, text, **values):
    path = tmp_path / "own.toml"
    path.write_text(text)
    return sq.model(str(path), **values)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        (
            "hulten",
            {"friction": np.linspace(0.05, 0.9, 18), "frequency_1": np.linspace(60, 120, 18)},
        ),
        ("hoffmann", {"friction": np.linspace(0.1, 1.2, 12), "alpha1": np.linspace(120, 170, 12)}),
        (
            "belt",
            {"sliding_speed": np.linspace(0.5, 2.0, 12), "stiffness": np.linspace(1e5, 9e5, 12)},
        ),
    ],
)
def test_minimal_models_from_files_are_those_of_the_catalogue(name, values, tmp_path):
    """Roots, steady sliding, matrices, one by one and as a batch, and sensitivities."""
    mine, catalogued = sq.model(str(write_minimal(tmp_path, name))), sq.model(name)
    for of in (lambda m: m.at(**values), lambda m: m.at(**{k: v[3] for k, v in values.items()})):
        a, b = of(mine), of(catalogued)
        assert np.allclose(a.modes().lam, b.modes().lam, rtol=1e-13, atol=1e-9, equal_nan=True)
        assert np.allclose(a.steady.force, b.steady.force, rtol=1e-13, atol=1e-11)
        assert np.allclose(a.linear.K, b.linear.K, rtol=1e-13, atol=1e-9)
        assert np.allclose(a.linear.C, b.linear.C, rtol=1e-12, atol=1e-9)


def test_runs_in_time_are_those_of_the_catalogue(tmp_path):
    """Belt with stick and slip."""
    runs = []
    for model in (sq.model(str(write_minimal(tmp_path, "belt"))), sq.model("belt")):
        system = model.at(sliding_speed=0.6)
        runs.append(system.simulate(duration=0.2, step=2e-5, perturbation=0.1).summary())
    mine, catalogued = runs
    for key in ("torque_mean", "torque_rms", "stick_share"):
        assert mine[key].to_numpy() == pytest.approx(catalogued[key].to_numpy(), rel=1e-9)


def test_a_batch_is_its_points_one_by_one(tmp_path):
    """Of a model with every table: turns, dampers, areas, pressure, expressions."""
    model = model_of(tmp_path, ROCKER)
    values = {
        "friction": np.array([0.1, 0.4, 0.6]),
        "caliper": np.array([1.0, 2.5, 2.9]),
        "slant": np.array([0.0, 0.4, -0.7]),
        "c": np.array([0.0, 50.0, 900.0]),
        "arm": np.array([0.01, 0.03, 0.05]),
    }
    batch = model.at(**values).modes((1.0, 5000.0))
    assert set(batch.status) == {"ok"}
    for i in range(3):
        one = model.at(**{k: float(v[i]) for k, v in values.items()}).modes((1.0, 5000.0))
        own = batch.lam[i, : batch.counts[i]]
        assert by_frequency(one.lam) == pytest.approx(by_frequency(own), rel=1e-9, abs=1e-6)


def test_matrices_put_together_by_hand(tmp_path):
    """M, C, K of the model with every table, by cross products of places."""
    system = model_of(tmp_path, ROCKER).at(friction=0.4)
    a = system.assembly
    assert a.M.diagonal() == pytest.approx([1.0, 1.0, 3.0 * 0.03**2, 2.0, 2.0])

    def row(place, d):
        turn = place[0] * d[1] - place[1] * d[0]
        return np.array([d[0], d[1], turn, -d[0], -d[1]])

    slanted = np.array([1.0, 0.5]) / np.hypot(1.0, 0.5)
    parts = [
        (3e6, row((0.0, 0.03), (1.0, 0.0))),
        (1.5e6, row((0.01, 0.02), slanted)),
        (3e6, np.array([0, 0, 0, 1, 0])),
        (3e6, np.array([0, 0, 0, 0, 1])),
        (40.0, np.array([0, 0, 1, 0, 0])),
    ]
    K = sum(k * np.outer(r, r) for k, r in parts)
    assert a.K.toarray() == pytest.approx(K, rel=1e-12)
    damper = row((0.0, 0.0), (1.0, 0.0))
    assert a.C.toarray() == pytest.approx(30.0 * np.outer(damper, damper), rel=1e-12)
    N = np.array([[0, 1, -0.02, 0, 0], [0, 1, 0.02, 0, 0]])
    T = np.array([[1, 0, 0.01, 0, 0]] * 2)
    assert a.contact.N.toarray() == pytest.approx(N)
    assert a.contact.T.toarray() == pytest.approx(T)
    # steady sliding: the springs and contact carry the pressure on 1e-4 m2 with friction
    k = 5e11 * np.diag([0.03e-4, 2e-6])
    x = np.linalg.solve(K + N.T @ k @ N - 0.4 * T.T @ k @ N, [0, -200.0, 0, 0, 0])
    assert system.steady.force[:, 0] == pytest.approx(-(k @ N @ x), rel=1e-9)
    # roots: those of numpy, with the modal damping that there is none of
    M, C = np.diag(a.M.diagonal()), a.C.toarray()
    K_lin = K + N.T @ k @ N - 0.4 * T.T @ k @ N
    zero = np.zeros((5, 5))
    A = np.block([[zero, np.eye(5)], [-np.linalg.solve(M, K_lin), -np.linalg.solve(M, C)]])
    lam = np.linalg.eigvals(A)
    found = system.modes((1.0, 5000.0)).lam
    inside = lam[(lam.imag > 0) & (np.abs(lam) < 2 * np.pi * 5000)]
    assert by_frequency(found) == pytest.approx(by_frequency(inside), rel=1e-9)


@pytest.mark.full_size
@pytest.mark.parametrize(
    ("speed", "mean", "rms", "line"),
    [(0.05, 685.2, 149.3, None), (0.1, 654.3, 175.3, 64.0), (0.2, 630.3, 156.5, 873.0)],
)
def test_groan_and_honk_against_event_driven_integration(speed, mean, rms, line):
    """Levels of the force of friction, of the shipped model and of the judge."""
    judge = Groan(speed).levels(3.0, 1.5)
    assert judge[:2] == pytest.approx((mean, rms), rel=3e-3)
    model = sq.model(str(STUDIES / "groan.toml"), **{"contact.regularisation_speed": 1e-4})
    runs = model.at(sliding_speed=speed).simulate(duration=3.0, step=1e-6, perturbation=0.1)
    found = runs.summary().iloc[0]
    assert found["torque_mean"] == pytest.approx(judge[0], rel=3e-3)
    assert found["torque_rms"] == pytest.approx(judge[1], rel=1e-2)
    if speed > 0.05:  # at 0.05 m/s lines near 62, 270 and 400 Hz are as loud, over other windows
        assert judge[2] == pytest.approx(line, abs=3.0)
        assert found["torque_line_hz"] == pytest.approx(judge[2], rel=2e-2)


def changed(text, old, new):
    assert text.count(old) >= 1, old
    return text.replace(old, new, 1)


BAD = [
    (BELT, "m = { default = 1.0,", "m = { default = 0.0,", "parameters.m.default", "above 0"),
    (BELT, 'mass = "m"', 'mass = "m - 1"', "mass[1].mass",
     "expected a value above 0 kg, got 0 of 'm - 1' at m = 1"),
    (BELT, '["mass", "ground"]', '["mas", "ground"]', "spring[1].between[1]", "no mass 'mas'"),
    (BELT, '["mass", "ground"]', '["mass", "earth"]', "spring[1].between[2]", "no mass 'earth'"),
    (HOFFMANN, '["cos(alpha1*pi/180)", "sin(alpha1*pi/180)"]', '[0, "alpha1 - 150"]',
     "spring[1].direction", "all zero"),
    (BELT, 'direction = "x"\nst', 'direction = "y"\nst', "mass[1].name",
     "nothing holds 'mass' along x"),
    (BELT, "stiffness = { default", "unused = 1.0\nstiffness = { default", "parameters.unused",
     "no number of the file uses it"),
    (BELT, 'force = "normal_force"', 'force = "normal_fore"', "load[1].force",
     "no parameter 'normal_fore'"),
    (BELT, 'name = "mass"', 'name = "mass"\nmass = 1\n[[mass]]\nname = "mass"', "mass[2].name",
     "already"),
    (BELT, 'sliding = "-x"', 'sliding = "y"', "contact[1].sliding", "right angles"),
    (BELT, 'sliding = "-x"', 'sliding = "z"', "contact[1].sliding", "does not move this way"),
    (BELT, 'sliding = "-x"\n', "", "contact[1]", "'sliding' is missing"),
    (BELT, '"belt"', '"ground"', "contact[1].between", "does not slide"),
    (BELT, 'force = "normal_force"', "", "load[1]", "expected a force"),
    (BELT, 'stiffness = "contact_stiffness"', 'area = "-contact_stiffness"', "contact[1].area",
     "above 0 m2"),
    (BELT, '"x", "y"]', '"x", "w"]', "mass[1]", "expected of x, y, z"),
    (BELT, 'unit = "kg"', 'unit = "g"', "parameters.m.unit", "unit of SI"),
    (BELT, 'stiffness = "stiffness"', 'stiffness = "sqrt(-stiffness)"', "spring[1].stiffness",
     "outside its domain"),
    (BELT, 'stiffness = "stiffness"', 'stiffness = "-stiffness"', "spring[1].stiffness",
     "at least 0"),
    (BELT, 'stiffness = "stiffness"', 'stiffnes = "stiffness"', "spring[1]", "missing"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "old", "new", "key", "words"), BAD)
def test_bad_input_is_one_sentence(text, old, new, key, words, tmp_path):
    """With file, line and key, and what was expected."""
    path = tmp_path / "bad.toml"
    path.write_text(changed(text, old, new))
    with pytest.raises(StudyFileError) as told:
        read_lumped(path)
    assert words in str(told.value)
    assert key in told.value.key or key in str(told.value)
    assert str(path) in str(told.value)


def test_a_load_that_presses_nothing_and_a_file_without_contact(tmp_path):
    """Both name the load."""
    alone = changed(BELT, "[[contact]]", '[[mass]]\nname = "free"\nmass = 1\n\n[[contact]]')
    alone += '\n[[spring]]\nbetween = ["free", "ground"]\ndirection = "x"\nstiffness = 1\n'
    path = tmp_path / "bad.toml"
    path.write_text(changed(alone, 'on = "mass"\ndirection = "-y"', 'on = "free"\ndirection = "x"'))
    with pytest.raises(StudyFileError, match="no contact is pressed: neither 'free'"):
        read_lumped(path)
    start, end = BELT.index("[[contact]]"), BELT.index("[[load]]")
    path.write_text(BELT[:start] + BELT[end:])
    with pytest.raises(StudyFileError, match=r"there is no \[\[contact\]\]"):
        read_lumped(path)


def test_values_that_cannot_be_fail_alone(tmp_path):
    """A design point of a mass below zero is its own row; one alone raises."""
    model = model_of(tmp_path, ROCKER)
    batch = model.at(caliper=np.array([1.0, 3.5, 2.0])).modes((1.0, 5000.0))
    assert list(batch.status)[0::2] == ["ok", "ok"]
    assert "expected a value above 0 kg" in batch.message[1]
    with pytest.raises(ModelError, match=r"mass\[1\].mass"):
        model.at(caliper=3.5).assembly  # noqa: B018


@pytest.mark.parametrize(
    "kind",
    [
        "complex_modes",
        "robust",
        "sensitivity",
        "transient",
        pytest.param("limit_cycles", marks=pytest.mark.full_size),
        pytest.param("design", marks=pytest.mark.full_size),
    ],
)
@pytest.mark.filterwarnings("ignore:the margin, 0.1 %")  # of falling friction, as it should
def test_every_kind_begins_with_a_lumped_model(kind, tmp_path):
    """The study that is written runs, and its results are those of a lumped model."""
    path = sq.new_study(tmp_path / "start.toml", kind, "lumped")
    assert (tmp_path / "start_model.toml").is_file()
    if kind == "transient":
        path.write_text(path.read_text().replace("num = 4", "num = 2"))
    results = sq.run(path, tmp_path / "results", jobs=1)
    assert (results.points["status"] == "ok").all()
    assert sq.open_results(tmp_path / "results").manifest["model"] == "lumped"
    if kind == "complex_modes":
        assert set(results.points["n_unstable"] > 0) == {True, False}
        assert results.onsets["onset"].min() > 0.2
    if kind == "transient":
        assert results.points["class"].to_list() == ["limit_cycle", "stable"]


def test_results_follow_the_file(tmp_path):
    """Rows are found again while the file is as it was, and are others once it is not."""
    path = sq.new_study(tmp_path / "start.toml", "complex_modes", "lumped")
    first = sq.run(path, tmp_path / "results", jobs=1)
    again = sq.run(path, tmp_path / "results", jobs=1)
    assert again.points["point_id"].to_list() == first.points["point_id"].to_list()
    file = tmp_path / "start_model.toml"
    file.write_text(changed(file.read_text(), "stiffness = 1e8", "stiffness = 2e8"))
    with pytest.warns(UserWarning, match="0 of 7 design points solved before"):
        other = sq.run(path, tmp_path / "results", jobs=1)
    assert not set(other.points["point_id"]) & set(first.points["point_id"])
    file.unlink()
    assert len(sq.open_results(tmp_path / "results").modes) == len(other.modes)


def test_derivatives_by_parameters_of_the_file(tmp_path):
    """Masses, springs and dampers between masses: those of finite changes."""
    model = model_of(tmp_path, ROCKER, friction=0.4)
    for name, value in (("total", 3.0), ("k", 3e6), ("c", 30.0), ("slant", 0.5), ("arm", 0.03)):
        h = 1e-5 * value
        found = model.at().sensitivities(name, modes=5, band=(1.0, 5000.0))
        order = np.argsort(found.lam.imag)
        low, high = (
            by_frequency(model.at(**{name: value + s * h}).modes((1.0, 5000.0)).lam)
            for s in (-1, 1)
        )
        finite = (high - low) / (2 * h)
        own = found.derivative[order, 0]
        assert own == pytest.approx(finite, rel=1e-5, abs=1e-6 * np.abs(finite).max()), name


def test_a_study_is_told_what_its_model_is(tmp_path):
    """A lumped model without its file, or with a file of another sort."""
    study = tmp_path / "study.toml"
    head = '[study]\nname = "s"\nkind = "complex_modes"\n[model]\nname = "lumped"\n'
    study.write_text(head)
    with pytest.raises(StudyFileError, match=r"a file with \[\[mass\]\] or \[\[term\]\] describes"):
        sq.read_study(study)
    study.write_text(head + 'file = "study.toml"\n')
    with pytest.raises(StudyFileError, match=r"expected a file with \[\[mass\]\] or \[\[term\]\]"):
        sq.read_study(study)


def test_screens_of_a_lumped_model(tmp_path, capsys):
    """`models lumped` explains the file; `inspect` tells masses, springs and frequencies."""
    model_commands.models("lumped")
    assert "[[contact]]  between" in capsys.readouterr().out
    model_commands.inspect(STUDIES / "groan.toml")
    shown = capsys.readouterr().out
    assert "caliper  x      6 kg" in shown
    assert "1 free, 73.5 Hz, 455.8 Hz" in shown


def test_check_of_a_shipped_study_tells_its_points(capsys):
    """It has no mesh to look at: `check` of the study says what it would run."""
    assert command("check", str(STUDIES / "groan_to_honk.toml")) == 0
    assert "5 points, 5 of them" in " ".join(capsys.readouterr().out.split())
