"""Folds and Hopf points continued over a second parameter: closed forms, the lines of a grid."""

from __future__ import annotations

from types import SimpleNamespace

import cycle_models as models
import numpy as np
import pytest
from study_runs import plan_of, solved
from test_limit_cycles_study import STUDY, study

import squealstudy as sq
from squealstudy.cycles.borders import MET, TURNED, BorderPoint, fold_near, follow_border
from squealstudy.cycles.branch import RANGE, cycles_along
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.folds import FOLD
from squealstudy.errors import ConvergenceError, StudyFileError
from squealstudy.kinds.limit_cycles import bordering, continued, onset
from squealstudy.kinds.limit_cycles.designs import request
from squealstudy.kinds.limit_cycles.screen import SCREEN

BOUNDS = (0.0, 0.3)


class Family:
    """x'' + c(x, p, q) x' + x = 0 with even c, by its coefficients: folds over p at values of q."""

    def __init__(self, coefficients, bounds=BOUNDS, harmonics=9):
        self._coefficients, self.bounds, self.harmonics = coefficients, bounds, harmonics

    def line(self, q):
        def force(x, v, p):
            c = [
                sign * b for b, sign in zip(self._coefficients(p, q), (1, -1, 1, -1), strict=False)
            ]
            slope = sum(2 * k * b * x ** (2 * k - 1) for k, b in enumerate(c) if k)
            damping = sum(b * x ** (2 * k) for k, b in enumerate(c))
            return -damping * v, -slope * v, -damping

        return lambda p: models.scalar_oscillator(force, p)

    def folds(self, q, p, size):
        """Of the branch through the cycle near a size."""
        start = PeriodicMotion(np.zeros((2 * self.harmonics + 1, 1)), 1.0, p)
        start.Q[1] = size
        found = []
        for way in (-1.0, 1.0):
            curve = cycles_along(self.line(q), start, self.bounds, way, self._small)[1]
            found += [point.motion for point in curve if point.event == FOLD]
        return found

    @staticmethod
    def _small(motion):
        return "hopf" if motion.size < 1e-3 else ""

    def at(self, q, guess):
        return BorderPoint(q, *fold_near(self.line(q), guess, self.bounds))

    def border(self, q, fold, values, way):
        width = self.bounds[1] - self.bounds[0]
        return follow_border(self.at, self.at(q, fold), values, way, width)


QUINTIC = Family(lambda p, q: (p, 1.0, q))  # the fold is at p = 1 / (8 q), with x^2 = 1 / q


@pytest.mark.parametrize(
    ("way", "values"),
    [pytest.param(-1.0, (0.5, 0.8, 1.0), marks=pytest.mark.full_size), (1.0, (1.0, 1.7, 2.5))],
)
def test_folds_over_a_second_parameter(way, values):
    (fold,) = QUINTIC.folds(1.0, 0.1, 1.2)
    points, end = QUINTIC.border(1.0, fold, values, way)
    assert end == RANGE
    at = {point.over: point for point in points}
    assert set(values) <= set(at)
    assert len(points) > 4
    for point in points:
        assert point.motion.parameter == pytest.approx(
            1 / (8 * point.over), rel=3e-4
        )  # leading order
        assert point.motion.size == pytest.approx(point.over**-0.5, rel=3e-4)
        assert point.residual < 1e-9
    for q in values:  # each line of a grid has its own
        (own,) = QUINTIC.folds(q, 0.8 / (8 * q), 1.2 * q**-0.5)
        assert at[q].motion.parameter == pytest.approx(own.parameter, abs=1e-9)
        assert at[q].motion.omega == pytest.approx(own.omega, rel=1e-9)


def test_a_border_ends_where_two_folds_meet():
    """Of p = .1 (A^3 - 3 A^2 + (3 - q) A), A = x^2: a cusp at q = 0, A = 1, to leading order."""
    cubic = Family(lambda p, q: (p, 0.4 * (3 - q), 2.4, 1.28), (0.0, 0.2))
    ends = []
    for p, size in ((0.06, 0.8), (0.1, 1.25)):
        for fold in cubic.folds(0.2, p, size):
            points, end = cubic.border(0.2, fold, (-0.2, 0.1, 0.2, 0.5), -1.0)
            assert end == TURNED
            ends.append(points[-1])
    assert len(ends) >= 2
    for last in ends:
        assert last.over == pytest.approx(0.0, abs=2e-3)
        assert last.motion.parameter == pytest.approx(0.1, abs=2e-3)
        assert last.motion.size == pytest.approx(1.0, abs=2e-2)


def test_a_border_ends_where_a_closed_branch_is_born():
    """Folds at p = +-sqrt(1/8 - q), nearly, of the damping q + p^2."""
    isola = Family(lambda p, q: (q + p**2, 1.0, 1.0), (-0.4, 0.4))
    ends = []
    for fold in isola.folds(0.05, 0.0, 1.33)[:2]:
        points, end = isola.border(0.05, fold, (0.0, 0.05, 0.1, 0.2), 1.0)
        assert end == TURNED
        assert [q for q in (0.05, 0.1) if q in {point.over for point in points}] == [0.05, 0.1]
        ends.append(points[-1])
        assert ends[-1].over == pytest.approx(1 / 8, abs=1e-4)
    assert ends[0].motion.parameter * ends[1].motion.parameter < 0.0


def test_a_border_of_folds_ends_on_that_of_hopf_points():
    """Damping p - q x^2 + x^4: x^2 = q at the fold, which meets p = 0 where q = 0."""
    family = Family(lambda p, q: (p, q, 1.0), (-0.1, 0.3))
    (fold,) = family.folds(1.0, 0.1, 1.2)
    points, end = family.border(1.0, fold, (-0.5, 0.5, 1.0), -1.0)
    assert end == MET
    assert points[-1].over == pytest.approx(0.0, abs=2e-3)
    assert points[-1].motion.size < 0.1


def test_another_border_is_not_taken_for_the_own():
    """One of which the point jumps; steps before it are halved until it is lost."""

    def locate(q, guess):
        return BorderPoint(q, PeriodicMotion(np.zeros((3, 1)), 1.0, 0.3 * q + 0.4 * (q > 0.62)))

    points, end = follow_border(locate, locate(0.0, None), (0.0, 0.5, 1.0), 1.0, 1.0)
    assert end == "another"
    assert 0.61 < points[-1].over <= 0.62


def test_why_a_border_was_lost_is_told():
    def locate(q, guess):
        if q > 0.62:
            raise ConvergenceError("singular_jacobian", "")
        return BorderPoint(q, PeriodicMotion(np.zeros((3, 1)), 1.0, 0.3 * q))

    points, end = follow_border(locate, locate(0.0, None), (0.0, 0.5, 1.0), 1.0, 1.0)
    assert end == "singular_jacobian"
    assert points[-1].over == pytest.approx(0.62, abs=1e-3)


# -- studies ---------------------------------------------------------------------------------------
SOFTER = """
[[sweep]]
parameter = "contact.cubic_stiffness"
values = [-5.8e17, -5.6e17]

[modes]"""
SWEPT = ("\n[modes]", SOFTER)
KEYS = 'follow = "friction"\nborders_over = "contact.cubic_stiffness"\nfamilies = [1]'
KEYS += "\nneighbours = false\nundecided_in_time = false\nharmonics = 3"
TEXT = study([0.06, 0.5], swept=SWEPT, own=("tolerance = 1e-3", KEYS))


OF_A_STUDY = pytest.mark.full_size("borders of a study")  # by default: test_verdict_map


@pytest.fixture(scope="module")
def bordered(tmp_path_factory):
    directory = tmp_path_factory.mktemp("borders") / "kicked_squeal"
    return solved(plan_of(TEXT, STUDY), directory)


@OF_A_STUDY
def test_borders_agree_with_the_lines_of_the_grid(bordered):
    borders, branches = bordered.table("borders"), bordered.table("branches")
    assert set(borders["along"]) == {"friction"}
    assert set(borders["over"]) == {"contact.cubic_stiffness"}
    assert set(borders["point_id"]) <= set(bordered.points["point_id"])
    assert sorted(borders.groupby("border_id")["event"].first()) == ["F", "H"]  # each once
    folds, hopf = (borders[(borders["event"] == e).to_numpy(bool)] for e in ("F", "H"))
    values = set(bordered.points["contact.cubic_stiffness"])
    assert values <= set(folds["over_value"])
    assert folds["over_value"].is_monotonic_increasing
    told = borders[borders["line_difference"].notna().to_numpy(bool)]
    assert len(told) == (branches["event"].isin(["F", "H"])).sum() == 3
    assert told["line_difference"].abs().max() < 1e-9
    lines = branches.merge(bordered.points[["point_id", "contact.cubic_stiffness"]])
    for row in told.to_dict("records"):
        own = lines[(lines["contact.cubic_stiffness"] == row["over_value"]).to_numpy(bool)]
        (exact,) = own[(own["event"] == row["event"]).to_numpy(bool)].to_dict("records")
        assert row["value"] == pytest.approx(exact["value"], abs=1e-6)
        assert row["value"] - exact["value"] == pytest.approx(row["line_difference"], abs=1e-12)
        assert row["contact_velocity"] == pytest.approx(exact["contact_velocity"], rel=1e-4)
        assert row["frequency_hz"] == pytest.approx(exact["frequency_hz"], rel=1e-7)
    assert set(folds["border_end"]) == {"range", ""}
    assert (folds["balance_residual"] < 1e-9).all()
    # the border of Hopf points leaves the range of friction before the other line, at a half
    assert hopf["value"].max() == pytest.approx(0.5, abs=1e-4)
    assert hopf["over_value"].max() < -5.6e17
    assert set(hopf["criticality"]) == {"subcritical"}
    assert (hopf["contact_velocity"] == 0.0).all()
    (told,) = (text for name, text in SCREEN.facts(bordered) if name == "borders")
    assert told.startswith("1 curve of folds and 1 curve of Hopf points over friction and contact")
    assert bordered.manifest["continued"]["lost"] == []


@OF_A_STUDY
def test_hopf_borders_are_where_complex_modes_turn_unstable(bordered):
    for row in bordered.table("borders").query("event == 'H'").to_dict("records"):
        values = {"friction": row["value"], "contact.cubic_stiffness": row["over_value"]}
        contact = models.Designs("hoffmann", models.BISTABLE).at(**values)
        growth = models.linear_modes(contact.oscillator)[0].real.max()
        assert abs(growth) < 2e-4 * 1400  # stability_tolerance, and 1e-9 of the range


@OF_A_STUDY
def test_a_map_has_borders_as_lines(bordered):
    figure = bordered.plot.verdict_map()
    table = bordered.table("borders")
    own = {e: len(table[(table["event"] == e).to_numpy(bool)]) for e in ("F", "H")}
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    assert set(lines) == {"border of folds", "border of Hopf points"}
    assert lines["border of folds"].get_linestyle() == "--"
    assert len(lines["border of folds"].get_xdata()) == own["F"]
    # at .08 by more harmonics than the three of this study
    assert lines["border of folds"].get_xdata() == pytest.approx(0.0791, abs=5e-4)
    assert len(lines["border of Hopf points"].get_xdata()) == own["H"]
    assert set(lines) < {t.get_text() for t in figure.legends[0].texts}


@OF_A_STUDY
def test_folds_of_large_models_are_not_continued(bordered, monkeypatch):
    monkeypatch.setattr(bordering, "MAX_UNPROJECTED_COORDINATES", 1)
    plan = plan_of(TEXT, STUDY)
    first = bordered.table("borders").query("event == 'F'").iloc[0]
    motion = PeriodicMotion(np.zeros((3, 2)), 2 * np.pi * first["frequency_hz"], first["value"])
    marks = [continued.Mark(first["point_id"], FOLD, motion)]
    (task,) = bordering.planes(plan, request(plan), "friction", "contact.cubic_stiffness", marks)
    rows, (lost,) = bordering.follow_borders(task)
    assert rows == []
    assert lost.endswith("folds of more than 1 coordinates are not continued")


@pytest.mark.parametrize(
    ("over", "follow", "told"),
    [
        ("contact.cubic_stiffness", "", "'follow' names no parameter"),
        ("friction", "friction", "'friction' is the parameter that is followed"),
        ("sliding_speed", "friction", "expected a swept parameter"),
        ("nothing", "friction", "expected a swept parameter"),
        ("normal_force", "friction", "'normal_force' changes the structure"),
    ],
)
def test_a_parameter_that_has_no_borders(over, follow, told, tmp_path):
    keys = f'borders_over = "{over}"\n' + (f'follow = "{follow}"\n' if follow else "")
    softer = SOFTER.replace("[-5.8e17, -5.6e17]", "[900.0, 1000.0]").replace(
        "contact.cubic_stiffness", "normal_force"
    )
    own = ("tolerance = 1e-3", keys)
    swept = ("\n[modes]", softer) if over == "normal_force" else SWEPT
    path = tmp_path / "study.toml"
    path.write_text(study([0.06, 0.5], swept=swept, own=own), encoding="utf-8")
    with pytest.raises(StudyFileError, match=told) as caught:
        sq.read_study(path)
    assert caught.value.key == "limit_cycles.borders_over"


def test_criticality_is_that_of_the_mode_that_turns_unstable(monkeypatch):
    """Though at the onset itself, and not beside it, another mode is nearer in frequency."""

    def modes(value):
        lam = [10.0 * value + 101.0j, -1.0 + 1j * (100.1 + 50.0 * abs(value))]
        return np.array(lam), np.eye(2, dtype=complex)

    taken = []
    monkeypatch.setattr(onset, "criticality", lambda _, lam, phi: taken.append((lam, phi)) or "")
    request = SimpleNamespace(tolerance=1e-9)
    way = SimpleNamespace(
        contact=lambda value: value,
        oscillator=lambda value: SimpleNamespace(steady_modes=lambda highest: modes(value)),
        bounds=(-1.0, 1.0),
        request=request,
    )
    guess = PeriodicMotion(np.zeros((3, 2)), 100.0, 0.01)
    value, hz, _ = onset.onset_near(way, guess, 0.1)
    ((lam, phi),) = taken
    assert value == pytest.approx(0.0, abs=1e-6)
    assert 2 * np.pi * hz == pytest.approx(101.0)
    assert lam.imag == pytest.approx(101.0)
    assert abs(phi[0]) == pytest.approx(1.0)


def test_the_error_of_an_onset_of_cycles_holds_what_counts_as_growth():
    """They begin where damping is 0: .79733876 +- 9.5e-10 was told of .79733753."""
    tolerance, slope, omega = 1e-7, 0.08, 100.0
    way = SimpleNamespace(
        oscillator=lambda value: SimpleNamespace(
            steady_modes=lambda highest: (
                omega * np.array([slope * value + 1j, -0.1 + 1.5j]),
                np.eye(2, dtype=complex),
            )
        ),
        bounds=(-0.5, 0.5),
        request=SimpleNamespace(tolerance=tolerance),
    )
    told = tolerance / slope
    error = onset.onset_error(way, told, omega / (2.0 * np.pi))
    assert told < error == pytest.approx(told, rel=1e-2)

    def refused(value):
        raise ConvergenceError("no_steady_sliding", "there is none beyond")

    beside_nothing = SimpleNamespace(oscillator=refused, bounds=way.bounds, request=way.request)
    assert np.isnan(onset.onset_error(beside_nothing, told, omega / (2.0 * np.pi)))
