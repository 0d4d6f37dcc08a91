"""A value that a study file gives in bar is shown in bar, while tables hold Pa."""

import copy
import pickle
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from made_results import made
from study_runs import solved
from study_texts import study_text

from squealstudy.cli.check import _constant, _ranges
from squealstudy.engine.parameter_units import units_of_study
from squealstudy.engine.report import _tables
from squealstudy.kinds.limit_cycles.screen import SCREEN as CYCLES
from squealstudy.kinds.transient.screen import _energy
from squealstudy.kinds.transient.screen import points as run_rows
from squealstudy.models.units import unit_as_written
from squealstudy.plots.style import quantity
from squealstudy.screen import as_text
from squealstudy.study.definition import parse_study
from squealstudy.wording import FAILED, amount, by_ranges, knots_text, with_unit

HEAD = '[study]\nname = "s"\nkind = "complex_modes"\n[model]\nname = "disc_brake"\n'
SWEEP = '[[sweep]]\nparameter = "pressure"\nvalues = ["7 bar", "12 bar"]\n'
SI = {"pressure": "Pa", "friction": "", "sliding_speed": "m/s"}


def results_of(text, **tables):
    return made(units=SI, facts={"study": text, "parameters": ["pressure"]}, **tables)


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ('["7 bar", "12 bar"]', ("7 bar", "12 bar")),
        ('["0.7 MPa", 12e5]', ("0.7 MPa", "1.2 MPa")),  # of one parameter one unit
        ("[7e5, 12e5]", ("700 kPa", "1.2 MPa")),
    ],
)
def test_values_come_back_as_the_file_has_them(written, shown):
    text = HEAD + SWEEP.replace('["7 bar", "12 bar"]', written)
    unit = results_of(text).units["pressure"]
    assert (amount(7e5, unit), amount(12e5, unit)) == shown
    assert unit == "Pa"  # of the tables, and in their metadata


def test_shares_stay_as_tables_have_them():
    text = HEAD + '[parameters]\nfriction = "40 %"\nsliding_speed = "1.8 km/h"\n'
    text += 'pad.half_angle = "0.5 rad"\n'
    units = units_of_study(parse_study(text, None))
    assert amount(0.4, units["friction"]) == "0.4"
    assert amount(0.5, units["sliding_speed"]) == "1.8 km/h"
    assert amount(90.0, units["pad.half_angle"]) == "1.571 rad"


def test_units_outlive_copies_of_tables():
    unit = results_of(HEAD + SWEEP).units["pressure"]
    for twin in (copy.deepcopy(unit), pickle.loads(pickle.dumps(unit))):
        assert (twin, amount(7e5, twin)) == ("Pa", "7 bar")


def test_sentences_and_axes():
    units = results_of(HEAD + SWEEP).units
    words = ["stable", "stable", "squeals"]
    ranges = by_ranges("pressure", units["pressure"], [2e5, 7e5, 12e5], words)
    assert ranges == "stable at pressure 2 to 7 bar (2 points), squeals at pressure 12 bar"
    axis = quantity("pressure", pd.Series([7e5, 12e5]), units)
    assert (axis.label, axis.text(7e5)) == ("pressure [bar]", "pressure = 7 bar")
    assert axis.ticks(pd.Series([7e5, 12e5])) == pytest.approx([7.0, 12.0])
    assert "knots at pressure 5, 9 bar," in knots_text({"pressure": [5e5, 9e5]}, units)


def test_columns_of_screens_and_reports():
    nan = dict.fromkeys(("growth_rate", "torque_rms", "level_error", "frequency_hz"), np.nan)
    nan |= dict.fromkeys(("max_growth_rate", "threshold_velocity", "threshold_share"), np.nan)
    head = {"pressure": [7e5, 12e5], "status": "not_converged", "verdict": "", "reason": ""}
    points = pd.DataFrame(head | nan).assign(transfer_to=0, message="", **{"class": FAILED})
    results = results_of(HEAD + SWEEP, points=points, verdicts=points[:0], cycles=points[:0])
    screen = as_text(CYCLES.findings(results))
    assert "pressure bar" in screen
    assert [line.split()[0] for line in screen.splitlines() if "failed: " in line] == ["7", "12"]
    runs = as_text(run_rows(points, ["pressure"], results.units, "N m"))
    assert "pressure bar" in runs
    assert [line.split()[0] for line in runs.splitlines() if "not_" in line] == ["7", "12"]
    points.attrs["units"] = results.units
    page = "".join(_tables(SimpleNamespace(tables=["points"], table=lambda _: points)))
    assert ">pressure [bar]<" in page
    assert "<td>7</td>" in page


def test_where_a_mode_has_most_energy_is_in_the_unit_of_the_file():
    row = {"mode": 1, "frequency_hz": 2e3, "energy_share": 0.5, "energy_share_max": 0.6}
    row |= {"dominant_points": 2, "worst": "friction=0.4, pressure=1.2e+06"}
    cells = _energy(row, True, False, results_of(HEAD + SWEEP))
    assert cells[-1].replace("\xa0", " ") == "friction 0.4, pressure 12 bar"


def test_check_tells_the_range_in_the_unit_of_the_file():
    study = parse_study(HEAD + SWEEP + '[parameters]\nsliding_speed = "1.8 km/h"\n', None)
    assert _ranges(study) == [("  pressure", "7 to 12 bar, 2 values")]
    assert "sliding_speed = 1.8 km/h" in _constant(study)[0][1]


def test_each_value_comes_back_in_a_unit_of_the_file():
    force = unit_as_written(["1 N", "20 kN"], "N")
    assert [amount(x, force) for x in (1.0, 999.0, 5e3, 2e4)] == ["1 N", "999 N", "5 kN", "20 kN"]
    mass = copy.deepcopy(unit_as_written(["1 g", "1 kg", "1 t"], "kg"))
    assert [amount(x, mass) for x in (1e-3, 1.0, 1e3, 0.0)] == ["1 g", "1 kg", "1 t", "0 g"]
    assert with_unit("mass", {"mass": mass}) == "mass g"  # a column has one unit


def test_the_worst_value_of_a_parameter_that_does_nothing_is_any(tmp_path):
    text = (
        study_text("mass", "complex_modes", "hulten")
        + """\
[[sweep]]
parameter = "friction"
values = [0.2, 0.4]
[[sweep]]
parameter = "mass"
values = ["1 g", "1 kg", "1 t"]
[modes]
reference_points = 0
"""
    )
    results = solved(text, tmp_path)
    table = results.screen.rank(results, "share", None, None)
    assert table["at"].tolist() == ["friction=0.4, mass=any"]
    assert results.screen.verdict(results).endswith("1/s at friction 0.4.")
