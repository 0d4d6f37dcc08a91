"""What a report says first, of each kind, against the tables; a shape that moves."""

from __future__ import annotations

import html
import re

import numpy as np
import pandas as pd
import pytest
from explored import brake_map
from made_results import made
from matplotlib.figure import Figure
from matrix_families import write_family
from study_runs import plan_of, solved
from study_texts import study_text
from transient_tables import growth_table, modes_table, points_table

import squealstudy as sq
from squealstudy.engine.report import report
from squealstudy.engine.report_squeals import squeal_text
from squealstudy.errors import SquealstudyError
from squealstudy.kinds.design.screen import SCREEN as DESIGN
from squealstudy.kinds.limit_cycles.screen import SCREEN as CYCLES
from squealstudy.kinds.transient.screen import SCREEN as RUNS
from squealstudy.wording import in_digits

HULTEN = study_text("flutter", "complex_modes", "hulten")
HULTEN += '[[sweep]]\nparameter = "friction"\nvalues = {frictions}\n'
SILENT = "No mode between 1 and 16000 Hz is unstable at any of the 2 solved points"
BRAKE = """
[study]
name = "brake"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2
[parameters]
damping_ratio = 0.0
[reduction]
enrichment = false
[modes]
band = [500.0, 4000.0]
refine_tracking = false
refine_onsets = false
reference_points = 0
"""


def run_failing(text, folder):
    """The results of a study of which every point fails."""
    folder.mkdir(exist_ok=True)
    path = folder / "study.toml"
    path.write_text(text)
    with pytest.raises(SquealstudyError, match="every design point"):
        sq.run(path, folder / "r", jobs=1, fresh=True)
    return folder / "r"


def unillustrated(*results, shapes=False):
    """The page without the pictures, most of its time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("squealstudy.engine.report.report_pictures", lambda one, room: ([], 0))
        return report(results, shapes)


def quickly(*results):
    """The page with pictures that are made, but not painted: half of their time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", lambda figure, file, **_: file.write(b"painted"))
        return report(results, False)


def verdict(results):
    """As it stands on the page."""
    return verdict_of(unillustrated(results))


def verdict_of(page):
    return html.unescape(re.findall(r'class="verdict">(.*?)</p>', page)[0])


def test_of_complex_modes_it_is_the_ranking(tmp_path):
    results = solved(HULTEN.format(frictions=[0.1, 0.2, 0.4, 0.5]), tmp_path / "r")
    (row,) = results.rank().to_dict("records")
    fastest = results.modes.loc[results.modes["growth_rate"].idxmax()]
    hz, growth = in_digits(fastest["frequency_hz"]), in_digits(fastest["growth_rate"], 1)
    (at_onset,) = (in_digits(float(f)) for f in results.onsets["frequency_hz"])
    assert verdict(results) == (
        f"1 mode is unstable between 1 and 16000 Hz: T{row['track']} at {hz} Hz first at friction "
        f"{row['threshold']:.4g} ({at_onset} Hz there). Most widespread: "
        f"T{row['track']} at {hz} Hz, "
        f"at 50 % of the 4 solved points. Fastest: T{row['track']} at {hz} Hz, "
        f"by {growth} 1/s at friction 0.5."
    )


def test_a_mode_unstable_at_few_points_is_not_told_as_of_none(tmp_path):
    results = solved(HULTEN.format(frictions=[0.1, 0.4]), tmp_path / "r")
    stable = [results.points.iloc[:1].assign(point_id=f"p{k}") for k in range(298)]
    tables = {name: results.table(name) for name in results.tables}
    many = results.with_tables(**tables | {"points": pd.concat([results.points, *stable])})
    assert "at 0.333 % of the 300 solved points" in many.screen.verdict(many)


def test_files_that_a_study_names_are_told_where_it_is_to_be_run_again(tmp_path):
    """The page does not hold them; a name of a set with a dot in it is none."""
    found = solved(HULTEN.format(frictions=[0.5]), tmp_path / "r")
    assert "reads files" not in unillustrated(found)
    named = (
        '[[variant]]\nmodel.file = "a <b>.toml"\n[study.c]\nextensions = ["law.py"]\non = "d.OUT"'
    )
    found.manifest["study"] += f"\n{named}\n"
    assert " not hold: law.py, a &lt;b&gt;.toml.</p>" in unillustrated(found)


def test_of_a_silent_brake_it_says_so(tmp_path):
    results = solved(HULTEN.format(frictions=[0.1, 0.2]), tmp_path / "r")
    assert verdict(results) == f"{SILENT}."


def test_of_a_silent_brake_whose_errors_are_large_it_says_that_it_is_not_certain(tmp_path):
    results = solved(HULTEN.format(frictions=[0.1, 0.2]), tmp_path / "r")
    doubtful = results.modes.assign(stability="uncertain")
    tables = {name: results.table(name) for name in results.tables}
    told = results.screen.verdict(results.with_tables(**tables | {"modes": doubtful}))
    assert told.startswith(f"{SILENT}. But at 2 solved ")


SPRAG = """
[study]
name = "sprag"
kind = "{kind}"
[model]
name = "hoffmann"
contact_law = "exponential"
[parameters]
alpha1 = 30.0
alpha2 = 150.0
damping_ratio = 0.01
sliding_speed = 10.0
[[sweep]]
parameter = "friction"
values = {frictions}
"""  # inclined so that any contact force calls for more: no equilibrium beyond a friction


def test_points_without_a_result_are_told_beside_the_verdict(tmp_path):
    text = SPRAG.format(kind="complex_modes", frictions=[0.05, 0.1, 5.0])
    results = solved(text, tmp_path / "r")
    (lost,) = results.points[(results.points["status"] != "ok").to_numpy(bool)].itertuples()
    page = quickly(results)
    told = f"1 of 3 points is not ok (1 {lost.status})."
    assert verdict_of(page) == f"{SILENT}. {told}"
    assert html.escape(f"{told} The first: {lost.message}") in page
    assert "stability_diagram_worst" not in page  # it is the failed one, if any
    assert "(ranking)" not in page  # nothing to see


def test_of_a_study_without_any_result_it_says_so(tmp_path):
    text = SPRAG.format(kind="complex_modes", frictions=[4.0, 5.0])
    results = sq.open_results(run_failing(text, tmp_path))
    page = quickly(results)
    assert verdict_of(page).startswith("No design point is solved. 2 of 2 points are not ok (2 ")
    assert "no unstable mode" not in page
    cycles = sq.open_results(
        run_failing(text.replace("complex_modes", "limit_cycles"), tmp_path / "c")
    )
    told = "Hz: failed at friction 4 to 5 (2 points). 2 of 2 points are not ok (2 working_point)."
    page = quickly(cycles)
    assert verdict_of(page).endswith(told)
    assert not re.search(r"\bnan\b", re.sub(r"base64,[^\"]*", "", page))


def test_of_limit_cycles_beside_growth_without_oscillation_it_says_that_the_design_diverges(
    tmp_path,
):
    """Friction that falls so steeply that it overcomes critical damping."""
    text = study_text("falls_steeply", "limit_cycles", "belt") + "[parameters]\n"
    text += '"friction_law.static_ratio" = 10.0\n"friction_law.decay_speed" = 0.05\n'
    text += '[[sweep]]\nparameter = "sliding_speed"\nvalues = [0.05, 0.06]\n'
    cycles = sq.open_results(run_failing(text, tmp_path))
    told = "failed at sliding_speed 0.05 to 0.06 m/s (2 points). 2 of 2 points are not ok ("
    assert verdict(cycles).endswith(f"{told}2 diverges).")


def test_a_heading_without_findings_is_left_out(tmp_path):
    page = report([solved(HULTEN.format(frictions=[0.1, 0.2]), tmp_path / "r")], False)
    assert "<h2>Findings</h2>" not in page
    assert "<h2>Pictures</h2>" in page


def test_of_runs_it_counts_what_they_came_to():
    kinds = ["limit_cycle", "limit_cycle", "failed", "stable", "growing"]
    levels = {"torque_rms": [40.0, 60.0, 0.0, 0.1, 99.0], "torque_line_hz": 3175.0}
    points = points_table({"friction": np.linspace(0.3, 0.5, 5)}, kinds, **levels)
    runs = made(kind="transient", points=points, modes=modes_table({}), growth=growth_table([]))
    told = RUNS.verdict(runs)
    assert told.startswith("5 runs: 2 limit cycles, 1 failed, 1 stable, 1 growing.")
    # that which grows has no level yet
    assert "RMS of the torque 60.0 +- 3.0 N m, loudest near 3175 Hz." in told


@pytest.mark.parametrize("n_runs", [1, 4])
def test_of_limit_cycles_that_were_not_seen_to_repeat_it_says_so(n_runs):
    """A chaotic pad of two frictions was "1 run: limit cycle. RMS 207 +- 13 N" and no more."""
    kinds = ["limit_cycle", "limit_cycle", "limit_cycle", "irregular"][:n_runs]
    points = points_table({"friction": np.linspace(0.3, 0.5, n_runs)}, kinds)
    points["frequency_hz"] = [np.nan, 175.0, np.nan, np.nan][:n_runs]
    points["swing_spread"] = [1.19, 0.3, 0.05, 2.0][:n_runs]
    runs = made(kind="transient", points=points, modes=modes_table({}), growth=growth_table([]))
    which = "No" if n_runs == 1 else "In 1 of 3 limit cycles no"
    swings = "peak-to-peak values of single swings differ by up to 119 % of their mean."
    assert f" {which} period was seen: {swings}" in RUNS.verdict(runs)


def test_of_an_undecided_run_it_says_what_is_known():
    levels = {"torque_rms": [1191.0], "torque_line_hz": 599.0, "growth_rate": 676.7}
    points = points_table({"friction": [1.2]}, ["undecided"], **levels)
    run = made(kind="transient", points=points, modes=modes_table({}), growth=growth_table([]))
    told = RUNS.verdict(run)
    assert told.startswith("1 run: undecided. Over its end the RMS of the torque is 1191.0 +- 3.0")
    assert " N m, loudest near 599 Hz" in told
    assert " Whether it stays so is open. It grew by 676.7 +- 6.0 1/s" in told
    assert RUNS.verdict(run.with_tables(points=points.assign(torque_rms=np.nan))) == (
        "1 run: undecided."
    )


def test_of_limit_cycles_it_counts_verdicts():
    points = pd.DataFrame(
        {
            "status": ["ok", "ok", "ok", "not_converged"],
            "verdict": ["squeals_if_kicked", "squeals_if_kicked", "undecided", None],
        }
    )
    told = CYCLES.verdict(made(kind="limit_cycles", points=points))
    assert told == (
        "4 designs, modes between 1 and 8000 Hz: 2 squeal if kicked, 1 undecided, 1 failed."
    )


def test_of_limit_cycles_it_tells_errors_of_levels_that_runs_decided():
    """The largest error of a level was that of cycles alone, beside a run's level of 3.5 %."""
    cycles = pd.DataFrame(
        {
            "point_id": ["a"],
            "torque_rms": [7.0],
            "level_error": [1e-4],
            "same_as": "",
            "status": "ok",
        }
    )
    levels = {"torque_rms": [7.0, 9.0, 8.0], "level_error": [1e-4, 0.035, np.nan]}
    points = pd.DataFrame({"point_id": ["a", "b", "c"], **levels})
    tables = {"cycles": cycles, "verdicts": pd.DataFrame({"verdict": ["squeals"] * 3})}
    names = ("point_id", "cycle_id", "along", "event", "value", "criticality", "branch_end")
    tables |= {"branches": pd.DataFrame(columns=list(names)), "borders": pd.DataFrame()}
    tables["points"] = points
    facts = dict(CYCLES.facts(made(kind="limit_cycles", **tables)))
    assert facts["cycles"] == "1 cycle; the largest error of a level is 0.01 %"
    assert facts["runs in time"] == (
        "2 levels; the largest error is 3.5 %; the error of 1 is not known"
    )
    assert [name for name in facts if name in CYCLES.sure] == ["cycles", "runs in time"]
    alone = made(kind="limit_cycles", **tables | {"points": points[:1]})
    assert "runs in time" not in dict(CYCLES.facts(alone))


@pytest.mark.parametrize("folder", ["parts", None])
def test_it_tells_files_of_matrices_with_their_folder(folder, tmp_path):
    """`folder` of [model] was left out: the named files were none of the study's folder."""
    (tmp_path / "parts").mkdir()
    text = study_text("own", "complex_modes", "matrices")
    text += 'folder = "parts"\n' if folder else ""
    place = tmp_path / (folder or "")
    text += write_family(place, {"m": ("M", np.eye(2)), "k": ("K", 1e6 * np.eye(2))}, {})
    plan = plan_of(text + "[modes]\nband = [10.0, 1000.0]\n", tmp_path / "own.toml")
    page = report([solved(plan, tmp_path / "results")], False)
    assert (
        f"not hold: {'parts/' if folder else ''}m.npz, {'parts/' if folder else ''}k.npz." in page
    )


def test_of_limit_cycles_it_tells_events_of_branches_with_units():
    names = ("point_id", "cycle_id", "along", "event", "value", "criticality", "branch_end")
    rows = [("p", "c", "pressure", "F", 5e5, "", ""), ("p", "c", "pressure", "", 6e5, "", "bound")]
    branches = pd.DataFrame(rows, columns=list(names)).assign(level_error=0.012)
    cycles = pd.DataFrame({"same_as": [], "status": [], "level_error": []})
    verdicts = pd.DataFrame({"verdict": ["no_cycle_found"]})
    tables = {"branches": branches, "cycles": cycles, "verdicts": verdicts}
    tables["borders"] = pd.DataFrame()
    tables["points"] = pd.DataFrame({"point_id": ["p"]})
    results = made(kind="limit_cycles", units={"pressure": "Pa"}, **tables)
    text = "along pressure: fold at 500 kPa; ends bound; its levels err by up to 1.2 %"
    assert ("branch", text) in CYCLES.facts(results)
    many = pd.concat([branches.assign(cycle_id=f"c{k}") for k in range(8)])
    facts = CYCLES.facts(results.with_tables(**tables | {"branches": many}))
    assert [name for name, _ in facts].count("branch") == 6
    assert facts[-1] == ("", "2 more in the branches table")
    names = ("border_id", "event", "along", "over", "line_difference")
    rows = [("a", "F", "p", "q", 2e-9), ("a", "F", "p", "q", np.nan), ("b", "H", "p", "q", -1e-8)]
    borders = pd.DataFrame([*rows, ("c", "F", "p", "q", np.nan)], columns=list(names))
    facts = CYCLES.facts(results.with_tables(**tables | {"borders": borders}))
    told = "2 curves of folds and 1 curve of Hopf points over p and q"
    assert facts[-1] == (
        "borders",
        f"{told}; where they meet branches they differ by 1e-08 at most",
    )


@pytest.fixture(scope="module")
def brake(tmp_path_factory, tiny_brake):
    return solved(BRAKE, tmp_path_factory.mktemp("brake") / "r")


def test_a_model_with_a_mesh_moves(brake):
    """The page of its fastest mode is inside, in quotes; it is small enough to be sent."""
    page = unillustrated(brake, shapes=True)
    (inside,) = re.findall(r'<iframe class="moving"[^>]* srcdoc="([^"]*)"', page)
    assert html.unescape(inside).lstrip().lower().startswith("<!doctype html>")
    assert "feeds" in page or "growth" in page
    assert ",," not in inside.split("places")[0]  # values of the design point, wrapped
    assert len(page) < 10_000_000
    growth = float(brake.modes["growth_rate"].max())
    assert f"{growth:.4g}" in html.unescape(page) or in_digits(growth, 1) in page


def test_a_minimal_model_has_no_shape(tmp_path):
    results = solved(HULTEN.format(frictions=[0.4]), tmp_path / "r")
    page = unillustrated(results, shapes=True)
    assert "<iframe" not in page
    assert "No shape" not in page


def test_of_a_design_errors_that_are_not_known_are_told():
    """An infinite one too; of none there is nothing to tell."""
    told = {}
    for error in (1e-9, np.inf, np.nan):
        facts = {"design_study": {"n_designs": 1, "rounds": 0, "n_reductions": 0}}
        margins = pd.DataFrame({"damping_error": [error, np.nan]})
        told[error] = dict(DESIGN.facts(made(kind="design", facts=facts, margins=margins)))
    texts = [found.get("error") for found in told.values()]
    unknown = "damping of some modes is not known: the solver's error"
    assert texts == ["the solver errs by less than 0.001 % of critical damping", unknown, None]


# -- pictures, and one name for one squeal ------------------------------------------------------
RUN = """
[study]
name = "{name}"
kind = "{kind}"
[model]
name = "hoffmann"
contact_law = "{law}"
[parameters]
damping_ratio = 0.001
sliding_speed = 0.1
{more}
[[sweep]]
parameter = "friction"
values = [0.8, 0.9]
[modes]
band = [10.0, 1000.0]
"""
IN_TIME = "[transient]\nduration = 0.6\nstep = 2e-5\nperturbation = 1e-4\nsave_every = 20\n"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    text = RUN.format(name="run", kind="transient", law="unilateral", more="") + IN_TIME
    return solved(text, tmp_path_factory.mktemp("run") / "r")


@pytest.fixture(scope="module")
def run_page(run):
    return quickly(run)


def test_the_picture_of_the_question_is_the_first(run, run_page, tmp_path):
    frictions = HULTEN.format(frictions=[0.1, 0.2, 0.4, 0.5])
    modes = solved(frictions, tmp_path / "r")
    loudest = int(run.points["torque_rms"].to_numpy().argmax())
    firsts = {
        f"torque_history_friction_{run.points['friction'].iloc[loudest]:g}": run_page,
        "evolution_friction": quickly(modes),
    }
    firsts["stability_map_growth"] = quickly(brake_map())
    for name, page in firsts.items():
        told = re.findall(r"\(([\w.]+)\)</figcaption>", page)
        assert told[0] == name
        assert len(set(told)) == len(told) > 2


def test_pictures_have_words_for_who_does_not_see_them(run, run_page):
    page = html.unescape(run_page)
    alone = re.findall(r'<img alt="([^"]*)"', page)
    assert all(len(text) > 40 for text in alone)
    assert "friction = 0.9" in alone[0]
    assert "Friction force [N]" in alone[0]
    assert re.search(r'<img alt="[^"]*Friction force', html.unescape(run._repr_html_()))


def test_the_squeal_of_a_run_has_the_name_of_the_predicted_mode(run, tmp_path):
    text = RUN.format(name="modes", kind="complex_modes", law="unilateral", more="")
    modes = solved(text, tmp_path / "modes")
    loudest = run.points.loc[run.points["torque_rms"].idxmax()]
    (root,) = run.growth[run.growth["point_id"] == loudest["point_id"]].to_dict("records")
    heard = loudest["frequency_hz"]
    heard = loudest["torque_line_hz"] if np.isnan(heard) else heard
    told = (
        f"The squeal at {in_digits(heard)} Hz, at friction = {loudest['friction']:.4g}, is the "
        f"complex mode predicted at {in_digits(root['frequency_hz'])} Hz there, with a growth rate "
        f"of {root['growth_rate']:+.3g} 1/s"
    )
    (alone,) = re.findall(r'class="squeal">(.*?)</p>', unillustrated(run))
    assert alone == f"{told}."
    (named,) = re.findall(r'class="squeal">(.*?)</p>', unillustrated(run, modes))
    own = modes.modes[modes.modes["unstable"]]
    assert named == f"{told}: T{own['track'].iloc[0]} of modes."
    other = solved(text.replace("sliding_speed = 0.1", "sliding_speed = 0.2"), tmp_path / "other")
    (still,) = re.findall(r'class="squeal">(.*?)</p>', unillustrated(run, other))
    assert still == alone


def test_the_squeal_of_a_cycle_is_told_by_its_mode():
    numbers = {"growth_rate": [-14.0, 3.0], "torque_rms": [300.0, 100.0]}
    hertz = {"frequency_hz": [229.7, 180.0], "cycle_frequency_hz": [217.97, 181.0]}
    verdicts = pd.DataFrame({"point_id": ["a", "b"]} | numbers | hertz)
    points = pd.DataFrame({"point_id": ["a", "b"], "friction": [0.5, 0.6]})
    results = made("limit_cycles", points=points, verdicts=verdicts, facts={"sweeps": ["friction"]})
    assert squeal_text(results, []) == (
        "The squeal at 218 Hz, at friction = 0.5, is the complex mode predicted at 230 Hz there, "
        "with a growth rate of -14 1/s."
    )
    silent = results.with_tables(points=points, verdicts=verdicts.assign(torque_rms=np.nan))
    assert squeal_text(silent, []) == ""


def test_a_report_tells_when_its_results_were_made(run_page):
    assert re.search(r"<th>date</th><td>20\d\d-\d\d-\d\d \d\d:\d\d UTC</td>", run_page)
    run_of_before = brake_map()
    assert "<th>date</th><td>not known" in unillustrated(run_of_before)
