"""Errors of roots against exact ones, times, and the table of both."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from squealstudy.modes.reanalysis.problem import lightly_damped

ROUND_OFF = 1e-11  # relative: true errors below say nothing about an estimate
LOST = 1e-2  # relative error from which on a root counts as missed


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """What a call returns, and milliseconds of processor time."""
    started = time.process_time()
    result = call()
    return result, 1e3 * (time.process_time() - started)


@dataclass
class Measured:
    """One rung: errors gathered point by point, medians of milliseconds a point."""

    name: str
    setup_s: float = 0.0
    size: str = ""
    values: list[float] = field(default_factory=list)
    vectors: list[float] = field(default_factory=list)
    estimate: list[float] = field(default_factory=list)
    light_f: list[float] = field(default_factory=list)
    light_zeta: list[float] = field(default_factory=list)
    heavy: list[float] = field(default_factory=list)
    missed: int = 0
    ratios: list[float] = field(default_factory=list)

    def compare(self, exact: np.ndarray, lam: np.ndarray, error: np.ndarray | None = None) -> None:
        """Add a point: each exact root against the nearest one found."""
        if not len(lam):
            self.missed += int(lightly_damped(exact).sum())
            return
        nearest = np.abs(exact[:, None] - lam[None, :]).argmin(axis=1)
        true = np.abs(exact - lam[nearest])
        relative, slight = true / np.abs(exact), lightly_damped(exact)
        self.missed += int((relative[slight] > LOST).sum())
        zeta = -exact.real / np.abs(exact) + lam[nearest].real / np.abs(lam[nearest])
        df = np.abs(np.abs(lam[nearest]) / np.abs(exact) - 1.0)
        self.light_f.append(df[slight].max(initial=0.0))
        self.light_zeta.append(np.abs(zeta[slight]).max(initial=0.0))
        self.heavy.append(relative[~slight].max(initial=0.0))
        if error is not None:
            told = slight & (relative > ROUND_OFF) & (relative < LOST)
            self.ratios += list(true[told] / error[nearest][told])

    @property
    def cheapest_ms(self) -> float:
        """Median milliseconds a point of the least that was timed: roots alone where they were."""
        return _first_median(self.values, self.vectors, self.estimate)

    @property
    def vectors_ms(self) -> float:
        """Of roots with vectors, and with errors where a rung does not come without."""
        return _first_median(self.vectors, self.estimate)

    @property
    def error(self) -> float:
        """Largest error of light modes, of frequency or of damping ratio."""
        return max([*self.light_f, *self.light_zeta], default=np.nan)


HEAD = (
    f"{'rung':<28}{'size':>16}{'set-up s':>10}{'ms: values':>12}{'vectors':>9}{'estimate':>9}"
    f"{'x dense':>9}{'x geev':>9}{'light df/f':>12}{'dzeta':>9}{'heavy':>9}{'missed':>7}{'<=2x':>7}"
    f"{'<=5x':>7}"
)


def line(row: Measured, dense_ms: float, geev_ms: float) -> str:
    """A rung as a line of the table.

    `x dense` is of the exact rung's ms with vectors over the row's; `x geev` of LAPACK's ms for all
    values alone over the cheapest answer of the row.
    """
    ratios = np.array(row.ratios)
    shares = [f"{(ratios <= k).mean():>7.1%}" if len(ratios) else f"{'-':>7}" for k in (2, 5)]
    times = [_median(t) for t in (row.values, row.vectors, row.estimate)]
    faster = [_ratio(dense_ms, row.vectors_ms), _ratio(geev_ms, row.cheapest_ms)]
    worst = [max(e, default=np.nan) for e in (row.light_f, row.light_zeta, row.heavy)]
    return (
        f"{row.name:<28}{row.size:>16}{row.setup_s:>10.1f}{times[0]:>12}{times[1]:>9}{times[2]:>9}"
        f"{faster[0]:>9}{faster[1]:>9}{worst[0]:>12.1e}{worst[1]:>9.1e}{worst[2]:>9.1e}"
        f"{row.missed:>7}{shares[0]}{shares[1]}"
    )


def _median(times: Sequence[float]) -> str:
    return f"{np.median(times):.3f}" if len(times) else "-"


def _first_median(*of: Sequence[float]) -> float:
    return next((float(np.median(times)) for times in of if times), np.nan)


def _ratio(of: float, over: float) -> str:
    return f"{of / over:.1f}" if over > 0 else "-"
