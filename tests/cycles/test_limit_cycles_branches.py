"""Branches in studies of limit cycles, cycles from neighbours, and how cycles begin at onsets."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cycle_models as models
import numpy as np
import pandas as pd
import pytest
from study_runs import plan_of, solved
from test_limit_cycles_study import STUDY, study

import squealstudy as sq
from squealstudy.cli.compare import cycle_comparison
from squealstudy.cycles import families
from squealstudy.cycles.onset import SUBCRITICAL, SUPERCRITICAL, criticality
from squealstudy.errors import ResultsError, StudyFileError
from squealstudy.kinds.limit_cycles import continued
from squealstudy.kinds.limit_cycles.continuing import _family, _is_same_row
from squealstudy.kinds.limit_cycles.judged_again import judge_again
from squealstudy.kinds.limit_cycles.screen import SCREEN
from squealstudy.screen import as_text
from squealstudy.tables.cycle_comparison import compare_cycles

MODE = "families = [1]\ntolerance = 1e-3"  # the one that locks in
OPEN = f"undecided_in_time = false\n{MODE}"
ALONE = {"own": ("tolerance = 1e-3", OPEN)}
FOLLOW = {"follow": ("tolerance = 1e-3", f'follow = "friction"\n{MODE}')}
FOLD = 0.0804  # against AUTO-07p in test_cycles_auto


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    directory = tmp_path_factory.mktemp("branches") / "kicked_squeal"
    return solved(plan_of(study([0.06, 0.3, 0.6, 0.85], **FOLLOW), STUDY), directory)


def test_a_branch_from_its_onset_through_its_fold(followed):
    branches = followed.table("branches")
    assert set(branches["along"]) == {"friction"}
    assert set(branches["cycle_id"]) <= set(followed.table("cycles")["cycle_id"])
    assert len(set(branches["cycle_id"])) == 1  # both cycles of each design are on one branch
    fold, onset = (branches[branches["event"] == e].iloc[0] for e in ("F", "H"))
    assert branches["event"].tolist().count("F") == branches["event"].tolist().count("H") == 1
    assert fold["value"] == pytest.approx(FOLD, abs=1e-4)
    assert onset["contact_velocity"] == 0.0
    assert onset["criticality"] == "subcritical"
    ends = branches.loc[branches["branch_end"] != "", "branch_end"].tolist()
    assert sorted(ends) == ["hopf", "range"]
    # stable from the end of the range to the fold, unstable from there to the onset
    side = branches["n_step"] - fold["n_step"]
    outward = np.sign(onset["n_step"] - fold["n_step"])
    plain = (branches["event"] == "").to_numpy(bool)
    assert branches.loc[plain & (side * outward < 0), "stable"].astype(bool).all()
    assert not branches.loc[plain & (side * outward > 0), "stable"].astype(bool).any()
    assert (branches["balance_residual"] < 1e-9).all()


def test_onsets_of_branches_are_those_of_complex_modes(followed):
    contact = models.Designs("hoffmann", models.BISTABLE).at(
        friction=followed.table("branches").query("event == 'H'")["value"].item()
    )
    growth = models.linear_modes(contact.oscillator)[0].real.max()
    assert abs(growth) < 2e-4 * 1400  # stability_tolerance, and 1e-9 of the range


def test_a_cycle_that_is_not_confirmed_leaves_the_verdict_open(tmp_path, monkeypatch):
    """A design whose own curve shows none and that a branch passes."""
    lose(monkeypatch, 2)
    monkeypatch.setattr(continued, "_cycle_at", lambda *_: None)
    whole = families.judged

    def silent(family, *rest):
        found = whole(family, *rest)
        return replace(found, verdict="no_cycle_found") if not found.cycles else found

    monkeypatch.setattr(families, "judged", silent)
    results = solved(plan_of(study([0.4, 0.5, 0.6], **ALONE), STUDY), tmp_path / "open")
    points = results.points.set_index("friction")
    assert points["verdict"].tolist() == ["no_cycle_found", "undecided", "squeals_if_kicked"]
    assert "could not be confirmed" in points.loc[0.5, "reason"]


def test_a_branch_passes_the_cycles_of_designs(followed):
    cycles = followed.table("cycles").merge(followed.points[["point_id", "friction"]])
    branches = followed.table("branches")
    for cycle in cycles.to_dict("records"):
        d = branches["value"] - cycle["friction"]
        crossing = np.flatnonzero(d.to_numpy()[1:] * d.to_numpy()[:-1] <= 0)
        hz = branches["frequency_hz"].to_numpy()
        assert any(
            min(hz[k : k + 2]) - 0.2 < cycle["frequency_hz"] < max(hz[k : k + 2]) + 0.2
            for k in crossing
        )
    assert (cycles["continued_from"] == "").all()


def lose(monkeypatch, count):
    """The first curves are lost, their cycles with them."""
    whole, done = families.family_curve, []

    def curve(projection, start, stop, steps):
        found, end = whole(projection, start, stop, steps)
        done.append(end)
        if len(done) <= count:
            return [p for p in found if not p.event], "not_converged"
        return found, end

    monkeypatch.setattr(families, "family_curve", curve)


@pytest.mark.parametrize("follow", [False, True])
def test_designs_take_cycles_from_neighbours(follow, tmp_path, monkeypatch):
    """Those of which their own curves show none; and they go on from one neighbour to the next."""
    lose(monkeypatch, 2)
    changes = FOLLOW if follow else ALONE
    results = solved(plan_of(study([0.4, 0.5, 0.6], **changes), STUDY), tmp_path / "lost")
    points = results.points.set_index("friction")
    assert points["verdict"].tolist() == ["squeals_if_kicked"] * 3
    assert points.loc[0.5, "torque_rms"] == pytest.approx(127.9, abs=0.1)  # as by its own curve
    cycles = results.table("cycles").merge(results.points[["point_id", "friction"]])
    own = cycles[cycles["friction"] == 0.6]["cycle_id"].tolist()
    assert set(cycles[cycles["friction"] == 0.5]["continued_from"]) <= set(own)
    assert not cycles["cycle_id"].duplicated().any()
    assert results.manifest["continued"]["found"] >= 2
    if not follow:
        alone = {"off": ("tolerance = 1e-3", f"neighbours = false\n{OPEN}")}
        again = solved(plan_of(study([0.4, 0.5, 0.6], **alone), STUDY), tmp_path / "lost")
        assert again.points.set_index("friction").loc[0.5, "verdict"] == "undecided"
        assert again.points["point_id"].tolist() == points["point_id"].tolist()  # their own rows


@pytest.mark.parametrize(
    ("cubic", "expected"), [(4.6e17, SUBCRITICAL), (-1e17, SUPERCRITICAL), (0.0, "")]
)
def test_how_cycles_begin(cubic, expected):
    """Small ones are on the unstable side of the onset, or on the stable one."""
    designs = models.Designs("hulten", {**models.HARDENING, "contact.cubic_stiffness": cubic})
    low, high = 0.25, 0.35
    for _ in range(45):
        middle = 0.5 * (low + high)
        grows = models.linear_modes(designs.at(friction=middle).oscillator)[0].real.max() > 0
        low, high = (low, middle) if grows else (middle, high)
    contact = designs.at(friction=high)
    lam, psi = models.linear_modes(contact.oscillator)
    assert criticality(contact, complex(lam[0]), psi[:, 0]) == expected
    sides = []
    for side, step in ((SUBCRITICAL, -2e-5), (SUPERCRITICAL, 2e-5)):
        near = designs.at(friction=high + step)
        lam, psi = models.linear_modes(near.oscillator)
        equations, curve = models.growth_curve(
            near.oscillator, lam[0], psi[:, 0], 1e-3, 5, lambda m: contact.contact_velocity(m) > 0.1
        )
        small = [contact.contact_velocity(equations.motion(p.u)) < 0.1 for p in curve.at("C")]
        sides += [side] * any(small)  # contact opens at larger ones
    assert sides == ([expected] if expected else [])


@pytest.mark.parametrize(
    ("follow", "told"),
    [("k1", "expected a swept parameter"), ("frictio", "expected a swept parameter")],
)
def test_a_parameter_that_cannot_be_followed(follow, told, tmp_path):
    text = study([0.4, 0.6], x=("tolerance = 1e-3", f'follow = "{follow}"'))
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(StudyFileError, match=told) as caught:
        sq.read_study(path)
    assert caught.value.key == "limit_cycles.follow"


# -- shipped studies, at reduced size ---
def shipped(name, old, new, directory):
    path = STUDY.with_name(f"{name}.toml")
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    return solved(plan_of(text.replace(old, new), path), directory / name)


def test_cycles_from_onset(tmp_path):
    found = shipped("cycles_from_onset", "num = 9", "num = 2", tmp_path)
    assert found.points["verdict"].iloc[-1] == "squeals"
    branches = found.table("branches")
    (onset,) = branches[(branches["event"] == "H").to_numpy(bool)].to_dict("records")
    assert onset["value"] == pytest.approx(0.30127, abs=3e-5)
    assert onset["criticality"] == "supercritical"
    facts = dict(SCREEN.facts(found))
    assert "Hopf point at 0.3013 (supercritical)" in facts["branch"]


def test_verdict_map(tmp_path):
    """Where the spring softens less the oscillator squeals only when kicked, or not at all."""
    text = STUDY.with_name("verdict_map.toml").read_text(encoding="utf-8")
    for old, new in (
        ("0.05, 0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0", "0.6, 0.9"),
        ("-6.4e17, -5.9e17, -5.4e17, -4.9e17, -4.4e17", "-5.4e17, -2e17"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    found = solved(plan_of(text, STUDY.with_name("verdict_map.toml")), tmp_path / "map")
    points = found.points.set_index(["friction", "contact.cubic_stiffness"])
    assert points.loc[(0.6, -5.4e17), "verdict"] == "squeals_if_kicked"
    assert points.loc[(0.6, -5.4e17), "threshold_velocity"] == pytest.approx(0.982, abs=1e-3)
    assert points.loc[(0.9, -5.4e17), "verdict"] == "squeals"
    assert points.loc[(0.9, -2e17), "verdict"] == "no_cycle_found"
    border = found.table("borders")
    (own,) = border[border["line_difference"].notna().to_numpy(bool)].to_dict("records")
    assert own["value"] == pytest.approx(0.797, abs=1e-3)
    assert abs(own["line_difference"]) < 1e-9
    facts = SCREEN.facts(found)
    branches = [text for name, text in facts if name == "branch"]
    assert any("along friction at contact.cubic_stiffness = -5.4e+17 Pa/m3:" in t for t in branches)
    assert "where they meet branches they differ by" in dict(facts)["borders"]
    title = found.plot.cycle_levels(along="friction").get_suptitle()
    assert "contact.cubic_stiffness" not in title, "of several lines the title names none"
    figure = found.plot.verdict_map()
    counts = points["verdict"].value_counts()
    told = {t.get_text() for t in figure.legends[0].texts}
    assert f"squeals ({counts['squeals']})" in told
    assert f"squeals if kicked ({counts['squeals_if_kicked']})" in told
    scattered = found.points.iloc[[0, 3]].assign(status=["failed", "ok"])  # without a grid
    figure = found.with_tables(points=scattered).plot.verdict_map()
    assert figure.axes[0].get_title() == "1 design failed, not shown"


def test_pictures_of_branches_growth_and_harmonics(followed, tmp_path):
    _, stable = cycle_ids(followed)
    run = in_time(followed, stable["cycle_id"], tmp_path / "run")
    figure = followed.plot.cycle_levels(along="friction", runs=run)
    labels = figure.axes[0].get_legend_handles_labels()[1]
    wanted = {"branch, stable", "branch, unstable", "run in time, motion that lasts"}
    assert wanted <= set(labels)
    assert len(labels) == len(set(labels))
    assert {t.get_text() for t in figure.axes[0].texts} == {"H", "F"}
    (dots,) = [line for line in figure.axes[0].lines if line.get_marker() == "x"]
    assert dots.get_ydata() == pytest.approx(stable["torque_rms"], rel=2e-3)
    point = followed.points.set_index("friction").loc[0.6, "point_id"]
    growth = followed.plot.cycle_growth(point=point)
    circles = [line for line in growth.axes[0].lines if line.get_marker() == "o"]
    assert sum(len(c.get_xdata()) for c in circles) == 2
    by_label = {c.get_label(): c for c in circles}
    known, _ = by_label["stable cycle"].get_data()
    assert known == pytest.approx([stable["contact_velocity"]], rel=1e-2)
    assert by_label["unstable cycle"].get_markerfacecolor() == "white"
    assert by_label["stable cycle"].get_markerfacecolor() != "white"
    low, _ = growth.axes[0].get_ylim()
    rates = np.concatenate([line.get_ydata() for line in growth.axes[0].lines if line.get_label()])
    assert low >= 1.5 * rates.min()  # not far below all that is drawn
    title = figure.get_suptitle()
    assert "at friction" in title
    assert "cycles" not in title
    rough = followed.with_tables(cycles=followed.table("cycles").assign(level_error=1e-2))
    spectrum = rough.plot.cycle_spectrum(cycle=stable["cycle_id"])
    bars, shown = spectrum.axes[0].patches, [t for g in spectrum.legends for t in g.get_texts()]
    assert [text.get_text() for text in shown] == ["estimated error of the level"]
    assert not spectrum.axes[0].texts  # it lay on the bars
    assert len(bars) == stable["n_harmonics"]
    # a torque about its mean is the root of the harmonics' squares
    power = np.sqrt(0.5 * np.sum(np.square(stable["torque_harmonics"])))
    assert power == pytest.approx(stable["torque_rms"], rel=1e-3)
    with pytest.raises(ResultsError, match="no cycle 'x'"):
        followed.plot.cycle_spectrum(cycle="x")


# -- runs in time that begin on a cycle ---
RUN = """
[transient]
duration = 0.4
step = 1e-5
"""


def in_time(followed, cycle_id, directory, more=""):
    text = study([0.6]).split("[limit_cycles]")[0].replace('"limit_cycles"', '"transient"')
    start = f'start = "cycle:{followed.directory.as_posix()}/{cycle_id}"\n'
    return solved(plan_of(text + RUN + start + more, STUDY), directory)


def cycle_ids(followed):
    """The unstable cycle and the stable one at friction 0.6."""
    cycles = followed.table("cycles").merge(followed.points[["point_id", "friction"]])
    own = cycles[cycles["friction"] == 0.6].set_index("stable")
    return own.loc[False], own.loc[True]


def test_a_run_begins_on_a_cycle_and_stays_on_it(followed, tmp_path):
    _, stable = cycle_ids(followed)
    row = in_time(followed, stable["cycle_id"], tmp_path / "on").points.iloc[0]
    assert row["torque_rms"] == pytest.approx(stable["torque_rms"], rel=2e-3)
    assert row["torque_line_hz"] == pytest.approx(stable["frequency_hz"], rel=1e-3)
    assert row["perturbation"] == 0.0


def test_runs_below_and_above_an_unstable_cycle(followed, tmp_path):
    unstable, stable = cycle_ids(followed)
    levels = {}
    for scale in (0.9, 1.1):
        more = f"start_scale = {scale}\n"
        found = in_time(followed, unstable["cycle_id"], tmp_path / str(scale), more)
        levels[scale] = found.points.iloc[0]["torque_rms"]
    assert levels[0.9] < 0.5 * unstable["torque_rms"]
    assert levels[1.1] > 1.1 * unstable["torque_rms"]
    assert levels[1.1] <= 1.003 * stable["torque_rms"]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("-1-1", "-1-9", "no cycle '"),
        ("/", "/nowhere/", "with results of limit cycles"),
        ("start =", 'start_point = "a"\nstart =', "start_point is not for a cycle"),
        ("start =", 'representation = "hybrid"\nstart =', "is for representation"),
    ],
)
def test_a_cycle_that_is_not_there(followed, tmp_path, old, new, told):
    text = study([0.6]).split("[limit_cycles]")[0].replace('"limit_cycles"', '"transient"')
    place = followed.directory.as_posix().rpartition("/")
    name = followed.table("cycles")["cycle_id"].iloc[0]
    start = f'start = "cycle:{place[0]}|{place[2]}/{name}"\n'
    start = start.replace("|", new) if old == "/" else start.replace("|", "/").replace(old, new)
    with pytest.raises(StudyFileError, match=told) as caught:
        solved(plan_of(text + RUN + start, STUDY), tmp_path / "none")
    assert caught.value.key.startswith("transient")


# -- beside runs in time ---
def test_compared_with_runs_in_time(followed, tmp_path):
    _, stable = cycle_ids(followed)
    run = in_time(followed, stable["cycle_id"], tmp_path / "on")
    for table in (followed.compare(run), run.compare(followed)):
        (row,) = table.to_dict("records")
        assert row["verdict"] == "squeals_if_kicked"
        assert row["bistable"] is True
        assert (row["agreement"], row["cycle_id"]) == ("agrees", stable["cycle_id"])
        assert abs(row["level_deviation"]) < 2e-3
        assert abs(row["frequency_deviation"]) < 1e-3
        assert table.attrs["units"]["predicted_torque_rms"] == table.attrs["units"]["torque_rms"]
    shown = as_text(cycle_comparison(table))
    assert shown.startswith("1 design point compared: 1 agree; 1 bistable.")


def test_verdicts_and_runs_agree_or_differ():
    def row(verdict, run, unstable=0, rms=1.1, stable=True, level=1.05):
        points = pd.DataFrame({"point_id": ["a"], "status": ["ok"], "friction": [0.5]})
        points = points.assign(
            verdict=verdict, n_unstable=unstable, unstable_outside=False, threshold_velocity=np.nan
        )
        points = points.assign(torque_rms=level, frequency_hz=101.0, level_error=0.01)
        cycles = pd.DataFrame(
            {"point_id": ["a", "a"], "cycle_id": ["a-1-1", "a-1-2"], "same_as": ["", ""]}
            | {"stable": [True, True], "frequency_hz": [100.0, 200.0], "torque_rms": [1.0, 2.0]}
            | {"level_error": 0.01}
        )
        runs = pd.DataFrame({"point_id": ["t"], "status": ["ok"], "friction": [0.5], "class": run})
        runs = runs.assign(torque_rms=rms, torque_line_hz=101.0)
        runs = runs.assign(torque_rms_low=rms - 0.05, torque_rms_high=rms + 0.1)
        has = stable and verdict in ("squeals", "squeals_if_kicked")
        found = compare_cycles(
            points, cycles if has else cycles[:0], runs, ["friction"], ["friction"], {}
        )
        return found.iloc[0]

    lasts = row("squeals", "limit_cycle", 1)
    assert (lasts["agreement"], lasts["cycle_id"], lasts["bistable"]) == ("agrees", "a-1-1", False)
    assert lasts["level_deviation"] == pytest.approx(0.1)
    assert lasts["level_deviation_error"] == pytest.approx(0.1 + 1.1 * 0.01)
    assert row("squeals", "stable", 1)["agreement"] == "differs"
    assert row("squeals", "growing", 1)["agreement"] == "open"
    silent = row("squeals_if_kicked", "stable")
    assert (silent["agreement"], silent["cycle_id"]) == ("agrees", "a-1-2")
    assert np.isnan(silent["level_deviation"])
    assert row("no_cycle_found", "irregular")["agreement"] == "differs"
    assert not row("no_cycle_found", "stable")["bistable"]
    assert pd.isna(row("undecided", "stable")["bistable"])
    assert row("undecided", "limit_cycle")["agreement"] == "open"
    assert row("squeals", "limit_cycle", 1, rms=1.5)["agreement"] == "doubtful"
    assert row("squeals_if_kicked", "limit_cycle", rms=1.5)["agreement"] == "doubtful"
    alone = row("squeals_if_kicked", "limit_cycle", stable=False)
    assert (alone["agreement"], alone["bistable"], alone["cycle_id"]) == ("agrees", True, "")
    assert alone["level_deviation"] == pytest.approx(1.1 / 1.05 - 1.0)
    assert not row("squeals", "limit_cycle", 1, stable=False)["bistable"]
    beside = row("squeals", "limit_cycle", 1, rms=5.0, level=5.0)  # of a run, beside the cycles
    assert (beside["agreement"], beside["cycle_id"]) == ("agrees", "")
    assert beside["predicted_torque_rms"] == 5.0


# -- one cycle or two ------------------------------------------------------------------------------
QUIET = {
    "stable": True,
    "status": "ok",
    "same_as": "",
    "torque_rms": 10.0,
    "contact_velocity": 2.0,
    "frequency_hz": 100.0,
    "frequency_error": 0.0,
    "level_error": 1e-9,
    "velocity_error": 0.0,
    "energy": 4.0,
    "torque_line_hz": 200.0,
    "invalid_reason": "",
}


def test_level_and_share_of_the_threshold_are_of_one_cycle():
    """Of a louder one from elsewhere too, in the row of its family and of its design."""
    kicked = {
        "mode": 1,
        "verdict": "squeals_if_kicked",
        "reason": "",
        "unstable": False,
        "n_cycles": 2,
        "growth_rate": -1.0,
        "torque_rms": 10.0,
        "level_error": 0.0,
        "cycle_frequency_hz": 100.0,
        "threshold_velocity": 0.5,
        "threshold_share": 0.25,
        "threshold_energy": 1.0,
        "threshold_cycle": "a-1-1",
    }
    silent = kicked | {"mode": 2, "verdict": "no_cycle_found", "n_cycles": 0}
    unknown = ("torque_rms", "threshold_velocity", "threshold_share", "threshold_energy")
    silent |= dict.fromkeys(unknown, np.nan)
    for mode, shares in ((1, [0.1, np.nan]), (2, [0.25, np.nan])):
        row = {"verdicts": [dict(kicked), dict(silent)], "cycles": [QUIET], "n_left_out": 0}
        row["unstable_outside"] = False
        loud = QUIET | {"torque_rms": 20.0, "contact_velocity": 5.0}
        row["cycles"] = [QUIET, loud]
        judge_again(row, mode, "a cycle continued from another", loud)
        assert row["torque_rms"] == 20.0
        assert row["threshold_share"] == pytest.approx(0.1)
        np.testing.assert_allclose([v["threshold_share"] for v in row["verdicts"]], shares)
        # an unstable one that is smaller than the threshold of the first family
        small = QUIET | {"stable": False, "torque_rms": 1.0, "energy": 0.5}
        row["cycles"].append(small)
        judge_again(row, mode, "another cycle", small)
        first = row["verdicts"][0]
        assert np.isnan([first["threshold_velocity"], row["threshold_velocity"]]).all()
        assert first["threshold_cycle"] == ""
        assert "; no threshold: another cycle is smaller" in first["reason"]
        assert first["verdict"] == "squeals_if_kicked"


@pytest.mark.parametrize(
    ("verdict", "reason", "stable", "told"),
    [
        ("no_cycle_found", "no cycle", None, "a cycle that came may be stable"),
        ("no_cycle_found", "no cycle", False, "a cycle that came is unstable"),
        (
            "undecided",
            "only unstable cycles found; all else is open",
            None,
            "only unstable cycles found but a cycle that came that may be stable; all else is open",
        ),
        ("undecided", "only unstable cycles found", False, "only unstable cycles found"),
        ("undecided", "the equations", None, "the equations"),
        (
            "undecided",
            "the curve was followed up to a contact velocity of 0.2 m/s only",
            False,
            "the curve was followed up to a contact velocity of 0.2 m/s only; a cycle that came is "
            "unstable, at 5 m/s",
        ),
    ],
)
@pytest.mark.parametrize("pulls", ["", "it pulls: 1"])
def test_a_cycle_of_which_it_is_not_known_whether_it_attracts_is_not_told_unstable(
    verdict, reason, stable, told, pulls
):
    there = {"mode": 1, "verdict": verdict, "reason": reason, "unstable": False, "n_cycles": 0}
    numbers = ("torque_rms", "level_error", "regularisation_error", "cycle_frequency_hz")
    numbers += ("cycle_frequency_error", "torque_line_hz")
    there |= dict.fromkeys(
        (*numbers, "threshold_velocity", "threshold_share", "threshold_energy"), np.nan
    )
    row = {
        "verdicts": [there | {"growth_rate": -1.0, "invalid_reason": ""}],
        "cycles": [],
        "n_left_out": 0,
    }
    row["unstable_outside"] = False
    cycle = QUIET | {"stable": stable, "energy": 1.0, "contact_velocity": 5.0}
    judge_again(row, 1, "a cycle that came", cycle)
    assert row["verdicts"][0]["reason"] == told
    assert row["verdicts"][0]["verdict"] == "undecided"
    judge_again(row, 1, "another", QUIET | {"energy": 1.0, "invalid_reason": pulls})
    broken = f"; outside validity: {pulls}" * bool(pulls)
    new = "another is stable, and so is steady sliding; no threshold"
    assert row["verdicts"][0]["reason"] == new + broken
    row["unstable_outside"] = True
    row["verdicts"][0]["verdict"] = "undecided"
    judge_again(row, 1, "another", QUIET | {"energy": 1.0})
    assert "and steady sliding is not, by another mode" in row["verdicts"][0]["reason"]


@pytest.mark.parametrize(("unstable_there", "mode"), [(True, 2), (False, 1)])
def test_a_cycle_of_an_unstable_mode_goes_to_an_unstable_mode(unstable_there, mode):
    """Two modes that lock in are nearly one frequency, and the stable one may be nearer."""
    here = [
        {"mode": 1, "frequency_hz": 317.43, "unstable": False},
        {"mode": 2, "frequency_hz": 318.06, "unstable": True},
    ]
    origin = {"verdicts": [{"mode": 2, "frequency_hz": 317.57, "unstable": unstable_there}]}
    continued = SimpleNamespace(origin=SimpleNamespace(mode=2, omega=2 * np.pi * 321.5))
    assert _family({"verdicts": here}, origin, continued) == mode


@pytest.mark.parametrize(
    ("error", "apart", "same"),
    [(1e-9, 5e-6, True), (1e-9, 5e-5, False), (1e-3, 1e-3, True), (1.0, 2e-2, False)],
)
@pytest.mark.parametrize("name", ["torque_rms", "contact_velocity", "frequency_hz"])
def test_a_cycle_is_known_as_nearly_as_errors_allow(name, error, apart, same):
    one = QUIET | {"level_error": error}
    assert _is_same_row(one | {name: (1 + apart) * one[name]}, one) == same


@pytest.mark.parametrize(
    ("level", "before", "clause"),
    [
        (9.9, "", ""),
        (9.9, "; small motion comes to 0.4 of the level told; outside validity: it pulls", None),
        (5.0, "", "; whether small motion grows to it was not tried"),
        (np.nan, "", "; whether small motion grows to it was not tried"),
    ],
)
def test_of_a_louder_cycle_that_came_it_is_told_that_small_motion_may_stay_quieter(
    level, before, clause
):
    there = {"mode": 1, "verdict": "squeals", "reason": "unstable mode" + before, "unstable": True}
    there |= {"n_cycles": 0, "torque_rms": level, "level_error": 0.0, "growth_rate": 1.0}
    there |= dict.fromkeys(("threshold_velocity", "threshold_share", "threshold_energy"), np.nan)
    row = {"verdicts": [there], "cycles": [], "n_left_out": 0, "unstable_outside": False}
    judge_again(row, 1, "it came", QUIET)
    told = "unstable mode, with a stable cycle: it came"
    told += "; small motion comes to 0.4 of the level told" if clause is None else clause
    assert row["verdicts"][0]["reason"] == told
