"""Runs that are looked at before their end, and stopped where their outcome is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.analysis.transient.settings import TransientResult, TransientSettings
from squealstudy.errors import ParameterError
from squealstudy.kernels import newmark_layout as layout

STORED = layout.HISTORY.index("stored")


@dataclass(frozen=True)
class Watch:
    """When runs are looked at, and who says that they may stop.

    Attributes
    ----------
    steps : sequence of int
        Each design is looked at after so many steps, again and again; rounded up to saved rows.
    judge : callable
        Told the design's number and what it has done so far, its histories not copied; says why
        the run may stop, or an empty string.
    """

    steps: Sequence[int]
    judge: Callable[[int, TransientResult], str]


def block_steps(watch: Watch | None, count: int, settings: TransientSettings) -> np.ndarray:
    """Steps between pauses of each design (count,): whole saved rows, or the whole run.

    Raises
    ------
    ParameterError
        Nothing is saved that could be looked at, or steps that are not positive.
    """
    if watch is None:
        return np.full(count, settings.n_steps)
    if settings.save_every == 0:
        raise ParameterError("save_every", "a watch looks at saved rows, got 0")
    steps = np.asarray(watch.steps, dtype=np.int64)
    if steps.shape != (count,) or steps.min() < 1:
        raise ParameterError("steps", "a watch needs a positive number of steps for each design")
    return -(-steps // settings.save_every) * settings.save_every


def paused(work: layout.Work) -> list[int]:
    """Designs that run and are at their pause."""
    counts = work.counts
    here = counts[:, layout.STEP] == counts[:, layout.PAUSE]
    return [int(k) for k in np.flatnonzero(here & (counts[:, layout.STATUS] == layout.RUNNING))]


def stop(work: layout.Work, saved: layout.Saved, k: int) -> None:
    """End design k where it is, its last step a saved row."""
    work.counts[k, layout.STATUS] = layout.DONE
    work.real[k, layout.STORED_END] = saved.history[k, work.counts[k, layout.SAVED] - 1, STORED]
