"""What tables tell of a design, beside the truth of the independent judge: a `Told` a number.

A column is held against its own bounds; one that has none against a plain tolerance of its kind,
which is told apart. To join a kind, write a function of (case, results) that yields `Told` and name
it in COMPARERS.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from column_cases import BAND, Case
from event_levels import Cycle, Levels, Record
from event_reference import SmallDesign, friction_at, kicked, roots, run, steady

from squealstudy.engine.cycle_states import stored_cycles
from squealstudy.engine.results import Results
from squealstudy.wording import LASTING, LIMIT_CYCLE, STABLE, SUSTAINED, UNDECIDED

PLAIN = {
    "share": 0.02,
    "hz": 5e-3,
    "exact": 1e-6,
    "level": 0.03,
}  # shares absolute, others relative
ROUND_OFF = 1e-6  # of a value: what the judge itself and tables in single precision owe
LONGER = 4  # times the run: the judge's, by which lasting motions are judged
AT_REST = 1e-3  # of the largest speed: vibration that has died away
STEADY = 0.02  # change of level from one quarter to the next of motion that does not repeat
EVEN = 0.1  # scatter of levels over ten periods of motion that is called a limit cycle
COARSE = 64  # samples a period of what settles
UNSURE = 10.0  # times the difference of periods over those observed: what is left to settle
OBSERVED = 40  # periods of what it has settled to
QUIET = 1e-9  # of the torque: levels below are none
STILL = 1e-7  # of the sliding speed: what the judge's own tolerance leaves moving
RESOLVED = 1e-5  # of the torque: what it leaves to levels of motion that dies away


@dataclass(frozen=True)
class Told:
    """A number or word of a table, its bounds and the truth."""

    table: str
    column: str
    told: float | str
    low: float
    high: float
    truth: float | str
    bounded: bool = True

    @property
    def inside(self) -> bool:
        """Whether the truth is within the bounds, or the word is right."""
        if isinstance(self.truth, str):
            return self.told == self.truth
        slack = ROUND_OFF * abs(self.truth)
        return bool(self.low - slack <= self.truth <= self.high + slack)

    @property
    def width(self) -> float:
        """Half width of the bounds over the true error; NaN of words and of exact values."""
        if isinstance(self.truth, str) or isinstance(self.told, str) or not self.bounded:
            return np.nan
        error = abs(self.told - self.truth)
        return 0.5 * (self.high - self.low) / error if error > 0 else np.nan


def plain(table: str, column: str, told: float, truth: float, kind: str) -> Told:
    """A number without bounds of its own."""
    room = PLAIN[kind] * (1.0 if kind == "share" else abs(truth))
    return Told(table, column, told, told - room, told + room, truth, bounded=False)


def relative(
    table: str, column: str, told: float, error: float, truth: float, unsure: float = 0.0
) -> Told:
    """A number with a relative error; `unsure` is that of the truth."""
    room = (error + unsure) * abs(told)
    return Told(table, column, told, told - room, told + room, truth)


# -- the judge's view of a motion -----------------------------------------------------------------
@dataclass(frozen=True)
class Fate:
    """What a motion comes to: ``rest``, ``cycle``, ``lasts`` or ``open``; its last periods."""

    name: str
    record: Record
    cycle: Cycle | None

    @property
    def unsure(self) -> float:
        """Relative error of the truth: how far periods differ that are still looked at."""
        return UNSURE * self.cycle.deviation if self.cycle is not None else 0.0

    @property
    def levels(self) -> Levels:
        """Of the cycle, or of the record."""
        if self.cycle is not None:
            return self.cycle.levels
        return self.record.levels(0.0, self.record.time[-1])


def fate(d: SmallDesign, start: np.ndarray, periods: float) -> Fate:
    """What becomes of a start (4,) after so many periods of the slowest mode, in the judge's eyes.

    Coarse samples first, by which it is seen whether it dies away, then fine ones of what is left.
    """
    lam, _ = roots(d)
    period = 2 * np.pi / float(abs(lam).min())
    record = run(d, periods * period, start=start, sample=period / COARSE)
    speed = np.abs(record.rows[:, 2:4]).max(axis=1)
    if speed.max() < STILL * abs(d["sliding_speed"]) and lam[0].real < 0:
        return Fate("rest", record, None)
    parts = [float(part.max()) for part in np.array_split(speed, 8)[4:]]
    if parts[-1] < AT_REST * speed.max() and lam[0].real < 0:
        return Fate("rest", record, None)
    last = run(d, OBSERVED * period, start=record.end)
    found = last.cycle(1.0)
    if found is not None and found.levels.rms > QUIET * abs(found.levels.mean):
        return Fate("cycle", last, found)
    steady = abs(parts[-1] / parts[0] - 1) < STEADY
    growing = parts[-1] > parts[0] and lam[0].real > 0
    return Fate("lasts" if steady or growing else "open", last, None)


def strongest_line(record: Record, cycle: Cycle) -> tuple[np.ndarray, float]:
    """RMS of the torque's harmonics (30,) over one cycle, and the fundamental [Hz]."""
    periods = max(1, int(0.9 * record.time[-1] / cycle.period))
    at = record.time[-1] - periods * cycle.period + np.arange(256 * periods) * cycle.period / 256
    lines = np.fft.rfft(np.interp(at, record.time, record.torque))
    return np.abs(lines[periods : 31 * periods : periods]), cycle.frequency_hz


# -- runs -----------------------------------------------------------------------------------------
def of_transient(case: Case, results: Results) -> Iterator[Told]:
    """Points, growth and histories of a run."""
    d, row = case.design, results.points.iloc[0]
    if row["status"] != "ok":
        yield Told("points", "status", str(row["status"]), np.nan, np.nan, "ok")
        return
    lam, _ = roots(d)
    seen = lam[(abs(lam) > 2 * np.pi * BAND[0]) & (abs(lam) < 2 * np.pi * BAND[1])]
    growth = seen[0].real
    yield plain("points", "predicted_growth_rate", row["predicted_growth_rate"], growth, "exact")
    hz = abs(seen[0]) / (2 * np.pi)
    yield plain("points", "predicted_frequency_hz", row["predicted_frequency_hz"], hz, "exact")
    yield plain("points", "n_unstable", row["n_unstable"], (seen.real > 0).sum(), "exact")
    section = case.section
    start = kicked(d, section["perturbation"], BAND)
    record = run(d, section["duration"], start=start, band=BAND)
    static = friction_at(d, abs(d["sliding_speed"])) * record.case.area @ steady(d)[1]
    yield plain("points", "torque_static", row["torque_static"], static, "exact")
    if np.isfinite(row["growth_rate"]):
        name = "growth_rate" if row["growth_method"] == "left_vector" else "growth_rate (energy)"
        bounds = row["growth_rate_low"], row["growth_rate_high"]
        yield Told("points", name, row["growth_rate"], *bounds, seen[0].real)
    found = fate(d, record.end, (LONGER - 1) * section["duration"] * hz)
    yield from _classes(row, found, section["duration"] * hz)
    yield from _levels(row, found, record, section["duration"])
    yield from _growth(results, seen)
    yield from _history(results, row, record)


def _classes(row: pd.Series, found: Fate, periods: float) -> Iterator[Told]:
    told = row["class"]
    if found.name == "open":
        return
    if told == UNDECIDED:
        if periods >= 10:
            yield Told("points", "class (decided)", told, np.nan, np.nan, found.name)
        return
    right = {
        "rest": told == STABLE,
        "cycle": told in LASTING and told != "irregular",
        "lasts": told in LASTING and (told != LIMIT_CYCLE or _even(found)),
    }[found.name]
    yield Told("points", "class", found.name if right else told, np.nan, np.nan, found.name)


def _even(found: Fate) -> bool:
    """Whether levels of a quarter of the periods each are even: a limit cycle's, by its page."""
    parts = np.array([part.std() for part in np.array_split(found.record.torque, 4)])
    return bool(parts.std() <= EVEN * parts.mean())


def _levels(row: pd.Series, found: Fate, record: Record, duration: float) -> Iterator[Told]:
    """Levels of lasting motion against the cycle that it is; of others over the same window."""
    sustained = row["class"] in SUSTAINED
    if sustained and found.name in ("cycle", "lasts"):
        truth = found.levels
    elif not sustained and row["class"] != UNDECIDED:
        truth = _window(row, record, duration)
    else:
        return
    none = ROUND_OFF if sustained else RESOLVED
    size = abs(row["torque_static"]) * none + found.unsure * truth.rms  # of levels that are none
    state = "" if sustained else " (passing)"
    for column, value in (("torque_mean", truth.mean), ("torque_rms", truth.rms)):
        low, high = row[f"{column}_low"], row[f"{column}_high"]
        yield Told("points", column + state, row[column], low - size, high + size, value)
    if "torque_peak_to_peak_low" in row:
        low, high = row["torque_peak_to_peak_low"], row["torque_peak_to_peak_high"]
        name = "torque_peak_to_peak" + state
        truth = truth if sustained else _window(row, record, duration, whole=False)
        swing = truth.peak_to_peak
        yield Told("points", name, row["torque_peak_to_peak"], low - size, high + size, swing)
    elif sustained:
        name, value = "torque_peak_to_peak", truth.peak_to_peak
        yield plain("points", name, row[name], value, "level")
    if not sustained:
        return
    for column, value in (("stick_share", truth.stick_share), ("open_share", truth.open_share)):
        yield plain("points", column, row[column], value, "share")
    if found.cycle is not None:
        sizes, hz = strongest_line(found.record, found.cycle)
        old = "dominant_frequency_hz"
        line = row["torque_line_hz"] if "torque_line_hz" in row else row[old]
        near = int(np.clip(round(line / hz), 1, len(sizes))) if np.isfinite(line) else 1
        best = near if sizes[near - 1] > 0.97 * sizes.max() else 1 + int(np.argmax(sizes))
        yield plain("points", "torque_line_hz", line, best * hz, "hz")
        if np.isfinite(row["frequency_hz"]):
            error = row.get("frequency_error", PLAIN["hz"])
            yield relative("points", "frequency_hz", row["frequency_hz"], error, hz)


def _window(row: pd.Series, record: Record, duration: float, whole: bool = True):
    """The last 40 % of a run, or 20 periods of its line where that is longer.

    Mean and RMS are of whole periods of it, of six at a time where there are twelve.
    """
    line = row.get("torque_line_hz", row.get("dominant_frequency_hz", np.nan))
    length = max(0.4 * duration, 20.0 / line if np.isfinite(line) else 0.0)
    if whole and line * length >= 5:
        count = int(line * min(length, duration) * (1 + 1e-9))
        length = (count - count % 6 if count >= 12 else count) / line
    return record.levels(max(0.0, duration - length), duration)


def _growth(results: Results, seen: np.ndarray) -> Iterator[Told]:
    table = results.table("growth")
    for _, row in table.iterrows():
        lam = seen[np.argmin(abs(abs(seen) / (2 * np.pi) - row["frequency_hz"]))]
        yield plain("growth", "growth_rate", row["growth_rate"], lam.real, "exact")
        yield plain("growth", "frequency_hz", row["frequency_hz"], abs(lam) / (2 * np.pi), "exact")
        if np.isfinite(row["fitted_growth_rate"]):
            told, bounds = row["fitted_growth_rate"], (row["fitted_low"], row["fitted_high"])
            yield Told("growth", "fitted_growth_rate", told, *bounds, lam.real)


def _history(results: Results, row: pd.Series, record: Record) -> Iterator[Told]:
    """The first periods of a history, point by point: the start and the signs."""
    history = results.history(row["point_id"])
    lam, _ = roots(record.design)
    first = history[history["time"] < 3 * 2 * np.pi / abs(lam[0])]
    for column, judged in (("torque", record.torque), ("normal_force", record.normal_force)):
        truth = np.interp(first["time"], record.time, judged)
        size = max(np.ptp(truth), 1e-6 * np.abs(truth).max(), 1e-12)
        apart = float(np.sqrt(np.mean((first[column] - truth) ** 2)) / size)
        yield Told("histories", column, apart, -0.05, 0.05, apart, bounded=False)


# -- limit cycles ---------------------------------------------------------------------------------
PERIODS = 150  # of a run of the judge
MOST_PERIODS = 1200
SAME = 1e-3  # relative: attractors that are one


def attractors(d: SmallDesign, starts: list[np.ndarray]) -> list[Fate]:
    """Lasting motions that starts (4,) lead to."""
    found: list[Fate] = []
    for start in starts:
        periods = PERIODS
        here = fate(d, start, periods)
        while not _settled(here) and periods < MOST_PERIODS:
            start, periods = here.record.end, 2 * periods
            here = fate(d, start, periods)
        if here.name in ("cycle", "lasts") and not any(_same(here, f) for f in found):
            found.append(here)
    return found


def _settled(here: Fate) -> bool:
    return here.name == "rest" or (here.name == "cycle" and here.unsure < ROUND_OFF)


def _same(a: Fate, b: Fate) -> bool:
    if a.cycle is None or b.cycle is None:
        return a.cycle is b.cycle
    hz = abs(a.cycle.frequency_hz / b.cycle.frequency_hz - 1)
    return hz < SAME and abs(a.levels.rms / b.levels.rms - 1) < SAME


def of_limit_cycles(case: Case, results: Results) -> Iterator[Told]:
    """Points, verdicts and cycles of a design."""
    d, row = case.design, results.points.iloc[0]
    if row["status"] != "ok":
        yield Told("points", "status", str(row["status"]), np.nan, np.nan, "ok")
        return
    lam, _ = roots(d)
    seen = lam[(abs(lam) > 2 * np.pi * BAND[0]) & (abs(lam) < 2 * np.pi * BAND[1])]
    yield plain("points", "max_growth_rate", row["max_growth_rate"], seen[0].real, "exact")
    yield plain("points", "n_unstable", row["n_unstable"], (seen.real > 0).sum(), "exact")
    for _, v in results.table("verdicts").iterrows():
        near = seen[np.argmin(abs(abs(seen) / (2 * np.pi) - v["frequency_hz"]))]
        yield plain("verdicts", "growth_rate", v["growth_rate"], near.real, "exact")
    cycles = results.table("cycles")
    stable = cycles[cycles["stable"].fillna(False).astype(bool)]
    reach = case.section["reach"] * abs(d["sliding_speed"])
    sizes = [0.03 * reach, reach, *(0.9 * v for v in stable["contact_velocity"])]
    starts = [kicked(d, size, BAND) for size in sizes]
    found = attractors(d, [*starts, *_on_cycles(d, results, set(stable["cycle_id"]))])
    yield from _verdict(row, seen, found)
    for _, cycle in stable.iterrows():
        yield from _cycle(cycle, found)


def _on_cycles(d: SmallDesign, results: Results, ids: set[str]) -> Iterator[np.ndarray]:
    """States (4,) of some cycles that are kept: component modes of a point mass are its axes."""
    for cycle in stored_cycles(results.store):
        if cycle.cycle_id in ids and cycle.Q.shape[1] == 2:
            mean, cosines, sines = np.split(cycle.Q, [1, 1 + len(cycle.Q) // 2])
            slope = np.arange(1, len(sines) + 1) @ sines
            q = steady(d)[0] + mean[0] + cosines.sum(axis=0)
            yield np.concatenate([q, cycle.omega * slope])


def _verdict(row: pd.Series, seen: np.ndarray, found: list[Fate]) -> Iterator[Told]:
    told, lasting = row["verdict"], bool(found)
    truth = "squeals" if seen[0].real > 0 else "squeals if kicked" if lasting else "silent"
    told = {"no_cycle_found": "silent", "squeals_if_kicked": "squeals if kicked"}.get(told, told)
    yield Told("points", "verdict", told, np.nan, np.nan, truth)
    if not np.isfinite(row["torque_rms"]):
        if found:
            yield Told("points", "torque_rms (told)", "untold", np.nan, np.nan, "told")
        return
    if not found:
        yield Told("points", "torque_rms (lasts)", "told", np.nan, np.nan, "untold")
        return
    best = min(found, key=lambda f: abs(f.levels.rms - row["torque_rms"]))
    told, error = row["torque_rms"], row["level_error"]
    yield relative("points", "torque_rms", told, error, best.levels.rms, best.unsure)
    loudest = max(f.levels.rms for f in found)
    seen_it = loudest <= told * (1 + error) or loudest == best.levels.rms
    words = "loudest" if seen_it else f"{told:.5g}"
    truth = "loudest" if seen_it else f"{loudest:.5g}"
    yield Told("points", "torque_rms (loudest)", words, np.nan, np.nan, truth)
    if best.cycle is not None:
        name, hz = "frequency_hz", best.cycle.frequency_hz
        if np.isfinite(row[name]):
            error = row.get("frequency_error", PLAIN["hz"])
            yield relative("points", name, row[name], error, hz, best.unsure)


def _cycle(row: pd.Series, found: list[Fate]) -> Iterator[Told]:
    """A stable cycle beside the attractor that is nearest in level."""
    known = [f for f in found if f.cycle is not None]
    if not known:
        yield Told("cycles", "stable", "stable", np.nan, np.nan, "not seen")
        return
    best = min(known, key=lambda f: abs(np.log(f.levels.rms / max(row["torque_rms"], 1e-300))))
    apart = abs(best.levels.rms / row["torque_rms"] - 1)
    if apart > max(10 * row["level_error"], 0.1):
        yield Told("cycles", "stable", f"{row['torque_rms']:.5g}", np.nan, np.nan, "not seen")
        return
    truth, record = best.levels, best.record
    last, c = record.rows, record.case
    moved = [np.hypot(last[:, 2:4] @ n, last[:, 2:4] @ t) for n, t in zip(c.N, c.T, strict=True)]
    velocity = float(np.max(moved))
    with_errors = (
        ("torque_rms", "level_error", truth.rms),
        ("contact_velocity", "velocity_error", velocity),
        ("frequency_hz", "frequency_error", best.cycle.frequency_hz),
    )
    ends, force = record.extremes, last[:, -1]
    peak = float(max(ends.max() - truth.mean, truth.mean - ends.min()))
    if "torque_peak_error" in row:
        with_errors += (("torque_peak", "torque_peak_error", peak),)
    for name, error, value in with_errors:
        yield relative("cycles", name, row[name], row[error], value, best.unsure)
    levels = {
        "torque_mean": truth.mean,
        "friction_power": truth.friction_power,
        "damping_power": truth.damping_power,
    }
    if force.std() > QUIET * abs(force.mean()):
        levels["normal_force_rms"] = float(force.std())
    for name, value in levels.items():
        yield plain("cycles", name, row[name], value, "level")
    yield plain("cycles", "stick_share", row["stick_share"], truth.stick_share, "share")
    yield plain("cycles", "open_share", row["open_share"], truth.open_share, "share")


COMPARERS: dict[str, Callable[[Case, Results], Iterator[Told]]] = {
    "transient": of_transient,
    "limit_cycles": of_limit_cycles,
}
