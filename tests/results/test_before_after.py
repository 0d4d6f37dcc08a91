"""Two studies of complex modes, before and after a change, held against each one's own tables."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from made_results import made
from matrix_families import write_family
from own_blocks import STUDY, write_blocks
from reference import MU_C
from study_runs import solved
from study_texts import study_text, sweep_text

import squealstudy as sq
from squealstudy.cli.before_after import before_after
from squealstudy.engine.before_after import compare_modes
from squealstudy.engine.manifest import _model_file
from squealstudy.errors import ResultsError
from squealstudy.screen import as_text
from squealstudy.tables.before_after import UnstableModes, paired, unstable_modes


def hulten(folder, name, more="", start=0.1, stop=0.6, num=6, band="[10.0, 1000.0]"):
    text = study_text(name, "complex_modes", "hulten") + more
    text += sweep_text("friction", start, stop, num) + f"[modes]\nband = {band}\n"
    return solved(text, folder / name)


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return hulten(tmp_path_factory.mktemp("nominal"), "nominal")


@pytest.fixture(scope="module")
def apart(tmp_path_factory):
    """Modes of 100 and 45 Hz, which do not lock in up to .6."""
    return hulten(tmp_path_factory.mktemp("a"), "apart", "[parameters]\nfrequency_2 = 45.0\n")


def said(before, after):
    return " ".join(as_text(before_after(before.compare(after), before, after)).split())


def test_a_change_moves_onset_and_growth_as_each_study_has_them(nominal, tmp_path):
    near = hulten(tmp_path, "near", "[parameters]\nfrequency_2 = 80.0\n")
    table = nominal.compare(near)
    assert len(table) == 1
    row = table.iloc[0]
    assert row["onset_before"] == pytest.approx(MU_C, abs=2e-4)
    for side, results in (("before", nominal), ("after", near)):
        into = results.onsets[results.onsets["direction"] == "in"]
        assert row[f"onset_{side}"] == into["onset"].min()
        assert row[f"onset_error_{side}"] == into["error_estimate"].iloc[0]
        unstable = results.modes[results.modes["unstable"]]
        assert row[f"growth_rate_{side}"] == unstable["growth_rate"].max()
        assert row[f"unstable_points_{side}"] == unstable["point_id"].nunique()
    assert table.attrs["changes"] == ["parameters.frequency_2 75 -> 80.0"]
    text = said(nominal, near)
    assert text.startswith("The first onset moves down: friction 0.2917 (T")
    assert f"friction {row['onset_after']:.4g} (T" in text
    assert f"falls from {row['growth_rate_before']:.1f} to " in text or "rises from" in text
    assert "What differs: parameters.frequency_2 75 -> 80.0." in text
    assert "where both grow, or one where never both do, 5 % apart at most in the mean" in text


def test_of_a_change_that_silences_it_is_said_to_which_value(nominal, apart):
    text = said(nominal, apart)
    assert text.startswith("First onset before: friction 0.2917 (T")
    assert "after: none up to friction 0.6." in text
    assert "1 mode before and 0 modes after" in text
    assert "Only before: T" in text
    assert "Only after" not in text
    assert "after: friction 0.2917" in said(apart, nominal)
    assert said(apart, apart).startswith("No mode is unstable, neither before nor after, at any")


def test_a_mode_whose_frequency_moves_far_is_not_told_silenced(nominal, tmp_path):
    """Both frequencies a tenth up: the onset is the same, and no partner within 5 % is there."""
    faster = "[parameters]\nfrequency_1 = 110.0\nfrequency_2 = 82.5\n"
    text = said(nominal, hulten(tmp_path, "faster", faster))
    assert text.count(f"friction {MU_C:.4g} (T") == 2
    for false in ("none up to", "Only before", "Only after", " 0 -> "):
        assert false not in text
    assert "Without a partner before: T" in text
    assert "changes by more than 5 % may be without a partner on both sides" in text


def test_the_same_study_stays_within_its_error(nominal):
    text = said(nominal, nominal)
    assert text.startswith("The first onset stays within its error: ")
    assert "The fastest growth stays within its error, at " in text
    assert "What differs: nothing in the study files" in text


def test_a_wider_range_of_one_study_has_no_say(apart, nominal, tmp_path):
    """Onsets and growth are those between values that both studies have."""
    below = hulten(tmp_path, "below", stop=0.2, num=2)
    table = below.compare(nominal)
    assert (len(table), table.attrs["points"]) == (0, 2)
    half = hulten(tmp_path, "half", stop=0.4, num=4)
    table = half.compare(nominal)
    assert table["unstable_points_after"].tolist() == [2]
    at_most = nominal.modes.merge(nominal.points[["point_id", "friction"]]).query("friction < .45")
    assert table["growth_rate_after"].iloc[0] == at_most["growth_rate"].max()


def test_points_that_failed_leave_open_what_grows(nominal, apart):
    points = apart.points.copy()
    points.loc[2, "status"] = "working_point"
    text = said(nominal, apart.with_tables(points=points))
    assert "after: none known" in text
    assert "none up to" not in text
    assert "Failed: 0 points before and 1 point after." in text


def test_what_cannot_be_compared_is_refused(nominal, tmp_path):
    with pytest.raises(ResultsError, match=r"different bands.* would seem silenced"):
        nominal.compare(hulten(tmp_path, "band", band="[10.0, 900.0]"))
    with pytest.raises(ResultsError, match="no design point in common"):
        nominal.compare(hulten(tmp_path, "else", start=0.11, stop=0.12, num=2))
    other = made(facts=nominal.manifest | {"model": "belt"}).with_tables(points=nominal.points)
    with pytest.raises(ResultsError, match="different models"):
        compare_modes(nominal, other)


def side(*rows):
    """Modes of a side: name, frequency, component of most energy, growth."""
    names = ("mode", "frequency_hz", "main_component", "growth_rate")
    table = pd.DataFrame([dict(zip(names, row, strict=True)) for row in rows])
    more = {"onset": 0.3, "onset_kind": "refined", "onset_error": 1e-4, "growth_rate_error": 0.0}
    roots = table["growth_rate"] + 2j * np.pi * table["frequency_hz"].fillna(0.0)
    table = table.assign(second_component="", unstable_points=1, **more)
    return UnstableModes(table, roots.to_numpy()[:, None], len(rows), 0, 0)


def test_a_mode_is_the_one_that_is_near_at_all_points_not_where_each_grows_fastest():
    """T1 and T8 cross in frequency where they grow fastest."""
    one, two = (
        side(("T1", 3200.0, "disc", 170.0)),
        side(("T8", 3144.0, "disc", 280.0), ("T9", 3245.0, "disc", 33.0)),
    )
    path = {
        "T1": [3136.0, 3142.0, 3200.0],
        "T8": [3130.0, 3140.0, 3150.0],
        "T9": [3255.0, 3253.0, 3245.0],
    }
    one, two = (
        s._replace(roots=1.0 + 2j * np.pi * np.array([path[name] for name in s.table["mode"]]))
        for s in (one, two)
    )
    table = paired(one, two)
    assert table.loc[table["mode_before"] == "T1", "mode_after"].tolist() == ["T8"]


@pytest.mark.parametrize(("last", "partner"), [(3250.0, "T8"), (3310.0, "")])
def test_frequencies_of_a_pair_may_be_further_apart_at_one_point_than_in_the_mean(last, partner):
    one, two = side(("T1", 3000.0, "disc", 170.0)), side(("T8", last, "disc", 280.0))
    one = one._replace(roots=1.0 + 2j * np.pi * np.array([[3000.0, 3000.0]]))
    two = two._replace(roots=1.0 + 2j * np.pi * np.array([[3000.0, last]]))
    table = paired(one, two)
    assert table.loc[table["mode_before"] == "T1", "mode_after"].tolist() == [partner]


def test_modes_are_paired_by_frequency_and_where_their_energy_is():
    before = side(("T1", 3000.0, "disc", 90.0), ("T2", 3100.0, "pad", 200.0))
    after = side(
        ("T7", 3090.0, "disc", 80.0), ("T8", 3010.0, "pad", 150.0), ("T9", 5e3, "pad", 300.0)
    )
    table = paired(before, after)
    pairs = list(zip(table["mode_before"], table["mode_after"], strict=True))
    assert pairs == [("", "T9"), ("T2", "T8"), ("T1", "T7")]
    assert table["unstable_points_before"].tolist() == [0, 1, 1]
    assert np.isnan(table["growth_rate_before"][0])
    overdamped = side(("non-oscillating", np.nan, "pad", 5.0))
    assert len(paired(overdamped, overdamped)) == 1


def test_tracks_that_are_one_mode_are_one_row():
    """Of one mode whose number changes from 1 to 2 while it grows."""
    friction = np.array([0.1, 0.2, 0.3, 0.4])
    points = pd.DataFrame({"point_id": list("abcd"), "status": "ok", "friction": friction})
    points = points.assign(n_modes=2, n_unstable=[0, 1, 1, 1])
    growth = {1: [-5.0, 20.0, -30.0, -40.0], 2: [-50.0, -20.0, 60.0, 90.0]}
    modes = pd.DataFrame(
        {"point_id": p, "track": t, "growth_rate": g, "frequency_hz": 1000.0 + t}
        for t, rates in growth.items()
        for p, g in zip("abcd", rates, strict=True)
    )
    modes = modes.assign(
        damping_ratio=-modes["growth_rate"] / 6e3, unstable=modes["growth_rate"] > 0
    )
    modes = modes.assign(track_ambiguous=True, overdamped=False, error_estimate=0.1)
    modes["stability"] = np.where(modes["unstable"], "unstable", "stable")
    onsets = pd.DataFrame(
        {
            "track": 1,
            "onset": 0.12,
            "direction": "in",
            "status": "refined",
            "error_estimate": 1e-4,
            "point_before": "a",
            "point_after": "b",
            "frequency_hz": 1001.0,
        },
        index=[0],
    )
    everywhere = np.ones(4, dtype=bool)
    own = unstable_modes(points, modes, onsets, "friction", everywhere, np.arange(4))
    assert own.roots.real.tolist() == [[-5.0, 20.0, 60.0, 90.0]]
    assert own.table["mode"].tolist() == ["T1, T2"]
    row = own.table.iloc[0]
    assert (row["onset"], row["growth_rate"], row["unstable_points"]) == (0.12, 90.0, 3)
    assert (row["onset_error"], row["growth_rate_error"]) == (1e-4, 0.1)


def test_a_parameter_that_follows_another_is_one_change(nominal, tmp_path):
    table = "[parameters.damping_ratio.table]\nnormal_force = [50.0, 200.0]\nvalue = [0.01, 0.02]\n"
    follows = hulten(tmp_path, "follows", table)
    assert nominal.compare(follows).attrs["changes"] == ["parameters.damping_ratio 0 -> a table"]
    assert follows.compare(nominal).attrs["changes"] == ["parameters.damping_ratio a table -> 0"]


def test_other_files_of_own_matrices_are_told(tmp_path):
    """Of a study run again after its damping file had changed, nothing was said to differ."""
    follower = [[0.0, 1e6], [-1e6, 0.0]]
    terms = {"m": ("M", np.eye(2)), "k": ("K", np.diag([1e6, 1.2e6])), "f": ("K", follower)}
    runs = []
    for name, damping in (("light", 10.0), ("heavy", 100.0)):
        text = write_family(tmp_path, terms | {"c": ("C", damping * np.eye(2))}, {"f": "mu"})
        study = study_text("own", "complex_modes", "matrices") + f'folder = "{tmp_path}"\n{text}'
        study += "[parameters]\nmu = 0.0\n" + sweep_text("mu", 0.1, 0.3, 3)
        runs.append(solved(f"{study}[modes]\nband = [10.0, 1000.0]\n", tmp_path / name))
    light, heavy = runs
    assert light.compare(heavy).attrs["changes"] == ["the files of the matrices"]
    assert light.compare(light).attrs["changes"] == []
    del light.manifest["matrix_files"]
    (perhaps,) = light.compare(heavy).attrs["changes"]
    assert perhaps.startswith("perhaps the files of the matrices")


def test_points_that_are_not_in_common_are_told_by_their_side(nominal, tmp_path):
    beyond = hulten(tmp_path, "beyond", start=0.7, stop=0.9, num=2)
    with pytest.raises(
        ResultsError, match=r"before: friction = 0.1, .*; after: friction = 0.7, 0.9"
    ):
        nominal.compare(beyond)


ON_BRIDGE = "added_mass.caliper.BRIDGE"
NO_FILE, OF_FILE = {"model": "disc_brake"}, {"model": "components"}


def relabelled(results, model, mass="", swept=None):
    """The results as if they were of this model, with a mass of 100 g, with 0 g, or unnamed."""
    facts = results.manifest | model
    if mass:
        facts["study"] += f'[parameters]\n"{ON_BRIDGE}" = "{mass}"\n'
    if mass or swept is not None:
        facts["nominal"] = facts["nominal"] | {ON_BRIDGE: 0.1 if mass == "100 g" else 0.0}
        facts["units"] = facts["units"] | {ON_BRIDGE: "kg"}
    points = results.points
    if swept is not None:
        facts["sweeps"] = [*facts["sweeps"], ON_BRIDGE]
        points = points.assign(**{ON_BRIDGE: swept})
    tables = {"modes": results.modes, "onsets": results.onsets}
    return made(facts=facts).with_tables(points=points, **tables)


def facts_of(study):
    """Facts of a study of a model file, as a manifest has them."""
    plan = sq.read_study(study).plan()
    return {"nominal": dict(plan.nominal_values), **_model_file(plan.study)}


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("bare", ["", "0 g"])
def test_a_study_that_names_no_added_mass_has_none(nominal, bare, order):
    """As one that names 0 g of it, on either side."""
    sides = [relabelled(nominal, NO_FILE, mass) for mass in (bare, "100 g")][::order]
    ends = " -> ".join(["'0 g'", "'100 g'"][::order])
    assert compare_modes(*sides).attrs["changes"] == [f"parameters.{ON_BRIDGE} {ends}"]


@pytest.mark.parametrize(("mass", "size"), [("", 0.0), ("100 g", 0.1)])
def test_it_is_compared_with_the_points_of_a_sweep_that_have_as_much(nominal, mass, size):
    given, swept = relabelled(nominal, NO_FILE, mass), relabelled(nominal, NO_FILE, swept=size)
    other = relabelled(nominal, NO_FILE, swept=0.05)
    for sides in ((given, swept), (swept, given)):
        assert compare_modes(*sides).attrs["points"] == len(nominal.points)
    with pytest.raises(ResultsError, match=f"must be {ON_BRIDGE} = {size:g}"):
        compare_modes(given, other)


def test_a_mass_added_by_name_is_no_other_file_of_the_model(nominal, tmp_path):
    """A stiffness that differs in the model file is."""
    mass = '[parameters]\n"added_mass.slider.TOP" = "1 g"\n[[sweep]]'
    texts = (STUDY, STUDY.replace("[[sweep]]", mass))
    facts = [facts_of(write_blocks(tmp_path, study=text)) for text in texts]
    sides = [relabelled(nominal, OF_FILE | one) for one in facts]
    assert compare_modes(*sides).attrs["changes"] == []  # of the study files: they are nominal's
    other = write_blocks(tmp_path, ("normal = 2000.0", "normal = 1000.0"))
    other = relabelled(nominal, OF_FILE | facts_of(other))
    assert compare_modes(sides[0], other).attrs["changes"] == ["the files of the model"]
