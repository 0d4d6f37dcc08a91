"""Progress of a run: bars on a terminal, one line in a notebook, else lines of the log.

Bars and the notebook's line appear after BAR_DELAY_S seconds. In a notebook it is plain text that
is kept up to date, as bars would need ipywidgets.

The log is that of Python's `logging`, with the name squealstudy and level INFO. The command writes
it to stderr; a program sees it after ``logging.basicConfig(level="INFO")``.
"""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bars

from squealstudy.screen import messages
from squealstudy.wording import duration, in_digits

LOG = logging.getLogger("squealstudy")
# time before a bar or line is shown, and least time between two states of a notebook's line
BAR_DELAY_S, MIN_UPDATE_INTERVAL_S = 2.0, 0.5
# share of a stage between two lines of the log, if time between them is within these bounds
PROGRESS_STEP, MIN_PROGRESS_INTERVAL_S, MAX_PROGRESS_INTERVAL_S = 0.05, 30.0, 600.0
RATES = (("a second", 1.0), ("a minute", 60.0), ("an hour", 3600.0))


class Progress(Protocol):
    """Called with the number of tasks of a stage that are done, and how many of these failed."""

    def __call__(self, stage: str, done: int, total: int, failed: int = 0) -> None:
        """Take note of the progress of a stage."""


@contextlib.contextmanager
def progress() -> Iterator[Progress]:
    """Show progress in the way that fits the terminal, notebook or log."""
    if messages.is_jupyter:
        with _shown_after_delay(line := OneLine()):
            yield line
    elif messages.is_terminal and not messages.is_dumb_terminal:
        with _bars() as report:
            yield report
    else:
        yield Lines(LOG.info)


class _Display(Protocol):
    """A display of progress that is started and stopped."""

    def start(self) -> None:
        """Begin to show it."""

    def stop(self) -> None:
        """End it, if it was shown."""


@contextlib.contextmanager
def _shown_after_delay(shown: _Display) -> Iterator[None]:
    """Start a display after BAR_DELAY_S seconds, unless the block within has ended by then."""
    timer = threading.Timer(BAR_DELAY_S, shown.start)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # it may be starting just now
        shown.stop()


class OneLine:
    """One line of a notebook's output that is kept up to date: the stage and its progress.

    Parameters
    ----------
    clock : callable
        Returns a time in seconds, of any origin.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._stages: dict[str, _Stage] = {}
        self._text = ""
        self._told_at = -math.inf
        self._display: Any = None

    def __call__(self, stage: str, done: int, total: int, failed: int = 0) -> None:
        """See `Progress`."""
        now = self._clock()
        state = self._stages.get(stage)
        if state is None or done < state.told:
            state = self._stages[stage] = _Stage(now, done, total, now, now, done)
        state.extend(now, done, total)
        state.told = done
        text = f"{stage}: {done:,} of {total:,} done" if total > 1 else stage
        if done == total:
            text = f"{stage}: done in {duration(now - state.began)}"
        elif done > state.at_first:
            text += f", {duration(state.seconds_left(now, done, total))} left"
        self._text = text + (f", {failed:,} failed" if failed else "")
        if self._display is not None and (
            now - self._told_at >= MIN_UPDATE_INTERVAL_S or done == total
        ):
            self._told_at = now
            self._show()

    @property
    def shown(self) -> bool:
        """Whether the line is shown already."""
        return self._display is not None

    def start(self) -> None:
        """Show the line."""
        display = import_module("IPython.display").display  # every notebook has it

        with self._lock:
            self._display = display(self._mime_bundle(), raw=True, display_id=True)

    def stop(self) -> None:
        """Show the last state, if the line is shown."""
        if self._display is not None:
            self._show()

    def _show(self) -> None:
        with self._lock:
            self._display.update(self._mime_bundle(), raw=True)

    def _mime_bundle(self) -> dict[str, str]:
        """The line in the form that notebooks display."""
        return {"text/plain": self._text}


@contextlib.contextmanager
def _bars() -> Iterator[Progress]:
    """Bars, one for each stage, with the expected remaining time."""
    bars = Bars(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[failed]}"),
        TimeElapsedColumn(),
        TextColumn("ETA"),
        TimeRemainingColumn(),
        console=messages,
        transient=True,
    )
    tasks: dict[str, TaskID] = {}

    def report(stage: str, done: int, total: int, failed: int = 0) -> None:
        if stage not in tasks:
            tasks[stage] = bars.add_task(stage, total=total, failed="")
        failed_text = f"{failed} failed" if failed else ""
        bars.update(tasks[stage], completed=done, total=total, failed=failed_text)

    with _shown_after_delay(bars):
        yield report


@dataclass
class _Stage:
    """State of a stage, from which the remaining time is estimated.

    A search adds tasks to a stage. The remaining time is estimated from the pace since the latest
    tasks were added, as earlier tasks may be of another sort.
    """

    began: float  # time when it began, s
    at_first: int  # number of tasks that were done when the latest tasks were added
    total: int  # largest number of tasks that it had; a stage with a budget may end earlier
    extended: float  # time when the latest tasks were added, s
    told_at: float  # time of the last report, s
    told: int  # number of tasks that were done at the last report

    def extend(self, now: float, done: int, total: int) -> bool:
        """Take note of added tasks; return whether there are any."""
        if total <= self.total:
            return False
        self.extended, self.at_first, self.total = now, done, total
        return True

    def seconds_left(self, now: float, done: int, total: int) -> float:
        """Expected seconds until the stage ends, at its pace since the latest tasks were added."""
        return (now - self.extended) / (done - self.at_first) * (total - done)


class Lines:
    """Lines of the log: when a stage begins, gets more tasks or ends, and about every 5 % between.

    Lines between are at least 30 s apart. A slow stage has a line every 10 minutes, once a task of
    it is done.

    Parameters
    ----------
    write : callable
        Called with each line.
    clock : callable
        Returns a time in seconds, of any origin.
    """

    def __init__(
        self, write: Callable[[str], object], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._write, self._clock = write, clock
        self._stages: dict[str, _Stage] = {}

    def __call__(self, stage: str, done: int, total: int, failed: int = 0) -> None:
        """See `Progress`."""
        now = self._clock()
        state = self._stages.get(stage)
        if state is None or done < state.told:  # a new stage, or the same one again
            state = self._stages[stage] = _Stage(now, done, total, now, now, done)
            text = "begins" + (f", {done:,} of {total:,} done" if total > 1 else "")
        elif done == total and state.told < total:
            count = f"{total:,} " if total > 1 else ""
            count += f"of {state.total:,} " if total < state.total else ""
            text = f"{count}done in {duration(now - state.began)}"
        elif state.extend(now, done, total):
            text = f"{total - done:,} more, {done:,} of {total:,} done"
        elif done < total and self._due(state, now, done, total):
            left_text = f"{duration(state.seconds_left(now, done, total))} left"
            text = f"{done:,} of {total:,} done, {self._rate(state, now, done)}, {left_text}"
        else:
            return
        state.told_at, state.told = now, done
        self._write(f"{stage}: {text}" + (f", {failed:,} failed" if failed else ""))

    @staticmethod
    def _due(stage: _Stage, now: float, done: int, total: int) -> bool:
        """Whether it is time for another line."""
        waited = now - stage.told_at
        advanced = done - stage.told >= PROGRESS_STEP * total and waited >= MIN_PROGRESS_INTERVAL_S
        return advanced or (waited >= MAX_PROGRESS_INTERVAL_S and done > stage.at_first)

    @staticmethod
    def _rate(stage: _Stage, now: float, done: int) -> str:
        """Text with the tasks done in a second, a minute or an hour."""
        each = (done - stage.at_first) / (now - stage.extended)
        unit, seconds = next((r for r in RATES if each * r[1] >= 1.0), RATES[-1])
        return f"{in_digits(each * seconds)} {unit}"
