"""Studies of design: search against exhaustive search, the trap, proofs, tables, resuming."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from own_blocks import STUDY as BLOCKS
from own_blocks import write_blocks
from scipy import ndimage
from scipy.stats import norm
from test_report import quickly

import squealstudy as sq
from squealstudy.cli import app as cli
from squealstudy.cli.check_results import check_results
from squealstudy.engine.cache import NewGaps
from squealstudy.engine.report import report, write_report
from squealstudy.engine.results import Results
from squealstudy.engine.rows import failed_row
from squealstudy.engine.workers import Workers
from squealstudy.errors import StudyFileError
from squealstudy.kinds.design import in_time, proof, rows
from squealstudy.kinds.design.design_search import DesignSearch
from squealstudy.kinds.design.in_time import carried
from squealstudy.kinds.design.kind import request
from squealstudy.kinds.design.plan import (
    IN_TIME,
    MODES,
    ROOTS,
    DesignPlan,
    Evaluation,
    evaluation,
    first_plan,
    operating_points,
)
from squealstudy.kinds.design.rows import SCHEMA, design_row
from squealstudy.kinds.design.screen import _in_percent, same_modes, squealing_modes, today_rows
from squealstudy.kinds.design.state import (
    MET_LINEAR,
    NEAR_ENOUGH,
    NONE_FOUND,
    UNDECIDED,
    SearchCache,
)
from squealstudy.kinds.design.study import DesignStudy
from squealstudy.kinds.design.verdict import _unchanged
from squealstudy.plots.design_history import design_history
from squealstudy.plots.operating_matrix import chosen_word, operating_matrix
from squealstudy.screen import WIDTH_OF_FILES, as_text
from squealstudy.study.design import DesignPoint

MARGIN = 0.002
FRICTION = (0.1, 0.2, 0.3)
Damping = Callable[[np.ndarray, np.ndarray, float], np.ndarray]  # of both variables, friction

TWO_VARIABLES = """
[study]
name = "searched"
kind = "design"
[model]
name = "hulten"
[parameters]
damping_ratio = 0.005
[[sweep]]
parameter = "friction"
values = [0.1, 0.2, 0.3]
[[variable]]
parameter = "frequency_1"
bounds = {first}
cost = {costs[0]}
[[variable]]
parameter = "frequency_2"
bounds = {second}
cost = {costs[1]}
[goal]
margin = {{damping_ratio = 0.002}}
cycles = 0
"""


def _pair(w1: np.ndarray, w2: np.ndarray, mu: float, zeta: float) -> np.ndarray:
    """Damping ratios (..., 2) and frequencies of Hulten's two modes, w in Hz."""
    w1, w2 = (2 * np.pi * np.asarray(w, dtype=float) for w in (w1, w2))
    A = np.zeros((*w1.shape, 4, 4))
    A[..., 0, 2] = A[..., 1, 3] = 1.0
    A[..., 2, 0], A[..., 2, 1] = -(w1**2), mu * w2**2
    A[..., 3, 0], A[..., 3, 1] = -mu * w1**2, -(w2**2)
    A[..., 2, 2], A[..., 3, 3] = -2 * zeta * w1, -2 * zeta * w2
    lam = np.linalg.eigvals(A)
    lam = np.take_along_axis(lam, np.argsort(-lam.imag, axis=-1), axis=-1)[..., :2]
    return np.stack([-lam.real / np.abs(lam), np.abs(lam) / (2 * np.pi)])


def _two_pairs(shift: float, tie: float) -> Damping:
    """Two pairs that flutter by themselves; the second pair feels both variables."""

    def damping(x1: np.ndarray, x2: np.ndarray, mu: float) -> np.ndarray:
        first = _pair(x1, np.full(np.shape(x1), 100.0 + shift), mu, 0.005)
        other = 2.0 * x2 + tie * (x1 - 100.0)
        second = _pair(other, np.full(np.shape(x1), 152.0 - shift), 0.8 * mu, 0.004)
        return np.concatenate([first, second], axis=-1)

    return damping


def _study(text: str, folder: Path) -> DesignStudy:
    path = folder / "study.toml"
    path.write_text(text)
    study = sq.read_study(path).resolved
    assert isinstance(study, DesignStudy)
    return study


def _searched(study: DesignStudy, damping: Damping) -> tuple[DesignSearch, int]:
    """The loop on rows of closed forms, slopes by differences; and how many rows it took."""
    rows: dict[Evaluation, dict] = {}
    memory, h = SearchCache(), 1e-4
    while True:
        search = DesignSearch(study, rows, reduced=False, has_cycles=False, cache=memory)
        if not search.pending:
            return search, len(rows)
        for asked in search.pending:
            mu, x1, x2 = asked.values
            zeta, hz = damping(np.array(x1), np.array(x2), mu)
            by = [
                (damping(np.array(a), np.array(b), mu) - damping(np.array(c), np.array(d), mu))
                / (2 * h)
                for a, b, c, d in ((x1 + h, x2, x1 - h, x2), (x1, x2 + h, x1, x2 - h))
            ]
            assert asked.analysis in (MODES, ROOTS)
            modes = [
                {
                    "damping_ratio": z,
                    "frequency_hz": f,
                    "slopes": [
                        {
                            "parameter": v.name,
                            "d_damping_ratio": dz[k],
                            "d_frequency_hz": df[k],
                            "d_growth_rate": -2 * np.pi * (dz[k] * f + z * df[k]),
                        }
                        for v, (dz, df) in zip(study.variables, by, strict=True)
                    ],
                }
                for k, (z, f) in enumerate(zip(zeta, hz, strict=True))
            ]
            worst = int(np.argmin(zeta))
            rows[asked] = {
                "status": "ok",
                "n_modes": len(zeta),
                "min_damping_ratio": zeta[worst],
                "frequency_hz": hz[worst],
                "modes": modes,
                "beside": [],
            }


def _least(damping: Damping, study: DesignStudy, n: int = 101) -> tuple[float, int]:
    """Least cost on a fine grid of both variables, and the number of regions that are feasible."""
    a, b = study.variables
    x1 = a.nominal + np.linspace(a.low, a.high, n)
    x2 = b.nominal + np.linspace(b.low, b.high, n)
    X1, X2 = np.meshgrid(x1, x2, indexing="ij")
    worst = np.min([damping(X1, X2, mu)[0].min(axis=-1) for mu in FRICTION], axis=0)
    feasible = worst >= MARGIN
    cost = a.cost * np.abs(X1 - a.nominal) / a.range + b.cost * np.abs(X2 - b.nominal) / b.range
    _, regions = ndimage.label(feasible)
    return float(cost[feasible].min()), int(regions)


@pytest.mark.parametrize(
    ("shift", "tie", "first", "second", "costs"),
    [
        (-4.0, 0.6, [-30, 60], [-6, 40], (1.0, 0.7)),
        *(
            pytest.param(*more, marks=pytest.mark.full_size)
            for more in (
                (1.0, 0.0, [-40, 40], [-8, 30], (1.0, 1.5)),
                (3.0, -0.4, [-50, 40], [-10, 30], (0.5, 1.0)),
            )
        ),
    ],
)
def test_least_cost_against_exhaustive_search(
    tmp_path: Path, shift: float, tie: float, first: list, second: list, costs: tuple
) -> None:
    """Two pairs that flutter, disjoint regions: within 5 % of the cost on a grid of 10,201."""
    study = _study(TWO_VARIABLES.format(first=first, second=second, costs=costs), tmp_path)
    damping = _two_pairs(shift, tie)
    best, regions = _least(damping, study)
    assert regions >= 2
    search, _ = _searched(study, damping)
    assert search.state.outcome == MET_LINEAR
    chosen = search.state.chosen
    found = search.box.price(search.change(chosen))
    # a grid's cost is above the least by at most a step each way
    assert best - 2e-2 <= found <= 1.05 * best
    zeta = np.array([damping(*map(np.array, chosen), mu)[0] for mu in FRICTION])
    assert zeta.min() >= MARGIN
    active = (zeta < MARGIN + 2e-4).any(axis=0)
    assert active.sum() == 2


def test_targets_lead_to_what_can_be_built(tmp_path: Path) -> None:
    """A frequency scale of a part, and the stiffness that moves the same frequency."""
    text = TWO_VARIABLES.format(first=[-0.3, 0.3], second=[-40, 40], costs=(1.0, 2.0))
    text = text.replace('"frequency_1"', '"mass.modes[1].frequency_scale"')
    text = text.replace('"frequency_2"', '"frequency_1"')
    study = _study(text, tmp_path)
    today = study.nominal[1]

    def damping(scale: np.ndarray, w: np.ndarray, mu: float) -> np.ndarray:
        return _pair(np.asarray(scale) * w, np.full(np.shape(w), today + 1.0), mu, 0.005)

    search, _ = _searched(study, damping)
    found, chosen = search.state.realisation, search.state.chosen
    assert found is not None
    assert found.enough
    assert found.target[1] == today
    assert found.target[0] != 1.0
    # to first order the frequency is as well moved by one as by the other
    assert found.begun[1] == pytest.approx(today * found.target[0], rel=1e-6)
    assert found.begun[0] == 1.0
    assert found.matched == pytest.approx(1.0, abs=1e-5)
    assert search.state.outcome == MET_LINEAR
    assert chosen[0] == 1.0
    assert chosen[1] != today
    for x in (found.target, chosen):
        assert min(damping(*map(np.array, x), mu)[0].min() for mu in FRICTION) >= MARGIN
    first = next(
        x for k, x in search.state.designs.items() if search.state.roles[k][0] == "search 1"
    )
    assert np.array_equal(first, found.begun)


# -- whole studies -----------------------------------------------------------------------------
SHIPPED = Path(__file__).parents[2] / "studies" / "kicked_design.toml"
HOFFMANN = """
[study]
name = "small"
kind = "design"
[model]
name = "hoffmann"
[parameters]
damping_ratio = 0.01
[[sweep]]
parameter = "friction"
values = [0.5, 0.8]
[[variable]]
parameter = "{variable}"
bounds = {bounds}
[goal]
margin = {{damping_ratio = {margin}{probability}}}
scan = 0
cycles = 0
in_time = 0
"""


def _run(text: str, folder: Path) -> Results:
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return sq.run(path, folder / "results", jobs=1, warn=lambda _: None)


def _hoffmann(variable: str, bounds: str, margin: float = 0.002, more: str = "") -> str:
    return HOFFMANN.format(variable=variable, bounds=bounds, margin=margin, probability=more)


def _least_damping(**values: float) -> float:
    """Least damping ratio of Hoffmann's oscillator over the operation of HOFFMANN."""
    given = {"damping_ratio": 0.01, **values}
    return min(
        sq.model("hoffmann", friction=mu, **given).modes()["damping_ratio"].min()
        for mu in (0.5, 0.8)
    )


@pytest.fixture(scope="module")
def trap(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The shipped study without its variant."""
    text = SHIPPED.read_text(encoding="utf-8")
    return _run(text[: text.index("[[variant]]")], tmp_path_factory.mktemp("trap"))


@pytest.mark.full_size
def test_the_variant_of_the_shipped_study_needs_no_change(tmp_path: Path) -> None:
    found = _run(SHIPPED.read_text(encoding="utf-8"), tmp_path)
    table = found.table("variants").set_index("variant")
    assert table["outcome"].to_dict() == {"as in the file": "met", "hard_lining": "met"}
    assert table.loc["hard_lining", "change"] == ""


def test_the_loop_does_not_choose_what_squeals_when_kicked(trap) -> None:
    designs, proof = trap.table("designs"), trap.table("proof")
    facts = trap.manifest["design_study"]
    assert facts["outcome"] == "met"
    first = proof[proof["check"] == "limit_cycles"].iloc[0]
    assert not first["passed"]
    assert first["value"] == pytest.approx(0.0182, rel=0.02)  # missing at some amplitude
    by_modes = designs.set_index("design").loc[first["design"]]
    # complex modes alone are content with this one: it is the cheapest that meets the margin
    assert by_modes["min_damping_ratio"] == pytest.approx(0.002, abs=1e-5)
    assert by_modes["damping_ratio"] == pytest.approx(0.01835, rel=1e-3)
    chosen = designs[designs["chosen"].to_numpy(bool)].iloc[0]
    assert chosen["damping_ratio"] == pytest.approx(0.0385, rel=1e-2)
    assert chosen["cost"] > 3 * by_modes["cost"]
    last = proof[proof["design"] == chosen["design"]].set_index("check")
    assert last["passed"].all()
    assert last.loc["limit_cycles", "value"] < 0
    points = trap.points
    cycles = points[(points["analysis"] == "cycles") & (points["design"] == chosen["design"])]
    assert set(cycles["verdict"]) == {"no_cycle_found"}


@pytest.mark.full_size  # by default runs of one design: below
def test_runs_in_time_refuse_what_squeals_when_kicked(trap, tmp_path: Path) -> None:
    """Without limit cycles: runs tell the least damping with which they decay, too."""
    text = SHIPPED.read_text(encoding="utf-8").replace("[0.5, 0.7, 0.9]", "[0.9]")
    results = _run(text.replace("scan = 0", "scan = 0\ncycles = 0\nin_time = 1"), tmp_path)
    facts, proof = results.manifest["design_study"], results.table("proof")
    enough = trap.table("designs").query("chosen")["damping_ratio"].iloc[0]
    assert facts["outcome"] == "met"
    runs = proof[proof["check"] == "in_time"].merge(results.table("designs"), on="design")
    passed = runs["passed"].to_numpy(bool)
    last, lasting = runs[passed].iloc[-1], runs[~passed]
    assert last["chosen"]
    assert last["damping_ratio"] == runs[passed]["damping_ratio"].min()
    assert (lasting["damping_ratio"] < enough).all()  # what limit cycles ask for, a tenth more
    assert abs(last["damping_ratio"] - enough) < 0.05 * enough
    apart = last["min_damping_ratio"] - lasting["min_damping_ratio"]
    assert 0 < apart.min() < NEAR_ENOUGH * last["min_damping_ratio"]
    assert len(runs) <= 10
    assert runs["min_damping_ratio"].iloc[0] == pytest.approx(0.002, abs=1e-5)
    assert (lasting["value"] < 1.0).all()
    points = results.points[(results.points["analysis"] == "in_time").to_numpy(bool)]
    assert set(points["verdict"]) == {"lasts", "decays"}
    for row, check in zip(points.itertuples(), runs.itertuples(), strict=True):
        assert row.n_modes == row.reason.count(";") + 1
        assert row.n_modes - row.n_unstable == row.reason.count(": decays")
        assert f"{row.n_modes - row.n_unstable} of {row.n_modes} runs decay" in check.text
        assert ("from today's vibration at 1 of them" in check.text) == ("today" in row.reason)
    assert f"runs in time: {last['text']}" in facts["verdict"]
    assert "not checked: limit cycles" in facts["verdict"]


def test_effects_on_damping_are_in_percent_as_damping_is_everywhere() -> None:
    """It was +0.199 beside a damping of -0.632 %."""
    assert _in_percent("damping_ratio +0.199") == ("damping_ratio", "+19.9")


def test_the_chosen_design_is_drawn_at_every_operating_point(trap) -> None:
    """With sensitivities where the search had it in view, without elsewhere."""
    points, facts = trap.points.copy(), trap.manifest["design_study"]
    own = (points["design"] == facts["chosen"]).to_numpy(bool)
    first = points.index[own & (points["analysis"] == "modes").to_numpy(bool)][0]
    points.loc[first, "analysis"] = "roots"
    tables = {name: trap.table(name) for name in trap.tables}
    figure = operating_matrix(trap.with_tables(**tables | {"points": points}))
    (stars,) = (line for line in figure.axes[0].lines if line.get_label() == "chosen")
    damping = points.loc[own & (points["analysis"].isin(["modes", "roots"])).to_numpy(bool)]
    damping = damping.set_index("friction")["min_damping_ratio"].loc[[0.5, 0.7, 0.9]]
    assert stars.get_ydata() == pytest.approx(100 * damping.to_numpy())
    assert chosen_word({"outcome": "met"}) == "chosen"
    assert chosen_word({"outcome": NONE_FOUND}) == "comes nearest"
    pair = today_rows(trap)["min_damping_ratio"], damping
    below = [int((d < facts["margin"]).sum()) for d in pair]
    told = f"3 operating points, below the margin: today {below[0]}, chosen {below[1]}"
    assert figure.get_suptitle() == told
    history = design_history(trap)
    drawn_as = {t.get_text() for t in history.legends[0].texts}
    assert "meets them" not in drawn_as  # the chosen one alone does, and has a mark of its own
    numbers = history.axes[1].get_xticks()
    assert (numbers % 1 == 0).all()  # of designs
    (best,) = trap.table("designs").query("chosen").to_dict("records")
    told = f"chosen: cost {best['cost']:.4g}, least damping {100 * best['min_damping_ratio']:.3g} %"
    assert history.get_suptitle().endswith(f"; {told}")


@pytest.mark.parametrize(
    ("friction", "damping", "starts"),
    [
        (0.9, 0.02, {in_time.TODAY: (0.9, 0.01), in_time.ELSEWHERE: (0.6, 0.01)}),
        (0.6, 0.02, {in_time.TODAY: (0.6, 0.01)}),
        (0.9, 0.01, {in_time.ELSEWHERE: (0.6, 0.01)}),  # it is today's design itself
    ],
)
def test_runs_begin_on_vibrations_of_today(
    tmp_path: Path, monkeypatch, friction: float, damping: float, starts: dict
) -> None:
    told = {}

    def runs(point: DesignPoint, today: dict, *_: object) -> object:
        told.update(
            {k: (d.values["friction"], d.values["damping_ratio"]) for k, d in today.items()}
        )
        return None, []

    monkeypatch.setattr(rows, "runs_in_time", runs)
    plan = _study(SHIPPED.read_text(encoding="utf-8"), tmp_path)
    plan = first_plan(plan)
    plan.kind.make_missing_models(plan, Workers())
    point = plan.tasks[0]
    values = {**point.values, "friction": friction, "damping_ratio": damping}
    row = design_row(point.with_values(values), "in_time", request(plan), NewGaps())
    assert told == starts
    assert (row["verdict"], row["n_modes"]) == ("decays", 0)


def test_runs_begin_where_kicks_lead_today_that_is_stable(tmp_path: Path) -> None:
    """A cycle apart, up to a damping ratio of 0.021: kicks alone find it at 0.01, not at 0.0125."""
    text = SHIPPED.read_text(encoding="utf-8").replace("-5.4e17", "-2.54e17")
    text = text.replace("1.356e6", "1.336e6").replace("= 1000.0", "= 1210.0")
    plan = first_plan(_study(text, tmp_path))
    plan.kind.make_missing_models(plan, Workers())
    values = {**plan.tasks[0].values, "friction": 0.686}
    for damping, verdict in ((0.0125, "lasts"), (0.03, "decays")):
        point = plan.tasks[0].with_values({**values, "damping_ratio": damping})
        row = design_row(point, "in_time", request(plan), NewGaps())
        assert row["verdict"] == verdict
        assert row["reason"].startswith("today's vibration after a kick of 2 m/s")
        kicks = [one for one in row["reason"].split("; ") if one.startswith("kick")]
        assert len(kicks) == 4
        assert all(one.endswith("decays") for one in kicks)


def test_a_changed_structure_runs_from_vibrations_of_today(tmp_path: Path, monkeypatch) -> None:
    """Stiffness k1 changed: the contact moves in the new coordinates as it did in the old ones."""
    given: list[tuple] = []
    run_on = in_time.run_on

    def runs(contact: object, starts: list, band: tuple[float, float]) -> list:
        given.append((contact, starts, run_on(contact, starts, band)))
        return given[-1][2]

    monkeypatch.setattr(in_time, "run_on", runs)
    in_time.vibrations.cache_clear()
    text = SHIPPED.read_text(encoding="utf-8").replace('"damping_ratio"', '"k1"')
    text = text.replace("bounds = [0.0, 0.2]", "bounds = [-1e5, 1e5]")
    study = _study(text, tmp_path)
    first = first_plan(study)
    plan = DesignPlan(
        study, [*first.evaluations, Evaluation((0.9, study.nominal[0] + 5e4), "in_time")], first
    )
    plan.kind.make_missing_models(plan, Workers())
    row = design_row(plan.tasks[3], "in_time", request(plan), NewGaps())
    was, _, (motion,) = given[0]
    moved = (one for one in given if not np.allclose(one[0].system.omega2, was.system.omega2))
    now, (start, *_), _ = next(moved)
    for rows_of in ("N", "T1"):
        A, B = (getattr(contact.system, rows_of) for contact in (was, now))
        np.testing.assert_allclose(B @ start.q0, A @ motion.q, rtol=1e-9)
        np.testing.assert_allclose(B @ start.v0, A @ motion.v, rtol=1e-9)
    name = "today's vibration, brought to this structure with 100 % of its kinetic energy: "
    assert row["reason"].startswith(name)


def test_vibrations_of_one_mesh_are_brought_to_a_changed_one(tmp_path: Path) -> None:
    """A brake of files with a mass on it: what is brought over opens and slides as before."""
    text = BLOCKS.replace('name = "blocks"\nkind = "complex_modes"', 'name = "b"\nkind = "design"')
    text = text.replace("reference_points = 1\n", "[goal]\nmargin = {damping_ratio = 0.001}\n")
    variable = 'added_mass = {on = "slider.TOP", max = "1e-9 t"}'
    text = text.replace("[modes]", f"[[variable]]\n{variable}\n[modes]")
    study = sq.read_study(write_blocks(tmp_path, study=text)).resolved
    first = first_plan(study)
    plan = DesignPlan(study, [*first.evaluations, Evaluation((0.3, 5e-10), "in_time")], first)
    plan.kind.make_missing_models(plan, Workers())
    asked, old, new = request(plan).cycles, plan.tasks[0].structure, plan.tasks[2].structure
    assert old != new
    a, b = (asked.shared_modes(key).system for key in (old, new))
    x = np.eye(len(a.omega2))[:, :6]
    found = carried(x, old, new, asked)
    np.testing.assert_allclose(carried(x, old, old, asked), x, atol=1e-9)
    for A, B in ((a.N, b.N), (a.T1, b.T1)):
        size = np.abs(A @ x).max()
        assert 1e-9 < np.abs(B @ found - A @ x).max() / size < 0.05
        assert np.abs(A @ x - B[:, : x.shape[1]]).max() / size > 0.1  # as they are: not the same


def test_a_kick_that_cannot_be_integrated_is_its_velocity_alone(tmp_path, monkeypatch) -> None:
    """Of what fails kicks alone run again, with the same velocity and no displacement."""
    given: list[list] = []
    run_on = in_time.run_on

    def runs(contact: object, starts: list, band: tuple[float, float]) -> list:
        given.append(list(starts))
        motions = run_on(contact, starts, band)
        moved = [np.any(np.abs(start.q0) > 0) for start in starts]
        bad = [k and len(starts) > 1 for k in moved]
        return [
            replace(m, outcome="not_converged") if b else m
            for m, b in zip(motions, bad, strict=True)
        ]

    monkeypatch.setattr(in_time, "run_on", runs)
    plan = first_plan(_study(SHIPPED.read_text(encoding="utf-8"), tmp_path))
    plan.kind.make_missing_models(plan, Workers())
    values = {**plan.tasks[0].values, "friction": 0.6, "damping_ratio": 0.02}
    row = design_row(plan.tasks[0].with_values(values), "in_time", request(plan), NewGaps())
    first, again = given[-2:]
    kicks = [start for start in first if not start.continued]
    assert len(again) == len(kicks) > 0
    for one, other in zip(kicks, again, strict=True):
        np.testing.assert_array_equal(one.v0, other.v0)
        assert np.any(one.q0)
        assert not np.any(other.q0)
    assert row["reason"].count(", by its velocity alone: ") == len(kicks)


def test_runs_are_not_of_what_grows_above_the_band(tmp_path: Path) -> None:
    """A design stable in its band, unstable above it: undecided, and why."""
    text = _hoffmann("k1", "[-1e3, 1e3]").replace("in_time = 0", "in_time = 1")
    text = text.replace("values = [0.5, 0.8]", "values = [1.2]")
    unstable = sq.model("hoffmann", friction=1.2, damping_ratio=0.01).modes().query("unstable")
    top = 0.9 * float(unstable["frequency_hz"].min())
    results = _run(f"{text}[modes]\nband = [1.0, {top}]\n", tmp_path)
    facts = results.manifest["design_study"]
    row = results.points[(results.points["analysis"] == "in_time").to_numpy(bool)].iloc[0]
    assert (facts["outcome"], row["status"]) == ("undecided", "unstable_above_band")
    hz = float(unstable["frequency_hz"].iloc[0])
    assert row["message"] == f"a mode above the band grows by itself in time, at {hz:.4g} Hz"
    assert f"1 point could not be run: {row['message']}" in facts["verdict"]


def test_what_grows_between_two_operating_points_and_their_middle_is_found(tmp_path: Path) -> None:
    """Flutter at k1 from 0.7 to 1.7 MN/m, of which 0.2, 4.2 and their middle show nothing."""
    text = _hoffmann("damping_ratio", "[0.0, 0.3]").replace("[0.5, 0.8]", "[0.2e6, 4.2e6]")
    text = text.replace('"friction"', '"k1"').replace(
        "[parameters]", "[parameters]\nfriction = 0.6"
    )
    results = _run(text, tmp_path)
    assert results.manifest["design_study"]["outcome"] == "met_linear"
    chosen = results.table("designs").query("chosen").iloc[0]["damping_ratio"]
    given = {"friction": 0.6, "k1": 1.2e6}
    today, then = (
        sq.model("hoffmann", damping_ratio=zeta, **given).modes()["damping_ratio"].min()
        for zeta in (0.01, chosen)
    )
    assert today < 0.0
    assert then >= 0.002
    checks = results.table("proof").query("check == 'refined'")
    assert checks["passed"].tolist() == [False] * (len(checks) - 1) + [True]


def test_a_design_that_meets_the_goal_is_proven_without_a_search(tmp_path: Path) -> None:
    text = TWO_VARIABLES.format(first=[-5.0, 25.0], second=[-20.0, 4.0], costs=(1.0, 0.7))
    text = text.replace("cycles = 0", "cycles = 0\nin_time = 0")
    results = _run(text.replace("[0.1, 0.2, 0.3]", "[0.05, 0.1]"), tmp_path)
    (design,) = results.table("designs").to_dict("records")
    assert (design["origin"], design["cost"], design["chosen"]) == ("today", 0.0, True)
    facts = results.manifest["design_study"]
    assert facts["outcome"] == "met_linear"
    assert "As it is it meets the margin" in facts["verdict"]


def test_it_is_said_whether_damping_destabilises(trap) -> None:
    """The uniform damping is a variable of that study: both slopes are of one mode."""
    table = squealing_modes(trap)
    slopes = trap.table("slopes").query("parameter == 'damping_ratio'")
    worst = slopes.merge(table[["point_id", "mode"]])
    assert table["growth_by_damping"].tolist() == worst["d_growth_rate"].tolist()
    assert (table["growth_by_damping"] < 0).all()
    told = lambda t: as_text(trap.screen.findings(trap.with_tables(**t)))  # noqa: E731
    tables = {name: trap.table(name) for name in trap.tables}
    raises = "a larger damping_ratio would raise the growth of "
    assert f"{raises}no mode (slope" in " ".join(told(tables).split())
    other = tables["slopes"].assign(d_growth_rate=5.0)
    assert f"{raises}{table['name'][0]}" in " ".join(told(tables | {"slopes": other}).split())
    none = " ".join(told(tables | {"slopes": other.iloc[:0]}).split())
    assert raises not in none


def _flutter_ends(friction: float) -> float:
    """Largest frequency_2, Hz, below 85 at which Hulten's pair with 100 Hz does not flutter."""
    f = np.linspace(55.0, 85.0, 3001)
    damping = _pair(np.full(f.shape, 100.0), f, friction, 0.005)[0].min(axis=-1)
    return float(f[damping >= 0.0].max())


@pytest.mark.full_size  # by default the loop does not choose it: above
def test_a_design_that_meets_the_goal_and_squeals_is_searched_for_another(tmp_path: Path) -> None:
    """A margin that flutter meets, too: the proof alone refuses it."""
    text = TWO_VARIABLES.format(first=[-5.0, 25.0], second=[-30.0, 4.0], costs=(1.0, 0.7))
    text = text.replace("[0.1, 0.2, 0.3]", "[0.3]").replace(
        "cycles = 0", "scan = 8\nstarts = 2\ncycles = 4\nin_time = 0"
    )
    results = _run(text.replace("= 0.002", "= -0.5"), tmp_path)
    assert results.manifest["design_study"]["outcome"] == "met"
    designs = results.table("designs")
    assert (designs["origin"] == "scan").sum() >= 6
    least = (75.0 - _flutter_ends(0.3)) / 34.0 * 0.7
    assert designs.query("chosen")["cost"].item() == pytest.approx(least, rel=0.05)
    assert designs.query("chosen")["min_damping_ratio"].item() > 0.0
    assert not results.table("proof").query("round == 0")["passed"].all()


def test_the_verdict_says_what_the_tables_say(trap) -> None:
    text, designs = trap.manifest["design_study"]["verdict"], trap.table("designs")
    chosen = designs[designs["chosen"].to_numpy(bool)].iloc[0]
    worst = trap.points.set_index("point_id").loc[chosen["worst_point"]]
    assert f"At a cost of {chosen['cost']:.4g}" in text
    assert f"damping_ratio 0.01 -> {chosen['damping_ratio']:.5g}" in text
    assert f"least damping {100 * worst['min_damping_ratio']:.3g} %" in text
    assert f"mode at {worst['frequency_hz']:.5g} Hz" in text
    assert f"{len(designs)} designs evaluated" in text
    today = trap.points[(trap.points["design"] == 0) & (trap.points["analysis"] == "modes")]
    unstable = int((today["n_unstable"] > 0).sum())
    assert re.search(
        rf"an unstable mode between \S+ and \S+ Hz at {unstable} of 3 operating points", text
    )


def test_variables_that_the_change_does_not_need_are_named() -> None:
    """'A mass, damping, or both?' was answered by the damping alone."""
    names = [SimpleNamespace(name=name) for name in ("mass", "damping", "k1", "k2", "k3")]
    search: Any = SimpleNamespace(study=SimpleNamespace(variables=names))
    damped = _unchanged(search, [{"parameter": "damping"}])
    assert damped == "; not needed: mass, k1, k2 and 1 more"
    assert _unchanged(search, [{"parameter": n.name} for n in names]) == ""


def test_the_table_of_checks_has_costs_and_what_rounds_after_a_success_are(trap) -> None:
    def told(proof: Any, key: str = "findings") -> str:
        tables = {name: trap.table(name) for name in trap.tables} | {"proof": proof}
        changed = trap.with_tables(**tables)
        if key == "findings":
            return " ".join(as_text(trap.screen.findings(changed)).split())
        return str(trap.screen.next_steps(changed))

    proof, designs = trap.table("proof"), trap.table("designs").set_index("design")
    cost = designs.loc[proof["design"].iloc[0], "cost"]
    row = f"{proof['round'].iloc[0]} {proof['design'].iloc[0]} {cost:.4g} operating points passed"
    assert row in told(proof)
    assert "a cheaper design is tried" not in told(proof)
    again = proof.assign(passed=True)  # the first of two rounds, too
    assert "after a round in which all checks passed, a cheaper design is tried" in told(again)
    assert told(proof, "next") == "[]"
    assert "cycles = 4 in [goal]" in told(proof[proof["check"] != "limit_cycles"], "next")


def test_a_study_goes_on_where_it_was_stopped(trap) -> None:
    before = trap.table("designs")
    again = sq.run(trap.directory.parent / "study.toml", trap.directory, jobs=1)
    assert again.solved == 0
    lost = sorted((trap.directory / "chunks").iterdir())[1]
    lost.unlink()
    told: list[str] = []
    again = sq.run(trap.directory.parent / "study.toml", trap.directory, jobs=1, warn=told.append)
    assert 0 < again.solved < len(again.points)
    assert again.table("designs").equals(before)


def test_slopes_are_those_of_finite_changes(tmp_path: Path) -> None:
    text = _hoffmann("k1", "[-1e3, 1e3]", margin=0.3)
    results = _run(text, tmp_path)
    points = results.points[results.points["design"] == 0]
    for point in points.itertuples():
        margins = results.table("margins")
        slopes = results.table("slopes")
        for mode in margins[margins["point_id"] == point.point_id].itertuples():
            own = slopes[(slopes["point_id"] == point.point_id) & (slopes["mode"] == mode.mode)]
            by = dict(zip(own["parameter"], own["d_damping_ratio"], strict=True))
            for name, step in (("k1", 50.0), ("damping_ratio", 1e-5)):
                nominal = {"k1": 2 / 3 * (2 - 3**0.5) * 1e6, "damping_ratio": 0.01}
                zeta = []
                for side in (1, -1):
                    values = {**nominal, name: nominal[name] + side * step}
                    modes = sq.model("hoffmann", friction=point.friction, **values).modes()
                    near = (modes["frequency_hz"] - mode.frequency_hz).abs()
                    same = modes[near < 1e-3 * mode.frequency_hz]
                    closest = (same["damping_ratio"] - mode.damping_ratio).abs().argmin()
                    zeta.append(same["damping_ratio"].iloc[closest])
                finite = (zeta[0] - zeta[1]) / (2 * step)
                assert by[name] == pytest.approx(finite, rel=1e-4)
    pair = results.table("margins")
    assert (pair["damping_without_friction"] - 0.01).abs().max() < 1e-9


def test_nothing_in_the_bounds_is_enough(tmp_path: Path) -> None:
    results = _run(_hoffmann("damping_ratio", "[0.0, 0.01]", margin=0.05), tmp_path)
    facts = results.manifest["design_study"]
    assert facts["outcome"] == NONE_FOUND
    assert "no design within the bounds was found" in facts["verdict"]
    assert "at their bounds: damping_ratio" in facts["verdict"]
    assert facts["changes"][0]["to"] == pytest.approx(0.02)
    nearest = results.table("designs").set_index("design").loc[facts["chosen"]]
    assert nearest["min_damping_ratio"] == pytest.approx(_least_damping(damping_ratio=0.02))


def test_a_mode_that_is_moved_out_of_the_band_is_not_silent(tmp_path: Path) -> None:
    """Hulten's flutter of 89.8 Hz, a band up to 92 Hz, and a variable that moves it above."""
    text = TWO_VARIABLES.format(first=[0.0, 22.5], second=[-5.0, 22.5], costs=(1.0, 1.0))
    text = text.replace("[0.1, 0.2, 0.3]", "[0.4]").replace("0.002", "0.0")
    found = _run(
        f"{text}scan = 8\nstarts = 2\nin_time = 0\n[modes]\nband = [1.0, 92.0]\n", tmp_path
    )
    facts, designs = found.manifest["design_study"], found.table("designs")
    beyond = designs.query("frequency_1 + frequency_2 > 185")  # both modes are near the mean
    assert len(beyond) > 3
    for design in beyond.itertuples():
        values = {"frequency_1": design.frequency_1, "frequency_2": design.frequency_2}
        modes = sq.model("hulten", friction=0.4, damping_ratio=0.005, **values).modes()
        assert bool(design.meets_margin) == (not modes["unstable"].any())
    chosen = designs[designs["chosen"].to_numpy(bool)].iloc[0]
    values = {name: chosen[name] for name in ("frequency_1", "frequency_2")}
    modes = sq.model("hulten", friction=0.4, damping_ratio=0.005, **values).modes()
    assert not modes["unstable"].any()
    assert facts["outcome"] == MET_LINEAR


def test_what_grows_beside_the_band_is_told(tmp_path: Path) -> None:
    """As it does today, so nothing was moved out; and a variable at a bound where it is today."""
    text = TWO_VARIABLES.format(first=[0.0, 1.0], second=[0.0, 1.0], costs=(1.0, 1.0))
    text = text.replace("[0.1, 0.2, 0.3]", "[0.4]").replace("0.002", "0.0")
    below = _run(f"{text}scan = 1\nin_time = 0\n[modes]\nband = [1.0, 80.0]\n", tmp_path)
    hz = 89.754  # of the flutter, above the band
    facts = below.manifest["design_study"]
    assert facts["outcome"] == MET_LINEAR
    assert (
        f"no mode in the band where it was solved; outside the band a mode at {hz} Hz grows"
        in (facts["verdict"])
    )
    (tmp_path / "all").mkdir()
    within = _run(f"{text}scan = 1\nin_time = 0\n[modes]\nband = [1.0, 1000.0]\n", tmp_path / "all")
    facts = within.manifest["design_study"]
    assert facts["outcome"] == NONE_FOUND
    assert "at their bounds: frequency_1, frequency_2" in facts["verdict"]
    assert "outside the band" not in facts["verdict"]


def test_a_variant_whose_mode_leaves_the_band_is_not_chosen(tmp_path: Path) -> None:
    text = TWO_VARIABLES.replace("[0.1, 0.2, 0.3]", "[0.4]").replace("0.002", "0.0")
    start, end = text.index("[[variable]]"), text.index("[goal]")
    text = (text[:start] + text[end:]).format() + "in_time = 0\n[modes]\nband = [1.0, 92.0]\n"
    for name, hz in (("stiff", 80.0), ("soft", 60.0)):
        cost = f"cost = {1 / hz}\nparameters.frequency_2 = {hz}\n"
        text += f'[[variant]]\nname = "{name}"\n{cost}'
    found = _run(text, tmp_path)
    outcomes = found.table("variants").set_index("variant")["outcome"].to_dict()
    assert outcomes == {
        "as in the file": "no_variables",  # flutter at 89.8 Hz
        "stiff": "moved_out",  # flutter at 92.7 Hz
        "soft": "met_linear",
    }
    assert "Cheapest: 'soft' (no change)" in found.manifest["design_study"]["choice"]


def test_runs_that_begin_on_another_vibration_are_other_runs(tmp_path: Path) -> None:
    """Whose rows are not taken over where today's value of a variable is edited."""
    text = _hoffmann("damping_ratio", "[-0.005, 0.2]")
    studies = [_study(t, tmp_path) for t in (text, text.replace("ratio = 0.01", "ratio = 0.02"))]
    for analysis, same in ((MODES, True), (ROOTS, True), (IN_TIME, False)):
        names = []
        for study in studies:
            point = operating_points(study)[0]
            plan = DesignPlan(study, [evaluation(study, point, np.array([0.05]), analysis)])
            names.append(plan.tasks.ids[0])
        assert (names[0] == names[1]) == same


@pytest.mark.full_size  # by default what can be built: test_targets_lead_to_what_can_be_built
def test_what_nobody_can_build_is_not_chosen(tmp_path: Path) -> None:
    text = _hoffmann("stiffness_damping", "[0.0, 4e-4]")
    targets = "".join(
        f'[[variable]]\nparameter = "modes[{k}].damping_ratio"\nbounds = [0.0, 0.2]\n'
        for k in (1, 2)
    )
    ratios = "".join(f'"modes[{k}].damping_ratio" = 0.01\n' for k in (1, 2))
    text = text.replace("[[sweep]]", ratios + "[[sweep]]").replace("[goal]", targets + "[goal]")
    results = _run(text, tmp_path)
    facts = results.manifest["design_study"]
    assert facts["outcome"] == "met_linear"
    chosen = results.table("designs").query("chosen").iloc[0]
    assert chosen["modes[1].damping_ratio"] == chosen["modes[2].damping_ratio"] == 0.01
    least = _least_damping(stiffness_damping=chosen["stiffness_damping"])
    assert least == pytest.approx(chosen["min_damping_ratio"])
    assert least >= 0.002
    targets = results.table("designs")
    targets = targets[targets["origin"].str.startswith("target").to_numpy(bool)]
    assert (targets["stiffness_damping"] == 0.0).all()
    told = facts["targets"]
    assert told["enough"]
    assert told["nearest"].startswith("stiffness_damping 0 -> ")
    assert f"which nobody can build, {told['change']} would meet the margin" in facts["verdict"]
    assert f"has {100 * told['matched']:.3g} % of that first-order effect" in facts["verdict"]


def test_scatter_is_proven_by_samples(tmp_path: Path) -> None:
    more = ", probability = 0.9"
    text = _hoffmann("stiffness_damping", "[0.0, 4e-4]", margin=0.001, more=more)
    text += (
        '[[uncertain]]\nparameter = "damping_ratio"\ndistribution = "normal"\n'
        "mean = 0.01\nstd = 0.002\n"
    )
    results = _run(text, tmp_path)
    assert results.manifest["design_study"]["outcome"] == "met_linear"
    verdict = results.manifest["design_study"]["verdict"]
    assert "meets the margin of 0.1 % with probability 0.9: least damping " in verdict
    nominal = results.table("designs").query("chosen").iloc[0]["min_damping_ratio"]
    assert f"least damping {100 * nominal:.3g} % without scatter, mode at" in verdict
    proof = results.table("proof").set_index("check")
    last = proof.loc[["scatter"]].iloc[-1]
    assert last["passed"]
    assert last["value"] >= 0.9
    chosen = results.table("designs").query("chosen").iloc[0]["stiffness_damping"]
    # damping rises with its ratio: the margin is met by all samples above one value
    low, high = 0.0, 0.01
    for _ in range(12):  # 2e-6 of a scatter of 2e-3
        middle = (low + high) / 2
        met = _least_damping(stiffness_damping=chosen, damping_ratio=middle) >= 0.001
        low, high = (low, middle) if met else (middle, high)
    probability = norm(0.01, 0.002).sf(high)
    assert probability >= 0.9
    samples = results.points[(results.points["analysis"] == "roots")]
    own = samples[samples["design"] == results.manifest["design_study"]["chosen"]]
    met = own["min_damping_ratio"] >= 0.001
    share = met.groupby(own["damping_ratio"].to_numpy()).all().mean()
    assert share == pytest.approx(last["value"])


SCATTERED = """
[study]
name = "scattered"
kind = "design"
[model]
name = "hulten"
[parameters]
frequency_2 = {frequency}
damping_ratio = 0.01
[[sweep]]
parameter = "friction"
values = [0.4]
[[variable]]
parameter = "frequency_2"
bounds = {bounds}
[goal]
margin = {{damping_ratio = 0.002, probability = 0.95}}
in_time = 0
cycles = 0
samples = {samples}
[modes]
band = [10.0, 500.0]
[[uncertain]]
parameter = "damping_ratio"
distribution = "lognormal"
median = 0.01
sigma = {sigma}
"""


def test_scatter_that_is_skew_asks_for_no_change(tmp_path: Path) -> None:
    # below a fifth of the median in 0.4 % of cases; 1.645 standard deviations are 99 % of it
    text = SCATTERED.format(frequency=45.0, bounds="[-5.0, 5.0]", samples=400, sigma=0.6)
    facts = _run(text, tmp_path).manifest["design_study"]
    assert facts["outcome"] == "met_linear"
    assert "As it is it meets the margin of 0.2 % with probability 0.95" in facts["verdict"]


def test_samples_judge_the_nearest_design_where_none_allows_for_scatter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # first order allows for too little at 65 Hz, and then for too much at the bound
    monkeypatch.setattr(proof, "SCATTER_INCREASE", 3.0)
    text = SCATTERED.format(frequency=80.0, bounds="[-18.0, 5.0]", samples=150, sigma=0.3)
    text += '[[uncertain]]\nparameter = "frequency_1"\ndistribution = "normal"\n'
    results = _run(text + "mean = 100.0\nstd = 3.0\n", tmp_path)
    facts = results.manifest["design_study"]
    rng = np.random.default_rng(2)
    K = (2 * np.pi * (100.0 + 3.0 * rng.normal(size=20_000))) ** 2, (2 * np.pi * 62.0) ** 2
    zeta, A = 0.01 * np.exp(0.3 * rng.normal(size=20_000)), np.zeros((20_000, 4, 4))
    A[:, 0, 2] = A[:, 1, 3] = 1.0
    A[:, 2, 0], A[:, 2, 1], A[:, 3, 0], A[:, 3, 1] = -K[0], 0.4 * K[1], -0.4 * K[0], -K[1]
    A[:, 2, 2], A[:, 3, 3] = -2 * zeta * np.sqrt(K[0]), -2 * zeta * np.sqrt(K[1])
    lam = np.linalg.eigvals(A)
    assert ((-lam.real / np.abs(lam)).min(axis=1) >= 0.002).mean() > 0.985
    assert facts["outcome"] == "met_linear"
    assert "frequency_2 80 -> 62 Hz" in facts["verdict"]


def test_a_margin_above_what_modes_have_uncoupled_is_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(_hoffmann("k1", "[-1e5, 1e5]", margin=0.02))
    plan = sq.read_study(path).plan()
    plan.kind.make_missing_models(plan, Workers())
    (text,) = plan.kind.warnings(plan)
    assert "the margin, 2 % of critical damping, is above" in text
    assert "(1 %)" in text
    path.write_text(_hoffmann("k1", "[-1e5, 1e5]", margin=0.005))
    plan = sq.read_study(path).plan()
    assert plan.kind.warnings(plan) == []


GOAL = "[goal]\nmargin = {damping_ratio = 0.002}"


@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ("bounds = [-1e5, 1e5]", "bounds = [1e4, 1e5]", "variable[1].bounds", "low <= 0 <= high"),
        ("bounds = [-1e5, 1e5]", "bounds = [-1e7, 0.0]", "variable[1].bounds[1]", "above 0"),
        ('"k1"', '"k9"', "variable[1].parameter", "no parameter 'k9'"),
        ('k1"\nbounds = [-1e5, 1e5]', 'friction"\nbounds = [0, 0.1]', "variable[1]", "already"),
        ("cycles = 0", "cycle = 0", "goal.cycle", "unknown key"),
        ("damping_ratio = 0.002}", "damping_ratio = 0.002, probability = 0.9}", "goal", "nothing"),
        ('"k1"', '"alpha1"\ncost = 0.0', "variable[1].cost", "more than 0"),
        ("[goal]", '[[variant]]\nname = "a"\n[goal]', "variant[1]", "that differ, got none"),
        (
            "[[variable]]",
            "[parameters.k1.table]\nnormal_force = [1e2, 1e3]\nk1 = [1e6, 2e6]\n[[variable]]",
            "variable[1].parameter",
            "'k1' follows a table",
        ),
        (
            "[[variable]]",
            "[parameters.k2.table]\nk1 = [1e5, 3e6]\nk2 = [1e6, 2e6]\n[[variable]]",
            "variable[1].parameter",
            "'k2' follows 'k1' by a table",
        ),
        (
            "[goal]",
            "[goal]\noccurrence = {friction = [1, 2, 3]}",
            "goal.occurrence.friction",
            "a weight for each of 2 values, got 3",
        ),
        (
            "[goal]",
            "[goal]\noccurrence = {frictio = [1, 2]}",
            "goal.occurrence.frictio",
            "is not swept; did you mean 'friction'?",
        ),
        (
            "[goal]",
            "[goal]\noccurrence = {friction = [1, -2]}",
            "goal.occurrence.friction",
            "at least 0, one of them above it",
        ),
        (
            GOAL,
            "[[uncertain]]\nparameter = 'damping_ratio'\ndistribution = 'normal'\nmean = 0.013\n"
            f"std = 0.002\n{GOAL[:-1]}, probability = 0.9}}",
            "uncertain[1]",
            "a scatter about damping_ratio = 0.01 of [parameters], got one that is from 0.011 to",
        ),
        (
            GOAL,
            f"[[uncertain]]\nparameter = 'damping'\nstart = 0.0\nstop = 0.1\n{GOAL}",
            "uncertain[1].parameter",
            "model 'hoffmann' has no parameter 'damping'; did you mean 'damping_ratio'?",
        ),
        (
            "damping_ratio = 0.01",
            "damping_ratio = 0.01\n'added_mass.disc.RIM' = 0.1",
            "parameters.added_mass.disc.RIM",
            "model 'hoffmann' has no named sets: disc_brake and model files have",
        ),
        (
            "[goal]",
            '[[variant]]\nname = "a"\nparameters.k9 = 1.0\n[goal]',
            "variant[1]",
            "variant 'a': parameters.k9: model 'hoffmann' has no parameter 'k9'",
        ),
        (
            "[goal]",
            '[[variant]]\nname = "a"\nmodel.name = "hulten"\n[goal]',
            "variant[1]",
            "variant 'a': variable[1].parameter: model 'hulten' has no parameter 'k1'",
        ),
        (
            "[goal]",
            '[[variant]]\nname = "a"\nparameters.friction = 0.3\n[goal]',
            "variant[1].parameters",
            "'friction' is swept, alike in every variant",
        ),
        (
            "[goal]",
            '[[variant]]\nname = "a"\nparameters.k2 = {}\n[goal]',
            "variant[1].parameters",
            "'k2' is an empty table, expected a value",
        ),
        (
            "[goal]",
            "".join(f'[[variant]]\nname = "{n}"\nparameters.k2 = 1e6\n' for n in "aA") + "[goal]",
            "variant",
            "'a' is given twice",
        ),
        (
            "[goal]",
            "".join(f'[[variant]]\nname = "a"\nparameters.k2 = {k}.0\n' for k in (1, 2)) + "[goal]",
            "variant",
            "'a' is given twice",
        ),
    ],
)
def test_what_a_file_may_not_say(
    tmp_path: Path, old: str, new: str, key: str, message: str
) -> None:
    text = _hoffmann("k1", "[-1e5, 1e5]")
    assert text.count(old) == 1
    path = tmp_path / "study.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(StudyFileError) as caught:
        sq.read_study(path)
    assert message in str(caught.value)
    assert key in str(caught.value)


def test_check_tells_variables_from_what_scatters(tmp_path: Path, capsys) -> None:
    path = tmp_path / "study.toml"
    text = _hoffmann("k1", "[-1e5, 1e5]", more=", probability = 0.9")
    text += '[[uncertain]]\nparameter = "damping_ratio"\ndistribution = "normal"\n'
    path.write_text(f"{text}mean = 0.01\nstd = 0.002\n")
    cli.check(path, tmp_path / "results", jobs=1)
    shown = " ".join(capsys.readouterr().out.split())
    assert re.search(r"k1 \S+ to \S+ [kM]N/m, searched damping_ratio \S+ to \S+, normal", shown)


def test_bounds_with_units_are_differences(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(_hoffmann("k1", '["-2 N/mm", "+3 N/mm"]'))
    (variable,) = sq.read_study(path).resolved.variables
    assert (variable.low, variable.high) == (-2e3, 3e3)


def test_a_variant_has_tables_that_are_followed(tmp_path: Path) -> None:
    table = "[parameters.k2.table]\nnormal_force = [100, 1e3]\nk2 = [1e6, {k2}]\n"
    text = _hoffmann("damping_ratio", "[0.0, 0.2]").replace(
        "[[sweep]]", table.format(k2=2e6) + "[[sweep]]"
    )
    own = table.format(k2=3e6).replace("[parameters", "[variant.parameters")
    text += f'[[variant]]\nname = "stiff"\n{own}[[variant]]\nname = "fixed"\nparameters.k2 = 5e6\n'
    study = _study(text, tmp_path)
    force = study.values["normal_force"]
    for found, end in ((study, 2e6), (study.alternatives[0].study, 3e6)):
        expected = 1e6 + (force - 100) / 900 * (end - 1e6)
        assert found.values["k2"] == pytest.approx(expected)
    assert study.alternatives[1].study.values["k2"] == 5e6
    again = sq.read_study(_written(study.alternatives[0].study, tmp_path)).resolved
    assert again.values == study.alternatives[0].study.values


def _written(study: DesignStudy, folder: Path) -> Path:
    path = folder / "again.toml"
    path.write_text(study.source.text)
    return path


# -- how often operating points occur ----------------------------------------------------------
def test_shares_count_by_occurrence(tmp_path: Path) -> None:
    text = _hoffmann("damping_ratio", "[0.0, 0.2]", margin=0.002)
    pressures = '[[sweep]]\nparameter = "normal_force"\nvalues = [10.0, 20.0, 30.0]\n[[variable]]'
    text = text.replace("[[variable]]", pressures).replace("[0.5, 0.8]", "[0.2, 0.8]")
    weights = "occurrence = {friction = [1, 4], normal_force = [0.0, 1, 2]}\nscan = 0"
    results = _run(text.replace("scan = 0", weights), tmp_path)
    today = results.points[(results.points["design"] == 0).to_numpy(bool)]
    expected = today["friction"].map({0.2: 1, 0.8: 4}) * (today["normal_force"] / 10 - 1) / 15
    assert today["occurrence"].tolist() == pytest.approx(expected.tolist())
    assert today["occurrence"].sum() == pytest.approx(1.0)
    unstable = (today["n_unstable"] > 0).to_numpy(bool)
    assert unstable.sum() == 3  # all of friction 0.8
    first = results.table("designs").iloc[0]
    assert first["unstable_share"] == pytest.approx(0.8)
    assert results.table("designs").query("chosen").iloc[0]["unstable_share"] == 0.0
    facts = results.manifest["design_study"]
    assert "Hz at 3 of 6 operating points, 80 % of the operation" in facts["verdict"]
    assert results.rank().iloc[0]["share"] == pytest.approx(0.8)


def test_what_counts_as_one_mode_is_bounded_in_frequency() -> None:
    """Small steps from 4.3 to 5.3 kHz are no one mode, whatever the order; neighbours are."""
    hz = np.random.default_rng(0).permutation(np.arange(4300.0, 5300.0, 20.0))
    found = same_modes(hz)
    spans = [hz[found == n] for n in np.unique(found)]
    assert len(spans) >= np.log(5300 / 4300) / np.log(1.05)
    assert all(own.max() <= 1.05 * own.min() for own in spans)
    order = np.argsort(hz)
    assert (np.diff(found[order]) != 0).sum() == len(spans) - 1  # each is one range
    assert same_modes(np.array([900.0, 944.0])).tolist() == [1, 1]
    assert same_modes(np.array([900.0])).tolist() == [1]


def test_effects_of_variables_with_long_names_stay_on_their_lines(trap) -> None:
    effects = {
        f"{p}.modes[7-{n}].frequency_scale": f"+0.0{n}"
        for p in ("caliper", "outer_pad")
        for n in (10, 12)
    }
    told = "; ".join(" ".join(item) for item in effects.items())
    table = trap.rank().head(1).assign(changes=told, name="interfaces 3150 Hz")
    lines = as_text(trap.screen.listed(trap, table, None)).splitlines()
    assert max(map(len, lines)) <= WIDTH_OF_FILES
    in_percent = [[name, f"{100 * float(effect):+.3g}"] for name, effect in effects.items()]
    assert [line.split()[-2:] for line in lines if "modes[" in line] == in_percent


def test_modes_of_very_many_operating_points_are_parted_as_well() -> None:
    """Pairs of 50,000 would take ten gigabytes; no mode is wider than of few, and few are more."""
    hz = np.random.default_rng(1).uniform(4300.0, 5300.0, 50_000)
    found = same_modes(hz)
    spans = [hz[found == n] for n in np.unique(found)]
    assert all(own.max() <= 1.05 * own.min() for own in spans)
    assert np.log(5300 / 4300) / np.log(1.05) <= len(spans) <= 8
    assert (np.diff(found[np.argsort(hz)]) != 0).sum() == len(spans) - 1
    assert same_modes(np.full(5000, 900.0)).tolist() == [1] * 5000


def test_weights_of_any_size_are_shares(tmp_path: Path) -> None:
    more = "[goal]\noccurrence = {friction = [1e308, 1.5e308]}"
    text = _hoffmann("k1", "[-1e3, 1e3]").replace("[goal]", more)
    assert _study(text, tmp_path).occurrence == pytest.approx([0.4, 0.6])


# -- variants ------------------------------------------------------------------------------------
VARIANTS = """
[[variant]]
name = "soft"
cost = 0.1
parameters = {k1 = 0.3e6}
[[variant]]
name = "damped"
cost = 2.0
parameters = {damping_ratio = 0.3}"""


@pytest.fixture(scope="module")
def varied(tmp_path_factory: pytest.TempPathFactory) -> Results:
    text = _hoffmann("damping_ratio", "[0.0, 0.2]", margin=0.02)
    return _run(text + VARIANTS, tmp_path_factory.mktemp("v"))


def test_variants_are_searched_and_proven_each_and_set_beside_each_other(varied) -> None:
    table = varied.table("variants").set_index("variant")
    assert list(table.index) == ["as in the file", "soft", "damped"]
    facts = varied.manifest["design_study"]
    assert (table["outcome"] == "met_linear").all()  # limit cycles were not asked for
    for name, row in table.iterrows():
        k1 = {} if name != "soft" else {"k1": 0.3e6}
        today = 0.3 if name == "damped" else 0.01
        assert row["today_damping_ratio"] == pytest.approx(
            _least_damping(damping_ratio=today, **k1)
        )
        own = varied if not row["folder"] else sq.open_results(varied.directory / row["folder"])
        chosen = own.table("designs").query("chosen").iloc[0]
        assert row["change_cost"] == chosen["cost"]
        least = _least_damping(damping_ratio=chosen["damping_ratio"], **k1)
        assert row["min_damping_ratio"] == pytest.approx(least)
        assert least >= 0.02
        assert row["text"] == own.manifest["design_study"]["verdict"]
    assert table["cost"].tolist() == pytest.approx(
        (table["change_cost"] + [0.0, 0.1, 2.0]).tolist()
    )
    assert table.loc["damped", "change"] == ""  # it meets the margin as it is
    best = table["cost"].idxmin()
    assert f"{table['cost'].min():.4g}" in facts["choice"]
    assert ("'soft'" if best == "soft" else "the file's own design") in facts["choice"]
    assert facts["choice"].endswith("3 of 3 alternatives are proven, large motions not looked at.")
    assert quickly(varied).count("<section id=") == 3
    held, whole = check_results(varied.directory)
    assert whole
    assert "variants/soft: study" in dict(held)


def test_variants_go_on_where_they_were(varied) -> None:
    study = varied.directory.parent / "study.toml"
    before = varied.table("variants")
    again = sq.run(study, varied.directory, jobs=1)
    assert again.solved == 0
    chunks = varied.directory / "variants" / "soft" / "chunks"
    sorted(chunks.iterdir())[0].unlink()
    assert not check_results(varied.directory)[1]
    again = sq.run(study, varied.directory, jobs=1, warn=lambda _: None)
    assert again.solved == 0
    assert again.table("variants").equals(before)
    assert check_results(varied.directory)[1]


def test_what_scatters_is_alike_in_variants(tmp_path: Path) -> None:
    """Its samples are the file's: about another value they would prove nothing."""
    text = _hoffmann("k1", "[-1e3, 1e3]", more=", probability = 0.9")
    text += '[[uncertain]]\nparameter = "damping_ratio"\n'
    text += 'distribution = "normal"\nmean = 0.01\nstd = 0.002\n'
    text += '[[variant]]\nname = "a"\nparameters.damping_ratio = 0.3\n'
    with pytest.raises(StudyFileError, match="'damping_ratio' scatters, alike in every variant"):
        _study(text, tmp_path)


def test_variants_that_are_named_no_more_are_told_and_removed_by_fresh(tmp_path: Path) -> None:
    text = _hoffmann("damping_ratio", "[0.0, 0.2]").replace("[0.5, 0.8]", "[0.1]")  # as it is
    path, folder = tmp_path / "study.toml", tmp_path / "results"
    own = folder / "variants" / "gone"
    variant = '[[variant]]\nname = "{}"\nparameters.k1 = 0.3e6\n'
    path.write_text(text + variant.format("gone") + variant.format("kept"))
    told: list[str] = []
    sq.run(path, folder, jobs=1, warn=told.append)
    (own / "note.txt").write_text("of the user")
    other = folder / "variants" / "other"
    path.write_text(text.replace('"small"', '"another"'))
    sq.run(path, other, jobs=1, warn=told.append)
    path.write_text(text + variant.format("kept"))
    told.clear()
    sq.run(path, folder, jobs=1, warn=told.append)
    assert [t for t in told if "no more" in t] == [
        f"{own}: it belongs to this study no more (--fresh removes it)"
    ]
    assert (own / "points.parquet").is_file()
    told.clear()
    sq.run(path, folder, jobs=1, fresh=True, warn=told.append)
    assert not any("no more" in t for t in told)
    assert [p.name for p in own.iterdir()] == ["note.txt"]
    assert (other / "points.parquet").is_file()
    assert (folder / "variants" / "kept" / "points.parquet").is_file()
    (own / "note.txt").unlink()
    path.write_text(text)
    sq.run(path, folder, jobs=1, fresh=True, warn=told.append)
    assert not (folder / "variants" / "kept").exists()


def test_a_variant_that_cannot_be_solved_leaves_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def row(point: DesignPoint, *others: Any) -> dict[str, Any]:
        if point.values["k1"] == 0.3e6:
            return failed_row(SCHEMA, point.point_id, "no_working_point", "it falls apart")
        return design_row(point, *others)

    monkeypatch.setattr("squealstudy.kinds.design.kind.design_row", row)
    text = _hoffmann("damping_ratio", "[0.0, 0.2]", margin=0.02)
    told: list[str] = []
    path = tmp_path / "study.toml"
    path.write_text(text + '[[variant]]\nname = "lost"\nparameters.k1 = 0.3e6\n')
    found = sq.run(path, tmp_path / "results", jobs=1, warn=told.append)
    row = found.table("variants").set_index("variant").loc["lost"]
    assert row["outcome"] == "failed"
    assert any(text.startswith("variants/lost: ") and row["text"] in text for text in told)
    assert "1 of 2 alternatives is proven" in found.manifest["design_study"]["choice"]


def test_an_operating_point_without_a_result_is_no_search_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def row(point: DesignPoint, *others: Any) -> dict[str, Any]:
        if point.values["friction"] == 0.8:
            return failed_row(SCHEMA, point.point_id, "no_working_point", "it falls apart")
        return design_row(point, *others)

    monkeypatch.setattr("squealstudy.kinds.design.kind.design_row", row)
    found = _run(_hoffmann("damping_ratio", "[0.0, 0.2]", margin=0.02), tmp_path)
    facts = found.manifest["design_study"]
    assert facts["outcome"] == UNDECIDED
    assert facts["failure"] == "it falls apart"
    assert chosen_word(facts) == "not judged"
    assert "operating points (1 could not be solved); no design could be held" in facts["verdict"]
    assert "could not be solved (it falls apart)" in facts["verdict"]
    assert "Nearest" not in facts["verdict"]
    told = html.unescape(quickly(found))
    assert f"{facts['verdict']} 1 of 2 points is not ok (1 no_working_point)." in told


def test_a_study_of_variants_alone_is_proven_too(tmp_path: Path) -> None:
    text = _hoffmann("damping_ratio", "[0.0, 0.2]", margin=0.02)
    start, end = text.index("[[variable]]"), text.index("[goal]")
    found = _run(text[:start] + text[end:] + VARIANTS, tmp_path)
    outcomes = found.table("variants").set_index("variant")["outcome"].to_dict()
    assert outcomes == {
        "as in the file": "no_variables",
        "soft": "no_variables",
        "damped": "met_linear",
    }
    assert "Cheapest: 'damped' (no change), cost 2," in found.manifest["design_study"]["choice"]
    proof = sq.open_results(found.directory / "variants" / "damped").table("proof")
    assert list(proof["check"]) == ["matrix", "refined"]


# -- the page to hand on -----------------------------------------------------------------------
def test_a_report_says_what_the_results_say(trap, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    write_report([trap], page)
    text = page.read_text(encoding="utf-8")
    assert len(text) < 10_000_000
    assert html.escape(trap.manifest["design_study"]["verdict"]) in text
    outside = re.findall(r"(?:src|href)=\"([^\"]*)\"|url\(", text)
    assert outside
    assert all(link.startswith(("data:image/png;base64,", "#")) for link in outside)
    for name in ("design_history", "operating_matrix"):
        assert f"({name})</figcaption>" in text
    (designs,) = re.findall(r"<summary>designs \(5 rows.*?</details>", text, re.DOTALL)
    rows = re.findall(r"<tr><td>(.*?)</tr>", designs, re.DOTALL)
    assert len(rows) == len(trap.table("designs")) == 5
    costs = [float(row.split("</td><td>")[4]) for row in rows]
    assert costs == pytest.approx(trap.table("designs")["cost"].tolist(), rel=1e-5)
    assert html.escape(trap.manifest["study"]) in text
    assert trap.manifest["study_hash"] in text
    assert len(re.findall("<section id=", text)) == 1


@pytest.mark.full_size  # by default of several designs: of the variants above
def test_a_report_of_several_studies_of_any_kind(varied, tmp_path: Path) -> None:
    path = tmp_path / "flutter.toml"
    text = (SHIPPED.parent / "hulten_flutter.toml").read_text(encoding="utf-8")
    path.write_text(text.replace('description = "', 'description = "<b> & '))
    flutter = sq.run(path, tmp_path / "flutter", jobs=1)
    page = report([flutter, varied])
    assert page.count("<section id=") == 4
    assert '<a href="#r2">small</a>' in page
    assert '<a href="#r3">small_soft</a>' in page
    assert "&lt;b&gt; &amp; " in page
    assert "<b>" not in page
    assert f"<th>points</th><td>{flutter.manifest['n_points']}</td>" in page
