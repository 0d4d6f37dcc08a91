"""Conditions on columns: what they select, and that no text does anything else."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from squealstudy.errors import ResultsError
from squealstudy.tables.condition import conditions

TABLE = pd.DataFrame(
    {
        "friction": [0.1, 0.2, np.nan],
        "contact.lambda": [1.0, 2.0, 3.0],
        "class": ["cycle", "irregular", None],
        "status": ["ok", "ok", "failed"],
        "track": [1, 2, 3],
        "unstable": [True, False, True],
        "valid": pd.array([True, False, None], dtype="boolean"),
    }
)
COLUMNS = list(TABLE)
HELD = {
    "friction > 0.1": "010",
    "0.1 <= friction < 0.2": "100",
    "friction == 0.2 or track >= 3": "011",
    "friction > 0 & unstable": "100",
    "friction > 5 | ~unstable": "010",
    "not unstable": "010",
    "unstable == True": "101",
    "valid": "100",
    "not valid": "010",
    "contact.lambda > 1 and `contact.lambda` < 3": "010",
    "class == 'irregular'": "010",
    "`class` != 'irregular' and status == 'ok'": "100",
    "status in ['ok', 'late']": "110",
    "track not in (1, 2)": "001",
    "track % 2 == 1 and track // 2 == 0": "100",
    "sqrt(friction**2) * 10 - 1 > abs(-0.5)": "010",
    "-friction < 0 and +track > log10(10)": "010",
    "friction < 9**9**9**9": "110",
    "friction > 1e400 or 1/0 < friction": "000",
    "(-1)**0.5 < friction": "000",
    "status == 'and &'  # said": "000",
}
REFUSED = [
    "friction.to_csv('{path}') > 0",
    "friction.to_pickle('{path}') > 0",
    "open('{path}', 'w') > 0",
    "__import__('pathlib').Path('{path}').touch()",
    "().__class__.__base__.__subclasses__() == 1",
    "friction.__class__ == 1",
    "@pd.io.common.os.system('touch {path}') > 0",
    "`@pd` > 0",
    "`friction.to_csv` > 0",
    "(lambda: 1)() > 0",
    "f'{{friction}}' == 'a'",
    "friction[0] > 0",
    "(friction := 1) > 0",
    "[x for x in friction] > 0",
    "friction if unstable else 2",
    "status * 10**10 == 'a'",
    "'a' * 10**10 == status",
    "[1] * 10**10 == track",
    "status > 1",
    "track in ['ok']",
    "friction == [1, 2]",
    "track is 1",
    "1 << 10**10 > friction",
    "1j * friction > 0",
    "friction > None",
    "\u03bc0_ > 0",
    "\uff46riction > 0",
    "exp",
    "exp(friction, 1) > 0",
    "exp(x=friction) > 0",
    "friction > 0; 1",
    "friction > 0\nimport os",
    "friction + 1",
    "friction & track",
    "1 > 0",
    "True",
    "and",
    "",
    "(" * 400 + "friction" + ")" * 400 + " > 0",
    "friction > 0 and " * 100 + "friction > 0",
]

WORDS = [
    "0.1",
    "9",
    "'ok'",
    "and",
    "or",
    "not",
    "in",
    "<",
    "==",
    "+",
    "**",
    "*",
    "(",
    ")",
    "[",
    "]",
    ",",
    ".",
    "sqrt",
    "~",
    "&",
    "`",
    "@",
    "lambda",
    ":",
    "-",
    "%",
]


def rows(text: str) -> list[bool]:
    return list(np.all([c.holds(TABLE) for c in conditions(text, COLUMNS)], axis=0))


@pytest.mark.parametrize("text", HELD)
def test_rows_for_which_a_condition_holds(text: str) -> None:
    assert rows(text) == [digit == "1" for digit in HELD[text]]


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: text[:24])
def test_all_else_is_refused_and_nothing_runs(text: str, tmp_path: Path) -> None:
    path, began = tmp_path / "made", time.perf_counter()
    with pytest.raises(ResultsError, match=r"^query '") as caught:
        rows(text.format(path=path) if "{path}" in text else text)
    assert time.perf_counter() - began < 1.0
    assert len(str(caught.value)) < 400
    assert not path.exists()


def test_columns_are_those_used_by_each_part() -> None:
    found = conditions("friction > 0 and (contact.lambda > sin(track) or unstable)", COLUMNS)
    assert [c.columns for c in found] == [{"friction"}, {"contact.lambda", "track", "unstable"}]


@given(
    st.one_of(
        st.text(max_size=60),
        st.lists(
            st.sampled_from([*COLUMNS, *WORDS]),
            max_size=14,
        ).map(" ".join),
    )
)
def test_no_text_does_anything_but_hold_or_fail_clearly(text: str) -> None:
    try:
        found = [condition.holds(TABLE) for condition in conditions(text, COLUMNS)]
    except ResultsError:
        return
    assert all(held.dtype == bool and held.shape == (3,) for held in found)


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("not (friction > 0.1)", [False, True, False]),
        ("friction != 0.5", [False, True, False]),
        ("status != 'ok'", [False, True, False]),
        ("not status == 'ok'", [False, True, False]),
        ("status not in ['ok']", [False, True, False]),
        ("not (friction > 0.1 and unstable)", [False, True, True]),
        ("friction > 0.1 or not unstable", [True, True, True]),
        ("not unstable", [False, True, True]),
        ("abs(friction - 0.5) < 1", [True, True, False]),
    ],
)
def test_a_missing_value_is_neither_true_nor_false(text, rows):
    """Judged row by row by hand: the last row has neither friction nor status."""
    table = pd.DataFrame(
        {
            "friction": [0.5, 0.05, np.nan],
            "status": ["ok", "failed", None],
            "unstable": [True, False, False],
        }
    )
    (condition,) = conditions(text, table.columns)
    assert condition.holds(table).tolist() == rows


@pytest.mark.parametrize(
    "text", ["abs(status) > 1", "sqrt(status) > 1", "-status > 1", "status * 2 == 'x'"]
)
def test_text_has_no_arithmetic(text):
    table = pd.DataFrame({"status": ["ok"], "friction": [0.5]})
    (condition,) = conditions(text, table.columns)
    with pytest.raises(ResultsError, match="text and lists have no arithmetic"):
        condition.holds(table)


@pytest.mark.parametrize(
    ("text", "at"),
    [
        ("friction == 100 g", "100 g"),
        ("friction > 1.5e3kHz and unstable", "1.5e3kHz"),
        ("friction < 5 %", "5 %"),
        ("status == 'a 3 m' and friction == 2 bar", "2 bar"),
    ],
)
def test_a_number_with_a_unit_is_told_from_other_faults(text, at):
    with pytest.raises(ResultsError, match=f" at '{at}'; numbers are in SI units .kg, "):
        conditions(text, COLUMNS)


@pytest.mark.parametrize("text", ["friction == = 3", "3 and and friction", "status == '3 m' )"])
def test_of_other_faults_no_unit_is_told(text):
    with pytest.raises(ResultsError, match="cannot be used") as caught:
        conditions(text, COLUMNS)
    assert "SI units" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "pad.scale == 1",
        "`pad.scale` > 0.5 and friction < 0.35 | friction == 0.4",
        "abs(pad.scale - 1) < 0.1 & ~(friction in [0.2, 0.4])",
        "friction > 0.2 or pad.scale * friction < 0.05",
    ],
)
def test_a_condition_for_pandas_chooses_the_same_rows(text):
    table = pd.DataFrame({"friction": [0.1, 0.2, 0.3, 0.4] * 2, "pad.scale": [0.4] * 4 + [1.0] * 4})
    parts = conditions(text, table.columns)
    held = np.logical_and.reduce([part.holds(table) for part in parts])
    chosen = table.query(" and ".join(f"({part.in_pandas})" for part in parts))
    assert chosen.index.tolist() == np.flatnonzero(held).tolist()
    assert 0 < len(chosen) < len(table)
