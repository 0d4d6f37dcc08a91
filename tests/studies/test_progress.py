"""How far a run is, told to a log: a sensible pace by a clock that tests set."""

from __future__ import annotations

import logging
import re
import sys
import time
from collections.abc import Callable
from io import StringIO
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import pytest
from rich.console import Console
from rich.text import Text
from study_runs import command

import squealstudy as sq
from squealstudy.progress import (
    MAX_PROGRESS_INTERVAL_S,
    MIN_PROGRESS_INTERVAL_S,
    Lines,
    OneLine,
    progress,
)

PATIENCE = 30.0  # s


def wait_for(there: Callable[[], object]) -> None:
    """Until another thread has done it."""
    ends = time.monotonic() + PATIENCE
    while not there():
        assert time.monotonic() < ends
        time.sleep(0.01)


STUDY = """[study]
name = "lockin"
kind = "complex_modes"
[model]
name = "hulten"
[[sweep]]
parameter = "{parameter}"
values = [{values}]
[modes]
band = [1.0, 1000.0]
reference_points = 0
"""


def told(total: int, seconds: float, first: int = 0) -> list[tuple[float, str]]:
    """Lines of a stage whose tasks take equal times, and when each was written."""
    now, lines = 0.0, []
    say = Lines(lambda text: lines.append((now, text)), lambda: now)
    for done in range(first, total + 1):
        now = seconds * (done - first) / (total - first)
        say("points", done, total, failed=done // 100)
    return lines


def test_a_run_of_two_seconds_is_two_lines() -> None:
    assert [text for _, text in told(1600, 2.0)] == [
        "points: begins, 0 of 1,600 done",
        "points: 1,600 done in 2 s, 16 failed",
    ]


def test_a_run_of_ten_minutes_has_a_line_every_5_percent() -> None:
    lines = told(1000, 1000.0)
    assert len(lines) == 21
    assert lines[4] == (200.0, "points: 200 of 1,000 done, 1 a second, 14 min left, 2 failed")


def test_lines_are_never_closer_than_the_shortest_time() -> None:
    at = [when for when, _ in told(1000, 200.0)]
    assert 5 <= len(at) <= 8
    assert min(b - a for a, b in pairwise(at[:-1])) >= MIN_PROGRESS_INTERVAL_S


def test_a_run_of_ten_hours_is_never_silent_for_long() -> None:
    lines = told(1_000, 36_000.0)
    at = [when for when, _ in lines]
    assert len(lines) < 70
    assert max(b - a for a, b in pairwise(at)) <= MAX_PROGRESS_INTERVAL_S + 36.0
    assert lines[1][1] == "points: 17 of 1,000 done, 1.67 a minute, 9.8 h left"


def test_the_rate_counts_what_this_run_did_alone() -> None:
    lines = told(1000, 500.0, first=500)
    assert lines[0][1] == "points: begins, 500 of 1,000 done, 5 failed"
    assert lines[1][1] == "points: 550 of 1,000 done, 1 a second, 8 min left, 5 failed"


def test_a_stage_that_ends_early_tells_how_many_of_those_it_began_with() -> None:
    lines: list[str] = []
    say = Lines(lines.append, lambda: 0.0)
    say("tracking", 0, 10)
    say("tracking", 4, 4)
    assert lines == ["tracking: begins, 0 of 10 done", "tracking: 4 of 10 done in 0.00 s"]


def test_the_time_left_is_that_of_the_tasks_which_a_search_added_last() -> None:
    """A hundred points took a minute, the two runs of the next round take 15 minutes each."""
    now, lines = 0.0, []
    say, line = Lines(lines.append, lambda: now), OneLine(lambda: now)
    for seconds, done, total in ((0, 0, 100), (60, 100, 100), (60, 100, 102), (960, 101, 102)):
        now = float(seconds)
        say("points", done, total)
        line("points", done, total)
    assert lines[2:] == [
        "points: 2 more, 100 of 102 done",
        "points: 101 of 102 done, 4 an hour, 15 min left",
    ]
    assert line._text == "points: 101 of 102 done, 15 min left"


def test_one_task_needs_no_count_and_a_stage_may_come_again() -> None:
    lines: list[str] = []
    say = Lines(lines.append, lambda: 0.0)
    for _ in range(2):
        say("tables", 0, 1)
        say("tables", 1, 1)
        say("tables", 1, 1)
    assert lines == ["tables: begins", "tables: done in 0.00 s"] * 2


def test_the_command_writes_plain_lines_with_what_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    text = STUDY.format(parameter="friction", values="0.1, 0.2, 0.3")
    (tmp_path / "study.toml").write_text(text)
    assert command("run", "study.toml", "-j", "1", "--no-pictures") == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "design points: begins, 0 of 3 done"
    assert lines[1].startswith("design points: 3 done in ")
    assert lines[-1].startswith("tables: done in ")
    assert "\x1b" not in "".join(lines)


def test_a_program_sees_nothing_unless_it_asks_its_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "study.toml"
    path.write_text(STUDY.format(parameter="friction", values="0.1, 0.2"))
    sq.run(path, tmp_path / "silent", jobs=1)
    assert capsys.readouterr() == ("", "")
    with caplog.at_level(logging.INFO, "squealstudy"):
        sq.run(path, tmp_path / "asked", jobs=1)
    assert "design points: begins, 0 of 2 done" in caplog.messages


def test_bars_show_what_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = StringIO()
    terminal = Console(file=screen, force_terminal=True, width=120)
    monkeypatch.setattr("squealstudy.progress.messages", terminal)
    monkeypatch.setattr("squealstudy.progress.BAR_DELAY_S", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    with progress() as say:
        say("points", 1, 4)
        say("points", 3, 4, failed=2)
        wait_for(lambda: "points" in screen.getvalue())
    assert "3/4 2 failed" in Text.from_ansi(screen.getvalue()).plain


def test_what_is_done_at_once_has_no_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = StringIO()
    terminal = Console(file=screen, force_terminal=True, width=120)
    monkeypatch.setattr("squealstudy.progress.messages", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with progress() as say:
        say("points", 3, 4)
    assert screen.getvalue() == ""


class Notebook(ModuleType):
    """What IPython displays: the states of one line, and under which name."""

    def __init__(self) -> None:
        super().__init__("IPython.display")
        self.states: list[str] = []

    def display(self, bundle: dict[str, str], raw: bool, display_id: bool) -> Notebook:
        assert raw
        assert display_id
        self.states.append(bundle["text/plain"])
        return self

    def update(self, bundle: dict[str, str], raw: bool) -> None:
        assert raw
        self.states.append(bundle["text/plain"])


@pytest.fixture
def notebook(monkeypatch: pytest.MonkeyPatch) -> Notebook:
    """Bars are not what it shows, with ipywidgets or without."""
    shown = Notebook()
    monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", shown)
    monkeypatch.setattr("squealstudy.progress.messages", Console(force_jupyter=True))
    return shown


def test_a_notebook_has_one_line_of_text(
    notebook: Notebook, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder
) -> None:
    monkeypatch.setattr("squealstudy.progress.BAR_DELAY_S", 0.0)
    monkeypatch.setattr("squealstudy.progress.MIN_UPDATE_INTERVAL_S", 0.0)
    with progress() as say:
        assert isinstance(say, OneLine)
        say("points", 0, 40)
        wait_for(lambda: say.shown)
        say("points", 20, 40, failed=2)
        say("points", 40, 40)
    half = notebook.states[-3]
    assert re.fullmatch(r"points: 20 of 40 done, 0\.\d\d s left, 2 failed", half)
    assert re.fullmatch(r"points: done in 0\.\d\d s", notebook.states[-1])
    assert not recwarn.list


def test_a_notebook_shows_nothing_of_what_is_done_at_once(notebook: Notebook) -> None:
    with progress() as say:
        say("points", 0, 40)
        say("points", 40, 40)
    assert not notebook.states
