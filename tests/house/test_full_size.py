"""Tests of full size: left out, asked for, and a tenth of them on each of ten days."""

from __future__ import annotations

from types import SimpleNamespace

import conftest
import pytest

DAY = 739_000  # days since the year 1
SLOW = [f"tests/test_x.py::test_{number}" for number in range(200)]
SHARING = [f"tests/test_z.py::test_{number}" for number in range(8)]  # all of the same kernels
QUICK = [f"tests/test_y.py::test_{number}" for number in range(20)]


def marks(shared):
    """As of an item that has the mark of full size with what it shares, or (None) no mark."""
    mark = None if shared is None else pytest.mark.full_size(*shared).mark
    return lambda name: mark if name == "full_size" else None


def chosen(day=None, expression=""):
    """Those that run, after the hook of the session."""
    told = []
    hook = SimpleNamespace(pytest_deselected=lambda items: told.extend(items))
    option = SimpleNamespace(full_size_tenth=day, markexpr=expression)
    items = [
        SimpleNamespace(nodeid=name, get_closest_marker=marks(shared))
        for shared, names in (((), SLOW), (None, QUICK), (("kernels of z",), SHARING))
        for name in names
    ]
    conftest.pytest_collection_modifyitems(SimpleNamespace(option=option, hook=hook), items)
    assert len(items) + len(told) == len(SLOW) + len(QUICK) + len(SHARING)
    return [item.nodeid for item in items]


def test_they_run_where_they_are_asked_for():
    assert chosen() == QUICK
    assert (
        chosen(expression="full_size") == SLOW + QUICK + SHARING
    )  # which pytest then chooses from


@pytest.mark.parametrize("expression", ["", "full_size"])
def test_ten_days_in_a_row_have_each_of_them_once(expression):
    days = [chosen(DAY + k, expression) for k in range(10)]
    assert all(set(QUICK) < set(day) for day in days)
    tenths = [set(day) - {*QUICK, *SHARING} for day in days]
    assert sorted(name for tenth in tenths for name in tenth) == sorted(SLOW)
    assert min(map(len, tenths)) > len(SLOW) / 40  # by a hash, not by where they stand
    assert chosen(DAY + 10) == chosen(DAY)
    together = [set(day) & set(SHARING) for day in days]
    assert sorted(map(len, together)) == [0] * 9 + [len(SHARING)]
