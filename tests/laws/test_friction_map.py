"""Friction by points over speed and pressure: judged by scipy, by hand, and in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from study_runs import solved
from test_lumped_springs import BAND

import squealstudy as sq
from squealstudy.engine.mode_shapes import plan_of
from squealstudy.errors import ModelError, ParameterError, StudyFileError
from squealstudy.laws import FrictionCurve, friction_curve
from squealstudy.models.operating import FRICTION_RANGE
from squealstudy.study.definition import parse_study

SLOW = (1.0, 200.0)  # Hz
SPEEDS = (0.02, 0.1, 0.4, 0.9, 2.0)
PRESSURES = (40.0, 80.0, 130.0, 200.0)  # of points of 1 m2: N
RATIOS = np.array(  # a row a pressure: falls over speed, over pressure it falls and rises
    [
        [2.4, 2.2, 1.5, 1.2, 1.2],
        [2.1, 1.9, 1.3, 1.1, 1.0],
        [1.8, 1.7, 1.2, 1.0, 0.9],
        [1.9, 1.8, 1.1, 0.8, 0.9],
    ]
)


def values(speeds=SPEEDS, pressures=PRESSURES, ratios=RATIOS):
    given = {f"friction_law.map_speed_{k}": s for k, s in enumerate(speeds, 1)}
    given |= {f"friction_law.map_pressure_{j}": p for j, p in enumerate(pressures, 1)}
    return given | {
        f"friction_law.map_ratio_{k}_{j}": float(ratio)
        for j, row in enumerate(ratios, 1)
        for k, ratio in enumerate(row, 1)
    }


def monotone(x, y):
    slopes = PchipInterpolator(x, y).derivative()(x)
    slopes[[0, -1]] = 0.0  # constant beyond the ends
    curve = CubicHermiteSpline(x, y, slopes)
    return lambda at: curve(np.clip(at, x[0], x[-1]))


ROWS = [monotone(SPEEDS, row) for row in RATIOS]


def judge(s, p):
    """The ratio at one speed and pressures: curves over speed, then one over pressure."""
    column = [float(row(s)) for row in ROWS]
    return monotone(PRESSURES, column)(p)


def test_the_map_is_scipys_both_ways_and_constant_beyond():
    curve = FrictionCurve.from_values("map", values())
    p = np.linspace(0.0, 260.0, 53)
    for s in np.linspace(0.0, 2.4, 25):
        assert curve.at(0.4, s, p).mu == pytest.approx(0.4 * judge(s, p), rel=1e-13)
    assert not curve.at(0.4, 0.3, np.array([20.0, 250.0])).by_pressure.any()


@pytest.mark.parametrize("seed", range(4))
def test_slopes_are_those_of_differences(seed):
    """Of random maps of any size, by speed and by pressure, at speeds and pressures anywhere."""
    rng = np.random.default_rng(seed)
    m, n = int(rng.integers(1, 7)), int(rng.integers(1, 5))
    speeds, pressures = np.cumsum(rng.uniform(0.05, 1.0, m)), np.cumsum(rng.uniform(1e5, 1e6, n))
    ratios = rng.uniform(0.5, 2.0, (n, m))
    curve = FrictionCurve.from_values("map", values(speeds, pressures, ratios))
    for s in rng.uniform(0.01, 1.3 * speeds[-1], 8):
        curve.expect_consistent(0.43, s, rng.uniform(1e4, 1.3 * pressures[-1], 8))


def by_hand(system, friction=0.4, h=1e-7):
    """Roots of M, C and K from parts of the model, with differences of the friction force."""
    a, steady = system.assembly, system.steady
    c, speed = a.contact, 0.3
    N, T = c.N.toarray(), c.T.toarray()

    def drag(s, p):  # of each point, per area
        return np.array([friction * float(judge(s, x)) * x for x in p])

    p = steady.pressure
    following = (drag(speed, p * (1 + h)) - drag(speed, p * (1 - h))) / (2 * h * p)
    slowing = (drag(speed + h, p) - drag(speed - h, p)) / (2 * h)
    K = a.K.toarray() + N.T @ np.diag(c.area * steady.tangent) @ N
    K -= T.T @ np.diag(following * c.area * steady.tangent) @ N
    C = a.C.toarray() + T.T @ np.diag(c.area * slowing) @ T
    M, n = a.M.toarray(), a.n_dof
    top = np.hstack([np.zeros((n, n)), np.eye(n)])
    return np.linalg.eigvals(np.vstack([top, -np.linalg.solve(M, np.hstack([K, C]))]))


PAIR = """\
[[mass]]
name = "block"
mass = 1.0
directions = ["x", "y"]

[[spring]]
between = ["block", "ground"]
direction = "x"
stiffness = 1.6e5

[[spring]]
between = ["block", "ground"]
direction = [0.6, 0.8]
stiffness = 9e4

[[damper]]
between = ["block", "ground"]
direction = "x"
damping = 2.0

[[contact]]
between = ["block", "belt"]
normal = "y"
sliding = "x"
area = 1.0

[[load]]
on = "block"
direction = "-y"
force = "N"

[parameters]
N = 190.0
"""


def pair(folder):
    (folder / "pair.toml").write_text(PAIR)
    law = {"contact_law": "bilateral", "contact.stiffness": 7e4, "friction_law": "map"}
    return sq.model(str(folder / "pair.toml"), friction=0.4, sliding_speed=0.3, **law, **values())


@pytest.mark.parametrize("load", [190.0, 260.0, 300.0])
def test_roots_are_those_by_hand(tmp_path, load):
    """The slope by pressure is in K beside mu, that by speed in C; alone and in a batch."""
    model = pair(tmp_path)
    system = model.at(N=load)
    assert 40.0 < system.steady.pressure[0] < 200.0
    expected = by_hand(system)
    alone, many = system.modes(SLOW).lam, model.at(N=np.array([load, 90.0])).modes(SLOW).lam[0]
    for lam in (alone, many):
        away = np.abs(lam[:, None] - expected).min(axis=1) / np.abs(lam)
        assert len(lam) == 2
        assert away.max() < 1e-8


def test_the_slope_by_pressure_moves_roots(tmp_path):
    """Beside a map of the same coefficient there, the same at all pressures."""
    model = pair(tmp_path)
    system = model.at(N=260.0)
    p = float(system.steady.pressure[0])
    level = {
        f"friction_law.map_ratio_{k}_{j}": float(monotone(PRESSURES, column)(p))
        for k, column in enumerate(RATIOS.T, 1)
        for j in range(1, 5)
    }
    flat = model.at(N=260.0, **level).modes(SLOW).lam
    assert np.abs(flat - system.modes(SLOW).lam).max() > 0.1


BAD = [
    (
        {"speed_3": 0.05},
        "map_speed_3 is 0.05 m/s: expected more than friction_law.map_speed_2, 0.1",
    ),
    ({"pressure_3": 0.0}, "map_pressure_4 is 200 Pa: .*map_pressure_3, which is not given"),
    ({"ratio_6_1": 0.5}, "map_ratio_6_1 needs a friction_law.map_speed_6 above"),
]


@pytest.mark.parametrize(("given", "text"), BAD)
def test_maps_that_do_not_ascend_are_refused(given, text, tmp_path):
    given = {f"friction_law.map_{name}": value for name, value in given.items()}
    with pytest.raises((ModelError, ParameterError), match=text):
        sq.model("belt", friction_law="map", **values() | given).at().modes(BAND)


@pytest.mark.parametrize(("ratio", "doubted"), [(4.0, False), (12.0, True)])
def test_friction_beyond_dry_contacts_is_doubted(ratio, doubted):
    ratios = RATIOS.copy()
    ratios[2, 1] = ratio
    given = values(ratios=ratios) | {"friction": 0.3}
    assert np.all((FRICTION_RANGE.values(given, 2) > FRICTION_RANGE.most) == doubted)


STUDY = """\
[study]
name = "map"
kind = "complex_modes"
[model]
name = "belt"
friction_law = "map"
[parameters.friction_law.map]
MAP
[modes]
band = [1.0, 100.0]
[[sweep]]
parameter = "sliding_speed"
values = [0.2, 0.6]
"""
LISTS = """\
speed = ["2 cm/s", "10 cm/s", 0.4]
pressure = [50.0, "1 mbar"]
ratio = [[1.5, 1.1, 1.0], [1.3, 1.0, 0.9]]
"""
POINTS = [
    (s, p, r)
    for p, row in ((50, (1.5, 1.1, 1.0)), (100, (1.3, 1.0, 0.9)))
    for s, r in zip((0.02, 0.1, 0.4), row, strict=True)
]


def write_csv(folder, points=POINTS, names="speed, ratio, pressure"):
    rows = [names, *(f"{s}, {r}, {p}" for s, p, r in points)]
    (folder / "mu.csv").write_text("\n".join(rows) + "\n")


def test_a_study_writes_a_map_as_lists_or_as_a_file(tmp_path):
    """In any order, with units; the parameters can be swept one by one."""
    write_csv(tmp_path, POINTS[::-1])
    ratios = [[1.5, 1.1, 1.0], [1.3, 1.0, 0.9]]
    expected = values((0.02, 0.1, 0.4), (50.0, 100.0), ratios)
    for text in (LISTS, 'file = "mu.csv"'):
        study = parse_study(STUDY.replace("MAP", text), tmp_path / "map.toml")
        found = {name: study.values[name] for name in expected}
        assert found == pytest.approx(expected, rel=1e-12)


def test_results_of_a_file_open_without_it(tmp_path, monkeypatch):
    """The values are in the results, wherever the file has gone."""
    write_csv(tmp_path)
    (tmp_path / "map.toml").write_text(STUDY.replace("MAP", 'file = "mu.csv"'))
    results = solved(sq.read_study(tmp_path / "map.toml").plan(), tmp_path / "out")
    (tmp_path / "mu.csv").unlink()
    plan = plan_of(sq.open_results(tmp_path / "out"))
    assert plan.study.values["friction_law.map_ratio_2_1"] == 1.1
    assert plan.study_hash == results.manifest["study_hash"]


TABLES = [
    ("speed = [0.1]", "expected speed, pressure, ratio, or file; got speed"),
    (LISTS.replace(", 0.4]", "]"), "ratio.*expected 2 ratios, one for each speed, got"),
    (LISTS.replace('50.0, "1 mbar"', "50.0"), "expected 1 lists of 3 ratios"),
    (LISTS.replace("50.0,", "200.0,"), "map_pressure_2 is 100 Pa: expected more than"),
    ('file = "no.csv"', "there is no file"),
    ('file = "mu.csv"\nspeed = [1.0]', "expected file alone"),
    ("speed = []\npressure = [1.0]\nratio = [[1.0]]", "expected a list of 1 to 6 values"),
    (LISTS + "[parameters.friction_law]\nmap_speed_1 = 0.01", "given in friction_law.map already"),
]


@pytest.mark.parametrize(("text", "words"), TABLES)
def test_a_table_that_is_no_map_is_one_sentence(text, words, tmp_path):
    write_csv(tmp_path)
    with pytest.raises(StudyFileError, match=words) as told:
        parse_study(STUDY.replace("MAP", text), tmp_path / "map.toml")
    assert "parameters" in str(told.value)


FILES = [
    (POINTS[:-1], "speed, ratio, pressure", "expected each speed once at each pressure"),
    ([*POINTS, POINTS[0]], "speed, ratio, pressure", "expected each speed once at each pressure"),
    (POINTS, "speed, mu, pressure", "there is no column 'ratio'"),
    ([(s / 9, 50, 1) for s in range(9)], "speed, ratio, pressure", "9 values of speed, expected"),
]


@pytest.mark.parametrize(("points", "names", "words"), FILES)
def test_a_file_that_is_no_map_is_one_sentence(points, names, words, tmp_path):
    write_csv(tmp_path, points, names)
    with pytest.raises(StudyFileError, match=words) as told:
        parse_study(STUDY.replace("MAP", 'file = "mu.csv"'), tmp_path / "map.toml")
    assert "parameters.friction_law.map.file" in str(told.value)


def test_a_map_is_had_in_python_by_the_names_of_its_points():
    points = {"map_speed_2": 1.0, "map_pressure_2": 1e6, "map_ratio_2_1": 0.5, "map_ratio_2_2": 0.7}
    curve = friction_curve("map", **points)
    at = curve.at(0.4, np.array([0.0, 1.0, 2.0, 1.0]), np.array([0.0, 0.0, 0.0, 1e6]))
    assert at.mu == pytest.approx([0.4, 0.2, 0.2, 0.28])
    with pytest.raises(ModelError, match="map_speed_9"):
        friction_curve("map", map_speed_9=1.0)
