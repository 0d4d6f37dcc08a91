"""Names of the pictures of runs: by the values of a design point; and how a screen lists them."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from transient_tables import points_table

from squealstudy.cli.run import _by_plot
from squealstudy.engine.results import Results
from squealstudy.plots.over_time import histories
from squealstudy.shown_units import UnitAsWritten

UNITS = {"pressure": UnitAsWritten("Pa", "bar", 1e5), "friction": "", "sliding_speed": "m/s"}


def names_of(n=2, units=UNITS, **varied):
    points = points_table(varied, ["limit_cycle"] * n)
    store = SimpleNamespace(kept_histories=lambda: set(points["point_id"]))
    results = SimpleNamespace(points=points, store=store, units=units)
    results.file_word = lambda name: Results.file_word(results, name)
    return [name for name, _ in histories(results)]


@pytest.mark.parametrize(
    ("varied", "names"),
    [
        ({"friction": [0.5, 0.65]}, ["_friction_0.5", "_friction_0.65"]),
        ({"pressure": [7e5, 12e5]}, ["_pressure_7_bar", "_pressure_12_bar"]),
        (
            {"friction": [0.5, 0.6], "sliding_speed": [0.1, 0.2]},
            ["_friction_0.5_sliding_speed_0.1", "_friction_0.6_sliding_speed_0.2"],
        ),
        ({"friction": [0.5, 0.5]}, ["_point_0", "_point_1"]),  # nothing varies
        ({"friction": [0.5, 0.500001]}, ["_point_0", "_point_1"]),  # one name of two
        (
            {"friction": [1, 2], "pressure": [1, 2], "sliding_speed": [1, 2]},
            ["_point_0", "_point_1"],
        ),
    ],
)
def test_pictures_of_runs_are_named_by_values(varied, names):
    assert names_of(**varied) == names


def test_units_with_a_prefix_or_a_quotient_are_names_of_files():
    assert names_of(units={"pressure": "Pa"}, pressure=[4e5, 12e5])[0] == "_pressure_0.4_MPa"
    speeds = UnitAsWritten("m/s", "km/h", 1 / 3.6)
    names = names_of(units={"sliding_speed": speeds}, sliding_speed=[0.5, 1.0])
    assert names[0] == "_sliding_speed_1.8_km_per_h"


def test_many_pictures_of_one_plot_are_one_entry_of_the_screen():
    many = [Path(f"spectrogram_friction_0.{k}.png") for k in range(4)]
    few = [Path(f"levels_{name}.png") for name in ("friction", "pressure", "sliding_speed")]
    texts = _by_plot([*many, *few, Path("my_own.png")])
    assert texts == ["spectrogram_*.png (4)", *(path.name for path in few), "my_own.png"]
