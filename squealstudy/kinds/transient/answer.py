"""Answers a study in time in sentences: levels with their errors, frequencies, sticking."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from squealstudy.wording import (
    FAILED,
    LIMIT_CYCLE,
    STABLE,
    SUSTAINED,
    UNDECIDED,
    amount,
    by_ranges,
    figure,
    in_digits,
    moment,
    plural,
    real_mode_number,
    setting,
    with_error,
)

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

UNKNOWN_ROUNDING = (
    "Friction is rounded where the contact sticks: what that does to levels is not known, and not "
    "in their errors."
)
MOST_COLUMNS = 2  # parameters with a column of their own; runs with more have numbers
MOST_MODES = 4  # leading modes named in a sentence
LEAST_SHARE = 1e-4  # sticking is told if it has at least this share of area and time
# spread of swings, relative to their mean, above which a sentence says that no period was seen
UNEVEN_SWINGS = 0.1


def vibrations_in_words(results: ResultTables, unit: str) -> str:
    """Sentences of `lasting_in_words`, and whether their errors are those of friction's rounding.

    Where contact sticks the level depends on the speed below which friction is rounded, more than
    by its bounds. A pilot run tells how much; without one that is said.
    """
    table = results.points
    text = lasting_in_words(table, results.parameters, results.units, unit)
    pilot = (results.manifest.get("regularisation") or {}).get("pilot") or {}
    shares = table.get("stick_share", pd.Series(np.nan, table.index))
    sticks = (shares >= LEAST_SHARE) & ~table["class"].isin((STABLE, FAILED))
    if not text or not sticks.any() or "torque_rms" in pilot.get("errors", {}):
        return text
    return f"{text} {UNKNOWN_ROUNDING}"


def lasting_in_words(
    table: pd.DataFrame, parameters: Sequence[str], units: Mapping[str, str], unit: str
) -> str:
    """Sentences on level, frequency and sticking of runs whose vibration lasts; '' if none does.

    They begin with a blank, to follow others. A single undecided run is told by its end. `unit` is
    "N m" for torques and "N" for friction forces.
    """
    what = "torque" if unit == "N m" else "force of friction"
    lasting = table[table["class"].isin(SUSTAINED).to_numpy(bool)]
    if len(table) == 1 and table["class"].iloc[0] == UNDECIDED:
        return _until_its_end(table.iloc[0], what, unit)
    if not len(lasting):
        return ""
    row = lasting.iloc[int(lasting["torque_rms"].to_numpy(float).argmax())]
    level = with_error(float(row["torque_rms"]), level_error(row))
    varied = [p for p in parameters if len(set(table[p].tolist())) > 1]
    where = _settings(row, varied, units)
    loudest = f"The loudest that lasts{f', at {where}' if where else ''}: " * (len(table) > 1)
    text = f" {loudest}RMS of the {what} {level} {unit}, {heard(row)}"
    text += _as_loud(lasting, row, varied, units)
    quiet = lasting.iloc[int(lasting["torque_rms"].to_numpy(float).argmin())]
    bounds = float(row["torque_rms"]) - level_error(row), float(quiet["torque_rms"])
    if varied and bounds[0] > bounds[1] + level_error(quiet):  # known errors do not overlap
        quiet_level = with_error(bounds[1], level_error(quiet))
        text += f"; the quietest, at {_settings(quiet, varied, units)}: {quiet_level} {unit}"
    uneven = _uneven(lasting, len(table))
    if len(table) == 1:
        return f"{text}{_sticking(row)}.{uneven}{_growth(row)}"
    if len(lasting) == 1 or len(varied) != 1:
        return f"{text}{_sticking(row)}.{uneven}"
    (name,) = varied
    of_name = name, units.get(name, "")
    return f"{text}.{uneven}{_leading(lasting, *of_name)}{_where_it_sticks(lasting, *of_name)}"


def _as_loud(
    lasting: pd.DataFrame, loudest: pd.Series, varied: Sequence[str], units: Mapping[str, str]
) -> str:
    """At which other runs the level may be that of the loudest within the errors; '' of none."""
    least = float(loudest["torque_rms"]) - level_error(loudest)
    others = [
        row
        for _, row in lasting.iterrows()
        if row.name != loudest.name and float(row["torque_rms"]) + level_error(row) >= least
    ]
    if not others or not varied:
        return ""
    if len(others) > 1:
        return f", within its error no louder than {len(others)} others"
    return f", within its error no louder than at {_settings(others[0], varied, units)}"


def _settings(row: pd.Series, varied: Sequence[str], units: Mapping[str, str]) -> str:
    """Values of one run's parameters, of those that differ between runs; of many its number."""
    if len(varied) > MOST_COLUMNS:
        return f"point {row.name}"
    return ", ".join(setting(p, float(row[p]), units.get(p, "")) for p in varied)


def _uneven(lasting: pd.DataFrame, n_runs: int) -> str:
    """Sentence on limit cycles that keep their level but were not seen to repeat; '' if none."""
    cycles = lasting[(lasting["class"] == LIMIT_CYCLE).to_numpy(bool)]
    if "swing_spread" not in cycles or "frequency_hz" not in cycles:  # results of older versions
        return ""
    spread = cycles["swing_spread"][cycles["frequency_hz"].isna().to_numpy(bool)]
    spread = spread[(spread > UNEVEN_SWINGS).to_numpy(bool)]
    if not len(spread):
        return ""
    begin = "No" if n_runs == 1 else f"In {len(spread)} of {plural(len(cycles), 'limit cycle')} no"
    swings = "peak-to-peak values of single swings"
    up_to = f"{100 * float(spread.max()):.0f} % of their mean"
    return f" {begin} period was seen: {swings} differ by up to {up_to}."


def _until_its_end(row: pd.Series, quantity: str, unit: str) -> str:
    """Sentence on the end of an undecided run; empty where its level is not known."""
    if not row["torque_rms"] > 0.0:
        return ""
    level = with_error(float(row["torque_rms"]), level_error(row))
    text = (
        f" Over its end the RMS of the {quantity} is {level} {unit}, {heard(row)}{_sticking(row)}."
    )
    return f"{text} Whether it stays so is open.{_growth(row)}"


def level_error(row: Mapping[Hashable, Any] | pd.Series) -> float:
    """Half the width of the bounds of a run's RMS level; NaN where they are not known."""
    low, high = row.get("torque_rms_low", np.nan), row.get("torque_rms_high", np.nan)
    return float(high - low) / 2


def heard(row: pd.Series) -> str:
    """The frequency at which a run repeats, and its loudest line if that differs, in words."""
    hz, line = row.get("frequency_hz", np.nan), row["torque_line_hz"]
    if hz != hz:
        return f"loudest near {in_digits(line)} Hz" if line == line else "frequency not known"
    if line == line and round(line / hz) > 1:
        return f"loudest near {in_digits(line)} Hz, repeating at {in_digits(hz)} Hz"
    return f"at {in_digits(hz)} Hz"


def _growth(row: pd.Series) -> str:
    """Sentence on how fast a run grew or decayed, and when it became steady; '' if unknown."""
    rate, forecast = row.get("growth_rate", np.nan), row.get("predicted_growth_rate", np.nan)
    settled = row.get("settled_time", np.nan)
    parts = []
    if rate == rate:
        width = row.get("growth_rate_high", np.nan) - row.get("growth_rate_low", np.nan)
        verb = "grew" if rate > 0.0 else "decayed"
        parts.append(f"{verb} by {with_error(abs(float(rate)), float(width) / 2)} 1/s")
    if rate == rate and forecast == forecast:
        opposite = "grows by " if forecast > 0.0 else "decays by "
        sign = opposite if rate * forecast < 0.0 else ""
        parts[0] += f" (complex mode: {sign}{figure(abs(forecast))})"
    if settled == settled:  # before its first period is over nothing can be told to change
        early = settled * row.get("frequency_hz", np.nan) < 1.0
        parts.append(f"was steady from {'its start' if early else moment(settled)} on")
    return f" It {' and '.join(parts)}." if parts else ""


def _leading(lasting: pd.DataFrame, name: str, unit: str) -> str:
    """Sentence on the mode with most energy in each range of a parameter; '' if it never changes.

    Each mode is told with the frequencies of its runs.
    """
    modes = lasting["dominant_mode"].tolist()
    if not 1 < len(set(modes)) <= MOST_MODES or not all(modes):
        return ""
    words = []
    for mode in modes:
        rows = lasting[(lasting["dominant_mode"] == mode).to_numpy(bool)]
        hz = rows.get("frequency_hz", rows["torque_line_hz"]).fillna(rows["torque_line_hz"])
        ends = list(dict.fromkeys(in_digits(end) for end in (hz.min(), hz.max())))
        words.append(f"{real_mode_number(mode)} ({' to '.join(ends)} Hz)")
    ranges = by_ranges(name, unit, lasting[name].tolist(), words)
    return f" The mode with most energy: {ranges}." if ranges else ""


def _sticking(row: pd.Series) -> str:
    """How much the contact of a run sticks, in words; '' where that is not known."""
    share = row.get("stick_share", np.nan)
    if not share >= 0.0:  # not known
        return ""
    how = f"sticks for {_about(share)} of area and time" if share else "never sticks"
    return f"; its contact {how}"


def _about(share: float) -> str:
    """A share in percent as far as it is worth telling: ``about 11 %``, ``less than 0.01 %``."""
    return (
        f"about {_percent(share)}" if share >= LEAST_SHARE else f"less than {_percent(LEAST_SHARE)}"
    )


def _percent(share: float) -> str:
    """A share in percent, to two digits: a run's step makes it no more accurate."""
    return f"{float(f'{100 * share:.2g}'):g} %"


def _where_it_sticks(lasting: pd.DataFrame, name: str, unit: str) -> str:
    """Sentence on the runs in which the contact sticks, and how much; '' where not known."""
    shares = lasting.get("stick_share", pd.Series(np.nan, lasting.index)).to_numpy(float)
    if not (shares >= 0.0).all():
        return ""
    if not shares.any():
        return f" The contact never sticks in these {len(lasting)} runs."
    least, most = shares[shares > 0].min(), shares.max()
    ends = [_percent(s) for s in (least, most)]
    how = f"for about {' to '.join(dict.fromkeys(ends))} of area and time"
    if least < LEAST_SHARE:
        how = f"for {'up to ' * bool(most >= LEAST_SHARE)}{_about(most)} of area and time"
    if shares.all():
        return f" The contact sticks in all {len(lasting)} of these, {how}."
    values = ", ".join(amount(float(v), unit) for v in lasting[name][shares > 0])
    sticking = int((shares > 0).sum())
    return f" The contact sticks in {sticking} of these {len(lasting)}, {how}: at {name} {values}."
