"""One mode has one number and one frequency: rankings, families of tracks, verdicts, files."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from study_runs import command, plan_of, solved

from squealstudy import read_study, run
from squealstudy.cli.check import _design, check
from squealstudy.errors import StudyFileError
from squealstudy.kinds.design.verdict import beyond_validity
from squealstudy.plots.stability_diagram import _named_modes
from squealstudy.shapes.names import _ring
from squealstudy.shapes.shape import Label
from squealstudy.tables.families import (
    exchanged_tracks,
    families,
    linked_tracks,
    neighbours,
    pairs_growing_together,
)
from squealstudy.tables.mode_ranking import rank_modes

FALLING = """
[study]
name = "falling"
kind = "complex_modes"
[model]
name = "matrices"
folder = "{folder}"
[[model.term]]
matrix = "M"
file = "m.npz"
[[model.term]]
matrix = "C"
file = "c.npz"
coefficient = "(x - 70)**2"
[[model.term]]
matrix = "K"
file = "k.npz"
coefficient = "x*x"
[parameters]
x = 80.0
[[sweep]]
parameter = "x"
values = [80.0, 90.0, 100.0]
[modes]
band = [1.0, 1000.0]
reference_points = 0
"""
ONSET = {"point_before": "p1", "point_after": "p2", "status": "renumbered", "frequency_hz": 3140.0}


def onsets(*rows: dict) -> pd.DataFrame:
    return pd.DataFrame([ONSET | row for row in rows])


def test_an_unstable_mode_that_changes_its_number_is_one_family() -> None:
    """Of three modes that end or begin there, each goes on as the nearest in frequency."""
    table = onsets(
        {"track": 23, "direction": "out"},
        {"track": 25, "direction": "in", "frequency_hz": 3145.0},
        {"track": 7, "direction": "out", "frequency_hz": 900.0},
        {"track": 8, "direction": "in", "frequency_hz": 905.0},
        {"track": 9, "direction": "in", "status": "refined"},
    )
    assert linked_tracks(table) == [(23, 25), (7, 8)]
    begun = onsets(
        {"track": 1, "direction": "out"},
        {"track": 4, "direction": "in", "status": "first_seen", "point_before": ""},
    )
    assert linked_tracks(begun) == [(1, 4)]
    ended = onsets(
        {"track": 1, "direction": "out"}, {"track": 5, "direction": "out", "status": "broken"}
    )
    assert linked_tracks(ended) == []  # a track that ends by a jump is where none goes on


def test_families_count_modes_at_once_and_points_together() -> None:
    group, code = np.array([23, 23, 25, 25, 30]), np.array([0, 1, 2, 3, 3])
    tracks = pd.Index([23, 25, 30], name="track")
    table = onsets({"track": 25, "direction": "in"}, {"track": 23, "direction": "out"})
    found = families(tracks, linked_tracks(table), group, code)
    assert found["family"].tolist() == [23, 23, 30]
    assert found["family_modes"].tolist() == [1, 1, 1]
    assert found["family_points"].tolist() == [4, 4, 1]
    both = families(tracks, linked_tracks(table), np.append(group, 25), np.append(code, 0))
    assert both["family_modes"].tolist() == [2, 2, 1]  # at point 0 they are two


def test_the_ranking_has_the_frequency_where_a_mode_grows_fastest() -> None:
    points = pd.DataFrame({"point_id": list("abc"), "status": "ok", "friction": [0.1, 0.2, 0.3]})
    points = points.assign(n_modes=1)
    modes = pd.DataFrame({"point_id": list("abc"), "track": 1, "frequency_hz": [88.0, 94.0, 100.1]})
    modes = modes.assign(growth_rate=[1.0, 50.0, 206.6], unstable=True, overdamped=False)
    modes = modes.assign(damping_ratio=-0.1, track_ambiguous=False, mode=1)
    (row,) = rank_modes(points, modes, "friction").to_dict("records")
    assert (row["frequency_hz"], row["max_growth_rate"], row["at"]) == (
        100.1,
        206.6,
        "friction=0.3",
    )


def test_the_verdict_sets_number_and_frequency_of_the_worst_point(tmp_path: Path) -> None:
    """Of one degree of freedom with negative damping, of 80, 90 and 100 Hz."""
    text = FALLING
    for name, matrix in (("m", 1.0), ("c", -1.0), ("k", (2.0 * np.pi) ** 2)):
        sp.save_npz(tmp_path / f"{name}.npz", sp.csr_matrix([[matrix]]))
    path = tmp_path / "falling.toml"
    results = solved(plan_of(text.format(folder=tmp_path.as_posix()), path), tmp_path / "r")
    text = results.screen.verdict(results)
    worst = results.modes.loc[results.modes["growth_rate"].idxmax()]
    assert f"T{worst['track']} at {worst['frequency_hz']:.0f} Hz, by" in text
    assert "between 1 and 1000 Hz" in text


def test_files_of_a_mode_have_its_number_and_frequency() -> None:
    label = Label(point_id="5a0b", mode=7, track=23, fastest_hz=3187.6)
    assert label.file_name == "T23_3188_hz_5a0b"
    assert Label(point_id="5a0b", mode=7).file_name == "mode_7_5a0b"


def test_a_verdict_says_what_the_chosen_design_breaks() -> None:
    rule = "modal damping is light, a ratio of at most 0.2"
    points = pd.DataFrame({"design": [0, 1, 1, 1], "valid": [True, False, False, True]})
    points["invalid_reason"] = ["", f"{rule}: 0.2465", f"{rule}: 0.2465", ""]
    text = beyond_validity(points, 1)
    assert "at 2 of 3 solved operating points the chosen design is beyond" in text
    assert f"2 break '{rule}'" in text
    assert not beyond_validity(points, None)


def test_the_ring_of_a_disc_goes_out_to_its_rim_and_that_of_a_drum_does_not() -> None:
    """Beyond the pads lies the rim: without it a mode of 55 % axial motion was "in plane"."""
    radii = np.array([0.09, 0.11, 0.12, 0.13, 0.14])
    at = np.column_stack([radii, np.zeros(5), np.zeros(5)])
    part = SimpleNamespace(blocks=[("", np.arange(5)[None])], volumes=np.ones(1))
    rubbed = np.column_stack([[0.11, 0.13], [0.0, 0.0], [-0.005, 0.005]])
    assert _ring(at, rubbed, part)[0].tolist() == [1, 2, 3, 4]  # type: ignore[arg-type]
    face = np.column_stack([[0.12, 0.12], [0.0, 0.0], [-0.005, 0.005]])
    assert _ring(at, face, part)[0].tolist() == [2]  # type: ignore[arg-type]


def test_check_names_the_limit_that_run_refuses_for(tmp_path: Path) -> None:
    text = '[study]\nname = "many"\nkind = "complex_modes"\n[model]\nname = "hulten"\n'
    text += '[[sweep]]\nparameter = "friction"\nstart = 0.0\nstop = 1.0\nnum = 30\n'
    text += "[design]\nlimit = 20\n"
    plan = plan_of(text, tmp_path / "many.toml")
    assert "`run` refuses more than design.limit = 20 without --yes" in _design(plan, 30, tmp_path)


def test_modes_that_exchange_their_growth_between_neighbours_are_one_family() -> None:
    """Of two linings one mode near 3.8 kHz grows with each, under two numbers; one far off not."""
    points = pd.DataFrame({"friction": [0.5, 0.6, 0.5, 0.6], "lining": [1.5, 1.5, 2.2, 2.2]})
    points["status"] = "ok"
    edges = neighbours(points, ["friction", "lining"])
    assert sorted(map(tuple, edges.tolist())) == [(0, 1), (0, 2), (1, 3), (2, 3)]
    modes = pd.DataFrame({"track": [22, 23, 40] * 4, "point": np.repeat(range(4), 3)})
    modes["frequency_hz"] = [3750.0, 3800.0, 4500.0] * 4
    modes["unstable"] = [True, False, False] * 2 + [False, True, True] * 2
    modes["track_ambiguous"] = [False] * 7 + [True] + [False] * 4
    code = modes["point"].to_numpy()
    assert list(exchanged_tracks(modes, code, edges, [22, 23, 40])) == [(22, 23)]
    sure = modes.assign(track_ambiguous=False)
    assert list(exchanged_tracks(sure, code, edges, [22, 23, 40])) == []


def test_two_modes_without_coupling_that_grow_in_turn_are_two(tmp_path: Path) -> None:
    """At 100 and 101 Hz; friction beyond .5 takes the growth of one and gives it to the other."""
    text = FALLING[: FALLING.index("[[model.term]]")]
    for name, parts in (("M", [1.0, 1.0]), ("K", [100.0**2, 101.0**2])):
        scale = 4 * np.pi**2 if name == "K" else 1.0
        sp.save_npz(tmp_path / f"{name}.npz", sp.csr_matrix(scale * np.diag(parts)))
        text += f'[[model.term]]\nmatrix = "{name}"\nfile = "{name}.npz"\n'
    for name, parts, way in (("A", [1.0, 0.0], "x - 0.5"), ("B", [0.0, 1.0], "0.5 - x")):
        sp.save_npz(tmp_path / f"{name}.npz", sp.csr_matrix(np.diag(parts)))
        text += f'[[model.term]]\nmatrix = "C"\nfile = "{name}.npz"\ncoefficient = "20*({way})"\n'
    text += "[parameters]\nx = 0.3\n" + FALLING[FALLING.index("[[sweep]]") :]
    text = text.replace("[80.0, 90.0, 100.0]", "[0.1, 0.3, 0.7, 0.9]")
    results = solved(
        plan_of(text.format(folder=tmp_path.as_posix()), tmp_path / "two.toml"), tmp_path / "r"
    )
    assert results.rank()["family"].tolist() == [1, 2]


def test_neighbours_pass_over_failed_points() -> None:
    """As tracks do: a mode may change its number where a point between two has failed."""
    points = pd.DataFrame({"x": [1.0, 3.0, 2.0, 4.0], "y": 0.0})
    points["status"] = ["ok", "ok", "not_converged", "ok"]
    assert sorted(map(tuple, neighbours(points, ["x"]).tolist())) == [(0, 1), (1, 3)]


@pytest.mark.parametrize("others", [0, 70])
def test_a_mode_that_is_no_nominal_one_is_followed_by_its_shape(
    others: int, tmp_path: Path
) -> None:
    """At 100 and 200 Hz times 1 + x, without coupling: the first comes into the band at .1."""
    hz = np.concatenate([[100.0, 200.0], np.linspace(3e3, 4e3, others)])
    text = FALLING[: FALLING.index("[[model.term]]")]
    for name, parts, way in (
        ("M", np.ones(len(hz)), "1"),
        ("C", np.ones(len(hz)), "-1"),
        ("K", (2 * np.pi * hz) ** 2, "(1 + x)**2"),
    ):
        sp.save_npz(tmp_path / f"{name}.npz", sp.csr_matrix(np.diag(parts)))
        text += f'[[model.term]]\nmatrix = "{name}"\nfile = "{name}.npz"\ncoefficient = "{way}"\n'
    text += "[parameters]\nx = 0.0\n" + FALLING[FALLING.index("[[sweep]]") :]
    text = text.replace("[80.0, 90.0, 100.0]", "[0.0, 0.1, 0.2, 0.6]").replace(
        "[1.0, 1000.0]", "[105.0, 230.0]"
    )
    results = solved(plan_of(text.format(folder=tmp_path.as_posix())), tmp_path / "r")
    ranking = results.rank()
    assert ranking["unstable_points"].tolist() == [3, 2]
    assert not ranking["ambiguous"].any()


def test_check_and_run_name_the_limit_before_points_are_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = '[study]\nname = "vast"\nkind = "complex_modes"\n[model]\nname = "hulten"\n'
    for name, stop in (("friction", 0.9), ("frequency_1", 110.0)):
        text += f'[[sweep]]\nparameter = "{name}"\nstart = 0.1\nstop = {stop}\nnum = 1100\n'
    path = tmp_path / "vast.toml"
    path.write_text(text)
    monkeypatch.setattr("squealstudy.engine.plan.design_points", lambda _: pytest.fail("made"))
    rows = dict(check(read_study(path), tmp_path / "out", 1, False, False, None))
    assert "1,210,000 points; `run` refuses more than design.limit = 20,000" in rows["design"]
    assert rows["  friction"] == "0.1 to 0.9, 1,100 values"
    with pytest.raises(StudyFileError, match="1,210,000 design points, more than the limit"):
        run(path, tmp_path / "out")


def test_why_of_own_matrices_needs_no_variable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two masses whose stiffness friction couples; files beside the study, results elsewhere."""
    hz = np.array([100.0, 110.0])
    folder = tmp_path / "study"
    folder.mkdir()
    text = '[study]\nname = "pair"\nkind = "complex_modes"\n[model]\nname = "matrices"\n'
    for matrix, way, entries in (
        ("M", "1", np.eye(2)),
        ("K", "1", np.diag((2 * np.pi * hz) ** 2)),
        ("K", "mu", np.array([[0.0, 1e5], [-1e5, 0.0]])),
    ):
        name = f"{matrix}_{way}.npz"
        sp.save_npz(folder / name, sp.csr_matrix(entries))
        text += f'[[model.term]]\nmatrix = "{matrix}"\nfile = "{name}"\ncoefficient = "{way}"\n'
    text += "[parameters]\nmu = 0.0\n" + FALLING[FALLING.index("[[sweep]]") :]
    text = text.replace('"x"', '"mu"').replace("[80.0, 90.0, 100.0]", "[0.0, 0.3, 1.0]")
    (folder / "pair.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SQUEALSTUDY_DATA", raising=False)
    assert command("run", "study/pair.toml", "--output", "elsewhere", "--no-pictures") == 0
    capsys.readouterr()
    assert command("rank", "elsewhere", "--why") == 0
    assert "the two have locked in" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("begins", "ends", "status", "error", "together"),
    [
        (0.6787, 0.6975, "refined", 2e-4, [(25, 23)]),  # softer_lining: both grow between .6 and .7
        (0.6975, 0.6787, "refined", 2e-4, []),
        (0.6787, 0.6790, "refined", 2e-4, []),  # as far as is known
        (0.6787, 0.6975, "refined", np.nan, []),
        (0.6787, 0.6975, "crossing", 2e-4, []),  # of labels that may have changed places
    ],
)
def test_tracks_that_grow_at_once_between_points_are_two_modes(
    begins, ends, status, error, together
):
    onsets = pd.DataFrame(
        {
            "track": [23, 25],
            "onset": [ends, begins],
            "direction": ["out", "in"],
            "status": status,
            "error_estimate": error,
            "point_before": "p0",
            "point_after": "p1",
        }
    )
    assert pairs_growing_together(onsets) == together
    group, code = np.array([23, 25]), np.array([0, 1])
    table = families(pd.Index([23, 25]), [(23, 25)], group, code, together)
    assert set(table["family"]) == {23}
    assert set(table["family_modes"]) == {1 + len(together)}
    points = pd.DataFrame({"point_id": ["p0", "p1"], "status": "ok", "friction": [0.6, 0.7]})
    modes = pd.DataFrame({"point_id": ["p0", "p0", "p1", "p1"], "track": [23, 25, 23, 25]})
    modes = modes.assign(frequency_hz=[3200.0, 3210.0, 3200.0, 3210.0], track_ambiguous=True)
    modes = modes.assign(unstable=[True, False, False, True], overdamped=False)
    sign = np.where(modes["unstable"], 1.0, -1.0)
    modes = modes.assign(growth_rate=50.0 * sign, damping_ratio=-0.01 * sign)
    ranked = rank_modes(points.assign(n_modes=2), modes, "friction", onsets=onsets)
    assert set(ranked["family"]) == {23}
    assert set(ranked["family_modes"]) == {1 + len(together)}


def test_a_diagram_of_one_number_of_two_modes_counts_one() -> None:
    """Of a family of two modes, at a part of the points, T23 alone is drawn, and T34."""
    ranked = pd.DataFrame(
        {"track": [23, 25, 34], "family": [23, 23, 34], "family_modes": [2, 2, 1]}
    )
    results = SimpleNamespace(rank=lambda: ranked)
    modes = pd.DataFrame({"track": [23, 34, 25], "frequency_hz": [3200.0, 4900.0, 3230.0]})
    modes = modes.assign(unstable=True, overdamped=False, growth_rate=1.0, damping_ratio=-0.01)
    assert _named_modes(results, modes[:2], 2) == "2 unstable tracks"
    assert _named_modes(results, modes, 2) == "3 unstable tracks"
    ranked["family_modes"] = [1, 1, 1]
    assert _named_modes(results, modes, 2) == "2 unstable modes of 3 numbers"
