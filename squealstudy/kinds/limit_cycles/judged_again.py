"""Corrects the verdicts of a design after a limit cycle of another design was continued to it.

The continued cycle may be louder, stable or smaller than the cycles that the first verdict knew.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from squealstudy.cycles.cycle import OK
from squealstudy.cycles.small_motion import COMES_TO, DISTINCT_LEVEL_RATIO
from squealstudy.cycles.verdicts import ONLY_UNSTABLE
from squealstudy.kinds.limit_cycles.tables import known_velocity, summary, with_validity
from squealstudy.wording import IF_KICKED, NO_CYCLE, SQUEALS, UNDECIDED

THRESHOLD_COLUMNS = tuple(f"threshold_{name}" for name in ("velocity", "error", "energy", "share"))
# columns that a verdict and a cycle both have, under the same names
COLUMNS_OF_BOTH = "torque_rms", "level_error", "torque_line_hz", "invalid_reason"


def judge_again(
    row: dict[str, Any], mode: int, came: str, cycle: dict[str, Any] | None = None
) -> None:
    """Change the verdicts in a row of a design after a cycle was continued to it.

    A threshold with more energy than the new cycle is removed: motion below it may grow.

    Parameters
    ----------
    row : dict
        Row of the design, with its cycles; it is changed in place.
    mode : int
        Number of the mode to whose verdict the cycle belongs.
    came : str
        The continuation in words: "a cycle continued from ...".
    cycle : dict or None
        Row of the new cycle; None where the design did not confirm it.
    """
    for verdict in row["verdicts"]:
        if cycle is not None and verdict["threshold_energy"] > cycle["energy"]:
            verdict |= dict.fromkeys(THRESHOLD_COLUMNS, np.nan) | {"threshold_cycle": ""}
            verdict["reason"] += f"; no threshold: {came} is smaller"
        if verdict["mode"] != mode:
            continue
        stable, small = cycle is not None and bool(cycle["stable"]), ""
        if cycle is not None:
            verdict["n_cycles"] += 1
            # the level may be that of the same motion from a run in time, which is less exact
            level = verdict["torque_rms"]
            lowest_level = level * (1.0 - np.nan_to_num(verdict["level_error"]))
            small = _of_small_motion(verdict["reason"], level, cycle["torque_rms"])
            if stable and not lowest_level >= cycle["torque_rms"]:
                verdict |= {name: cycle[name] for name in COLUMNS_OF_BOTH}
                verdict["regularisation_error"] = np.nan
                verdict["cycle_frequency_hz"] = cycle["frequency_hz"]
                verdict["cycle_frequency_error"] = cycle["frequency_error"]
                verdict["threshold_share"] = verdict["threshold_velocity"] / known_velocity(cycle)
        if verdict["verdict"] == SQUEALS:
            if stable:
                reason = f"unstable mode, with a stable cycle: {came}{small}"
                verdict["reason"] = with_validity(reason, verdict["invalid_reason"])
        elif stable:
            if verdict["verdict"] != IF_KICKED:
                reason = f"{came} is stable, and {_of_steady_sliding(row)}"
                verdict["reason"] = with_validity(reason, verdict["invalid_reason"])
            verdict["verdict"] = IF_KICKED
        elif verdict["verdict"] == NO_CYCLE:
            verdict["verdict"], verdict["reason"] = UNDECIDED, came + _why_not_stable(cycle)
        elif cycle is None or cycle["stable"] is None:
            joined = ", and" if cycle is None else " but"
            reason = f"{ONLY_UNSTABLE}{joined} {came}{_why_not_stable(cycle, ' that')}"
            verdict["reason"] = verdict["reason"].replace(ONLY_UNSTABLE, reason)
        elif not verdict["threshold_velocity"] > 0.0 and ONLY_UNSTABLE not in verdict["reason"]:
            verdict["reason"] += f"; {came} is unstable, at {cycle['contact_velocity']:.3g} m/s"
    row |= summary(row["verdicts"], row["cycles"], row["n_left_out"], bool(row["unstable_outside"]))


def _of_small_motion(reason: str, level: float, cycle_level: float) -> str:
    """Clause on small motion beside a cycle, from the reason and the level before it came."""
    if not cycle_level <= DISTINCT_LEVEL_RATIO * level:
        return "; whether small motion grows to it was not tried"
    begin = reason.find(COMES_TO)
    return "" if begin < 0 else reason[begin:].split("; outside validity")[0]


def _of_steady_sliding(row: dict[str, Any]) -> str:
    """End of a reason for a stable cycle of a stable mode: whether steady sliding is stable."""
    if any(v["unstable"] for v in row["verdicts"]) or row["unstable_outside"]:
        return "steady sliding is not, by another mode"
    return "so is steady sliding; no threshold"


def _why_not_stable(cycle: dict[str, Any] | None, that: str = "") -> str:
    """End of a sentence that tells why a cycle may not be stable; empty if it was not confirmed."""
    if cycle is None:
        return ""
    if cycle["status"] != OK:
        return f"{that} is inaccurate"
    return f"{that} may be stable" if cycle["stable"] is None else f"{that} is unstable"
