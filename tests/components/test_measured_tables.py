"""Frequencies and damping ratios from a table, on the free modes of a component of a model file."""

from __future__ import annotations

import numpy as np
import pytest
from own_blocks import STUDY as TO_60_KHZ
from own_blocks import write_blocks
from study_runs import command, load_plan, solved

from squealstudy.errors import StudyFileError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.components import component_facts
from squealstudy.models.components.free_modes import measured_modes, read_mode_table
from squealstudy.study.components import free_component, read_model

STUDY = TO_60_KHZ.replace("60000.0", "120000.0")  # the slider begins at 70 kHz
TABLED = ("[components.slider]", '[components.slider]\nmeasured = "slider.csv"')
HELD = ("[[load]]", '[[fixed]]\nset = "slider.CORNER"\n\n[[load]]')


def written(folder, table, *changes, study=STUDY):
    """The study of the blocks, with a table of the slider's modes."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "slider.csv").write_text(table, encoding="utf-8")
    return write_blocks(folder, TABLED, *changes, study=study)


def free(folder):
    """Frequencies of the slider's free modes, Hz."""
    path = write_blocks(folder).parent / "blocks.toml"
    _, (K, M), _ = free_component(read_model(path), "slider")
    return real_modes(M, K, 2e5)[0] / (2 * np.pi), K, M


def test_a_table_is_what_a_study_would_set(tmp_path):
    hz, _, _ = free(tmp_path / "free")
    table = f"mode,frequency_hz,damping_ratio\n7,{1.05 * hz[6]},0.01\n8,,0.02\n"
    plan = load_plan(written(tmp_path / "table", table))
    named = {
        "slider.modes[7].frequency_scale": 1.05,
        "slider.modes[7].damping_ratio": 0.01,
        "slider.modes[8].damping_ratio": 0.02,
    }
    values = plan.study.values
    assert {k: v for k, v in values.items() if "[" in k} == pytest.approx(named, rel=1e-9)
    given = "\n".join(f'"{name}" = {values[name]!r}' for name in named)
    text = STUDY.replace("[modes]", f"[parameters]\n{given}\n\n[modes]")
    same = load_plan(write_blocks(tmp_path / "named", study=text))
    tabled, set_alike = (solved(p, tmp_path / n) for p, n in ((plan, "a"), (same, "b")))
    for column in ("frequency_hz", "growth_rate"):
        assert np.array_equal(tabled.modes[column], set_alike.modes[column])
    none = load_plan(write_blocks(tmp_path / "none", study=STUDY))
    assert not {k for k in none.study.values if "[" in k}
    assert not np.array_equal(none.tasks.ids, plan.tasks.ids)


def test_what_a_study_sets_itself_comes_first(tmp_path):
    table = "mode,damping_ratio\n7,0.01\n8,0.02\n"
    text = STUDY.replace(
        "[modes]", '[parameters]\n"slider.modes[7-7].damping_ratio" = 0.3\n\n[modes]'
    )
    values = load_plan(written(tmp_path, table, study=text)).study.values
    found = {k: v for k, v in values.items() if "[" in k}
    assert found == {"slider.modes[7-7].damping_ratio": 0.3, "slider.modes[8].damping_ratio": 0.02}


def test_ids_follow_the_table(tmp_path):
    path = written(tmp_path, "mode,damping_ratio\n7,0.01\n")
    first = load_plan(path).tasks.ids
    (tmp_path / "slider.csv").write_text("mode,damping_ratio\n7,0.02\n", encoding="utf-8")
    assert not np.isin(load_plan(path).tasks.ids, first).any()


def test_modes_without_number_are_the_nearest(tmp_path):
    hz, K, M = free(tmp_path)
    table = tmp_path / "slider.csv"
    lines = [f"{1.03 * hz[8]},", f"{0.98 * hz[6]},0.004", f"{9 * hz[-1]},0.1"]
    text = "\n".join(["# by hammer", "frequency_hz,damping_ratio", "", *lines])
    table.write_text(text, encoding="utf-8")
    found = measured_modes(table, K, M, 1.0001 * hz[8])
    assert [mode.number for mode in found] == [7, 9]
    assert [mode.frequency_scale for mode in found] == pytest.approx([0.98, 1.03])
    assert [mode.damping_ratio for mode in found] == [0.004, None]
    assert [row.line for row in read_mode_table(table)] == [4, 5, 6]
    assert [mode.number for mode in measured_modes(table, K, M, 1.0001 * hz[6])] == [7]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("", "expected a header with mode, frequency_hz, damping_ratio and lines"),
        ("mode,frequency_hz\n", "expected a header with"),
        ("mode,freq\n7,1\n", "slider.csv:1: expected the columns frequency_hz or damping_ratio"),
        ("mode\n7\n", "slider.csv:1: expected the columns"),
        ("mode,frequency_hz\n7\n", "slider.csv:2: expected 2 values, got 1"),
        (
            "mode,frequency_hz\n7,1 kHz\n",
            "slider.csv:2: frequency_hz: expected a number, got '1 kHz'",
        ),
        ("mode,frequency_hz\n7,-5\n", "slider.csv:2: frequency_hz: expected a frequency above 0"),
        ("mode,frequency_hz\n7,nan\n", "slider.csv:2: frequency_hz: expected a frequency above 0"),
        (
            "mode,damping_ratio\n7,2.5\n",
            "slider.csv:2: damping_ratio: expected a ratio from 0 to 1",
        ),
        (
            "mode,damping_ratio\n7.5,0.1\n",
            "slider.csv:2: mode: expected a number from 1, got '7.5'",
        ),
        ("mode,damping_ratio\n3,0.1\n", "slider.csv:2: mode: 3 is a rigid mode, the elastic ones"),
        ("mode,damping_ratio\n7,0.1\n7,0.2\n", "slider.csv:3: mode 7 was in line 2 already"),
        ("damping_ratio\n0.1\n", "slider.csv:2: expected mode or frequency_hz: which mode is it?"),
        ("frequency_hz\n3000\n", "slider.csv:2: no free mode is within 10 % of 3000 Hz"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, table, message):
    path = written(tmp_path, table)
    with pytest.raises(StudyFileError) as caught:
        load_plan(path)
    text = str(caught.value)
    assert "blocks.toml, line 12, key" in text
    assert "components.slider.measured" in text
    assert message in text


def test_a_held_component_and_a_missing_table(tmp_path):
    with pytest.raises(
        StudyFileError, match=r"holds slider\.CORNER: modes measured on a free part"
    ):
        load_plan(written(tmp_path, "mode,damping_ratio\n7,0.1\n", HELD))
    (tmp_path / "slider.csv").unlink()
    with pytest.raises(StudyFileError, match=r"there is no file slider\.csv"):
        load_plan(tmp_path / "study.toml")


def test_inspect_tells_what_was_measured(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(component_facts, "LAST_CUTOFF", 260_000.0)
    hz, _, _ = free(tmp_path)
    written(tmp_path, f"mode,frequency_hz,damping_ratio\n7,{1.5 * hz[6]},0.01\n8,{1.01 * hz[7]},\n")
    command("inspect", str(tmp_path / "blocks.toml"))
    out = " ".join(capsys.readouterr())
    told = " ".join(out.split())
    assert f"slider.csv: mode 7: {hz[6]:.1f} Hz, measured {1.5 * hz[6]:.1f} Hz (+50.00 % " in told
    assert "damping ratio 0.01" in told
    assert "(+1.00 % from computed)" in told
    assert f"slider: mode 7 is measured at {1.5 * hz[6]:.1f} Hz" in told
