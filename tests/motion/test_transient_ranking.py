import numpy as np
import pandas as pd
import pytest
from transient_tables import modes_table, points_table

from squealstudy.errors import ResultsError
from squealstudy.tables.energy_ranking import (
    COLUMNS,
    rank_energy,
    tells_parts,
    transient_parameters,
)

KINDS = ["limit_cycle", "irregular", "growing", "stable", "failed"]
SCALE = "caliper.modes[8].frequency_scale"


def study():
    points = points_table(
        {"friction": [0.3, 0.4, 0.5, 0.2, 0.6], "pressure": 12e5, SCALE: [1, 1, 1.25, 1, 1]},
        KINDS,
        torque_rms=[10.0, 50.0, 30.0, 0.1, np.nan],
        dominant_mode=[44, 51, 51, 45, 0],
        transfer_from=[0, 44, 0, 0, 0],
        transfer_to=[0, 51, 0, 0, 0],
    )
    modes = modes_table(
        {
            "p0": {44: 0.9, 45: 0.05, 51: 0.0},
            "p1": {44: 0.3, 45: 0.05, 51: 0.6},
            "p2": {44: 0.0, 45: 0.05, 51: 0.9},
            "p3": {44: 0.0, 45: 1.0, 51: 0.0},
        }
    )
    return points, modes


def test_modes_are_ordered_by_mean_energy_over_the_points_that_keep_vibrating():
    table = rank_energy(*study())
    assert list(table.columns) == list(COLUMNS)
    assert list(table["mode"]) == [51, 44, 45]
    assert table["energy_share"].tolist() == pytest.approx([0.5, 0.4, 0.05])
    assert table["energy_share_max"].tolist() == pytest.approx([0.9, 0.9, 0.05])
    assert table["first_share"].tolist() == pytest.approx([0.1] * 3)
    assert table["dominant_points"].tolist() == [2, 1, 0]
    assert table["gained_points"].tolist() == [1, 0, 0]
    assert table["lost_points"].tolist() == [0, 1, 0]
    assert set(table["points"]) == {3}
    assert table["frequency_hz"].tolist() == [4950.0, 3180.0, 3260.0]
    assert table["main_component"].tolist() == ["disc", "caliper", "disc"]
    assert table["second_component"].tolist() == ["caliper", "disc", "caliper"]
    assert table["main_share"].tolist() == pytest.approx([0.5, 0.7, 0.5])


def test_worst_is_the_largest_product_of_share_and_level():
    table = rank_energy(*study()).set_index("mode")
    assert table.loc[51, "worst"] == f"friction=0.4, {SCALE}=1"  # 0.6 x 50 beats 0.9 x 30
    assert table.loc[44, "worst"] == f"friction=0.4, {SCALE}=1"  # 0.3 x 50 beats 0.9 x 10
    assert table.loc[51, "worst_torque_rms"] == 50.0


def test_worst_names_nothing_where_nothing_varies():
    points, modes = study()
    one = points.iloc[:1], modes[modes["point_id"] == "p0"]
    assert set(rank_energy(*one)["worst"]) == {""}
    bare = points.iloc[:1].drop(columns=["friction", "pressure", SCALE])
    assert set(rank_energy(bare, one[1])["worst"]) == {""}


def test_conditions_choose_points_and_modes():
    points, modes = study()
    table = rank_energy(points, modes, where="friction < 0.35")
    assert table["energy_share"].tolist() == pytest.approx([0.9, 0.05, 0.0])
    assert rank_energy(points, modes, where="frequency_hz > 4000")["mode"].tolist() == [51]
    both = rank_energy(points, modes, where=f"{SCALE} > 1.1 and energy_caliper > 0.5")
    assert both["mode"].tolist() == [44]
    assert both["points"].tolist() == [1]
    irregular = rank_energy(points, modes, where="`class` == 'irregular'")
    assert irregular["energy_share_max"].tolist() == pytest.approx([0.6, 0.3, 0.05])


def test_top_keeps_the_first_rows():
    assert rank_energy(*study(), top=1)["mode"].tolist() == [51]


@pytest.mark.parametrize("where", ["mu > 0.3", "friction >", "friction + 1"])
def test_conditions_that_cannot_be_used(where):
    with pytest.raises(ResultsError, match="query"):
        rank_energy(*study(), where=where)


def test_nothing_that_lasts_gives_an_empty_table_with_all_columns():
    points, modes = study()
    for empty in (
        rank_energy(points.assign(**{"class": "stable"}), modes),
        rank_energy(points.assign(status="failed"), modes),
        rank_energy(points.iloc[:0], modes.iloc[:0]),
        rank_energy(points, modes, where="friction > 2"),
    ):
        assert len(empty) == 0
        assert list(empty.columns) == list(COLUMNS)


def test_shares_that_are_unknown_count_as_nothing():
    points, modes = study()
    modes.loc[modes["point_id"] == "p2", "energy_share"] = np.nan
    table = rank_energy(points, modes).set_index("mode")
    assert table.loc[51, "energy_share"] == pytest.approx(0.2)
    energies = ["energy_disc", "energy_caliper", "energy_interfaces"]
    bare = rank_energy(points, modes.drop(columns=energies))
    assert set(bare["main_component"]) == {""}
    assert bare["main_share"].isna().all()


def test_parameters_are_what_stands_before_the_class():
    points, modes = study()
    assert transient_parameters(points) == ["friction", "pressure", SCALE]
    assert transient_parameters(points, varied=True) == ["friction", SCALE]
    with pytest.raises(ResultsError, match="no column 'class'"):
        rank_energy(points.drop(columns="class"), modes)
    with pytest.raises(ResultsError, match="not in the points table"):
        rank_energy(points.iloc[1:], modes)


def test_tables_are_not_changed():
    points, modes = study()
    before = points.copy(), modes.copy()
    rank_energy(points, modes, where="friction > 0.2")
    pd.testing.assert_frame_equal(points, before[0])
    pd.testing.assert_frame_equal(modes, before[1])


@pytest.mark.parametrize(
    ("component", "share", "told"),
    [
        ("interfaces", 1.0, False),
        ("interfaces", 0.9, True),
        ("pad", 1.0, True),
        ("", np.nan, False),
    ],
)
def test_energy_of_a_lumped_model_tells_no_parts(component, share, told):
    table = pd.DataFrame({"main_component": ["interfaces", component], "main_share": [1.0, share]})
    assert tells_parts(table) == told
