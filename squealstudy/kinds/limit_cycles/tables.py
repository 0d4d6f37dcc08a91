"""Chunk rows of studies of limit cycles: a design point, its verdicts, cycles and curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pyarrow as pa

from squealstudy.cycles.cycle import Cycle, same_cycle
from squealstudy.cycles.kicked import Kick
from squealstudy.cycles.verdicts import MAX_THRESHOLD_REL_ERROR, Family, Followed
from squealstudy.engine.rows import (
    FLAG,
    HEAD,
    REAL,
    TEXT,
    WHOLE_NUMBER,
    WORKING_POINT_FIELDS,
    head,
    structs,
    working_point_cells,
)
from squealstudy.engine.validity import motion_reason
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.wording import IF_KICKED, SQUEALS, UNDECIDED, VERDICTS, plural

SUMMARY_FIELDS = (
    ("verdict", TEXT),
    ("reason", TEXT),
    ("n_families", WHOLE_NUMBER),
    ("n_left_out", WHOLE_NUMBER),
    ("unstable_outside", FLAG),
    ("n_unstable", WHOLE_NUMBER),
    ("n_cycles", WHOLE_NUMBER),
    ("max_growth_rate", REAL),
    ("torque_rms", REAL),
    ("level_error", REAL),
    ("regularisation_error", REAL),
    ("frequency_hz", REAL),
    ("frequency_error", REAL),
    ("torque_line_hz", REAL),
    ("threshold_velocity", REAL),
    ("threshold_share", REAL),
    ("invalid_reason", TEXT),
)
VERDICT_FIELDS = (
    ("mode", WHOLE_NUMBER),
    ("frequency_hz", REAL),
    ("growth_rate", REAL),
    ("damping_ratio", REAL),
    ("unstable", FLAG),
    ("verdict", TEXT),
    ("reason", TEXT),
    ("n_cycles", WHOLE_NUMBER),
    ("n_lost", WHOLE_NUMBER),
    ("reached_velocity", REAL),
    ("curve_end", TEXT),
    ("curve_of", TEXT),
    ("torque_rms", REAL),
    ("level_error", REAL),
    ("regularisation_error", REAL),
    ("cycle_frequency_hz", REAL),
    ("cycle_frequency_error", REAL),
    ("torque_line_hz", REAL),
    ("threshold_velocity", REAL),
    ("threshold_error", REAL),
    ("threshold_energy", REAL),
    ("threshold_share", REAL),
    ("threshold_cycle", TEXT),
    ("kick_velocity", REAL),
    ("kick_phase", REAL),
    ("kick_energy", REAL),
    ("kick_error", REAL),
    ("kick_status", TEXT),
    ("run_status", TEXT),
    ("invalid_reason", TEXT),
)
LEVELS = (
    "torque_mean",
    "torque_rms",
    "torque_peak",
    "contact_velocity",
    "normal_force_rms",
    "energy",
    "friction_power",
    "damping_power",
    "belt_power",
    "power_imbalance",
    "stick_share",
    "stick_share_max",
    "open_share",
    "open_share_max",
)
CYCLE_FIELDS = (
    ("cycle_id", TEXT),
    ("mode", WHOLE_NUMBER),
    ("status", TEXT),
    ("frequency_hz", REAL),
    ("torque_line_hz", REAL),
    *((name, REAL) for name in LEVELS),
    ("radiated_power", REAL),
    ("torque_harmonics", pa.list_(REAL)),
    ("stable", FLAG),
    ("instability", TEXT),
    ("n_unstable", WHOLE_NUMBER),
    ("multiplier", REAL),
    ("multiplier_error", REAL),
    ("growth_rate", REAL),
    ("n_harmonics", WHOLE_NUMBER),
    ("harmonic_tail", REAL),
    ("level_error", REAL),
    ("velocity_error", REAL),
    ("torque_peak_error", REAL),
    ("frequency_error", REAL),
    ("basis_error", REAL),
    ("n_vectors", WHOLE_NUMBER),
    ("balance_residual", REAL),
    ("same_as", TEXT),
    ("continued_from", TEXT),
    ("invalid_reason", TEXT),
)
CURVE_FIELDS = (
    ("mode", WHOLE_NUMBER),
    ("n_step", WHOLE_NUMBER),
    ("event", TEXT),
    ("contact_velocity", REAL),
    ("frequency_hz", REAL),
    ("added_damping", REAL),
    ("basis_error", REAL),
    ("balance_residual", REAL),
)
LEVEL = (  # columns of the level of a verdict
    "torque_rms",
    "level_error",
    "cycle_frequency_hz",
    "cycle_frequency_error",
    "torque_line_hz",
)
NOT_KICKED = Kick(np.nan, np.nan, np.nan, np.nan, "")
SCHEMA = pa.schema(
    [
        pa.field(n, t, nullable=t in (WHOLE_NUMBER, FLAG))
        for n, t in (*HEAD, *SUMMARY_FIELDS, *WORKING_POINT_FIELDS)
    ]
    + [
        pa.field("verdicts", structs(VERDICT_FIELDS)),
        pa.field("cycles", structs(CYCLE_FIELDS)),
        pa.field("curves", structs(CURVE_FIELDS)),
    ]
)


def solved_row(
    point_id: str,
    wall_s: float,
    steady: WorkingPoint,
    law_kind: str,
    followed: Followed,
    kicked: Mapping[int, Kick],
) -> dict[str, Any]:
    """Chunk row of a design point from its families, and its kicks by the numbers of modes."""
    family_list = followed.families
    cycles = _cycles(point_id, law_kind, family_list)
    verdicts = [
        _verdict(point_id, mode, family, law_kind)
        | {f"kick_{k}": v for k, v in asdict(kicked.get(mode, NOT_KICKED)).items()}
        for mode, family in family_list
    ]
    curves = [
        {"mode": mode, "n_step": k, "balance_residual": p["residual"], **_without(p, "residual")}
        for mode, family in family_list
        for k, p in enumerate(family.curve)
    ]
    return {
        **head(point_id, wall_s),
        **summary(verdicts, cycles, followed.left_out, followed.unstable_outside),
        **working_point_cells(steady),
        "verdicts": verdicts,
        "cycles": cycles,
        "curves": curves,
    }


def _without(row: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: cell for key, cell in row.items() if key != name}


def summary(
    verdicts: Sequence[Mapping[str, Any]],
    cycles: Sequence[Mapping[str, Any]],
    left_out: int,
    unstable_outside: bool,
) -> dict[str, Any]:
    """Summary of the families of a design; its levels are those of the loudest stable cycle."""
    beyond = f"; {plural(left_out, 'mode')} not followed" if left_out else ""
    beyond += "; a mode outside the band is unstable" if unstable_outside else ""
    facts = {"n_left_out": left_out, "unstable_outside": unstable_outside}
    if not verdicts:
        numbers = dict.fromkeys((n for n, t in SUMMARY_FIELDS if t == REAL), np.nan)
        counts = dict.fromkeys(("n_families", "n_unstable", "n_cycles"), 0)
        reason = f"no mode was followed{beyond}"
        words = {"verdict": UNDECIDED, "reason": reason, "invalid_reason": ""}
        return {**words, **facts, **counts, **numbers}
    # of several modes that squeal the one that grows fastest
    first = min(
        verdicts,
        key=lambda v: (
            VERDICTS.index(v["verdict"]),
            -v["growth_rate"] if v["verdict"] == SQUEALS else 0.0,
        ),
    )
    loudest = max(
        (v for v in verdicts if np.isfinite(v["torque_rms"])),
        key=lambda v: v["torque_rms"],
        default=first,
    )
    kicked = [v for v in verdicts if np.isfinite(v["threshold_velocity"])]
    weakest = min(kicked, key=lambda v: v["threshold_velocity"], default=first)
    shown = weakest if first["verdict"] == IF_KICKED else first
    level = f"; the level shown is of mode {loudest['mode']}: {loudest['reason']}"
    is_first_or_silent = loudest is first or not np.isfinite(loudest["torque_rms"])
    return {
        "verdict": first["verdict"],
        "reason": f"mode {first['mode']}: {first['reason']}"
        + ("" if is_first_or_silent else level)
        + ("" if first["verdict"] == SQUEALS else beyond),
        **facts,
        "n_families": len(verdicts),
        "n_unstable": sum(v["unstable"] for v in verdicts),
        "n_cycles": sum(c["same_as"] == "" for c in cycles),
        "max_growth_rate": max(v["growth_rate"] for v in verdicts),
        "torque_rms": loudest["torque_rms"],
        "level_error": loudest["level_error"],
        "regularisation_error": loudest["regularisation_error"],
        "frequency_hz": loudest["cycle_frequency_hz"],
        "frequency_error": loudest["cycle_frequency_error"],
        "torque_line_hz": loudest["torque_line_hz"],
        "invalid_reason": loudest["invalid_reason"],
        "threshold_velocity": shown["threshold_velocity"],
        "threshold_share": shown["threshold_velocity"] / _velocity(loudest, cycles),
    }


def _velocity(verdict: Mapping[str, Any], cycles: Sequence[Mapping[str, Any]]) -> float:
    """Contact velocity [m/s] of the cycle whose level a verdict has; NaN where it has none."""
    of_level = (c for c in cycles if c["stable"] and c["torque_rms"] == verdict["torque_rms"])
    return max((known_velocity(c) for c in of_level), default=np.nan)


def known_velocity(cycle: Mapping[str, Any]) -> float:
    """Contact velocity [m/s] of a row of a cycle; NaN where its error is too large."""
    return (
        float(cycle["contact_velocity"])
        if cycle["velocity_error"] <= MAX_THRESHOLD_REL_ERROR
        else np.nan
    )


def with_validity(reason: str, broken: str) -> str:
    """The reason of a verdict, with the limits of validity that its loudest motion exceeds."""
    return reason + (f"; outside validity: {broken}" if broken else "")


def _verdict(point_id: str, mode: int, family: Family, law_kind: str) -> dict[str, Any]:
    """Row of the table of verdicts, for one mode of a design."""
    loud, kick = family.loudest, family.threshold
    velocity = np.nan if kick is None else kick.levels["contact_velocity"]
    level, share, opened = dict.fromkeys(LEVEL, np.nan), np.nan, 0.0
    if loud is not None:
        hz, line = loud.motion.omega / (2 * np.pi), torque_line(loud)
        values = (loud.levels["torque_rms"], loud.level_error, hz, loud.frequency_error, line)
        level, opened = dict(zip(LEVEL, values, strict=True)), loud.levels["open_share_max"]
    run = family.run  # if it came to the stable cycle, the level of that is more exact
    louder = False
    if run is not None:
        louder = run.torque_rms * (1.0 - np.nan_to_num(run.spread)) > level["torque_rms"]
    by_corner = np.nan
    if run is not None and (loud is None or louder):
        by_corner = run.regularisation
        hz, error = run.frequency_hz, run.frequency_error
        values = (run.torque_rms, run.spread, hz, error, run.line_hz)
        level, opened = dict(zip(LEVEL, values, strict=True)), run.open_share_max
    broken = motion_reason(law_kind, opened)
    if kick is not None and loud is not None and loud.velocity_error <= MAX_THRESHOLD_REL_ERROR:
        share = velocity / loud.levels["contact_velocity"]
    return {
        "mode": mode,
        "frequency_hz": abs(family.lam) / (2 * np.pi),
        "growth_rate": family.lam.real,
        "damping_ratio": -family.lam.real / abs(family.lam),
        "verdict": family.verdict,
        "reason": with_validity(family.reason, broken),
        "unstable": family.verdict == SQUEALS,
        "n_cycles": len(family.cycles),
        "n_lost": family.lost,
        "reached_velocity": family.reached,
        "curve_end": family.end,
        "curve_of": family.origin,
        **level,
        "regularisation_error": by_corner,
        "run_status": "" if family.run is None else family.run.outcome,
        "invalid_reason": broken,
        "threshold_velocity": velocity,
        "threshold_error": np.nan if kick is None else kick.velocity_error,
        "threshold_energy": np.nan if kick is None else kick.levels["energy"],
        "threshold_share": share,
        "threshold_cycle": ""
        if kick is None
        else _cycle_id(point_id, mode, family.cycles.index(kick)),
    }


def torque_line(cycle: Cycle) -> float:
    """Frequency [Hz] of the strongest harmonic of a cycle's torque; NaN where it has none."""
    sizes = cycle.torque_harmonics
    if not sizes.any():
        return np.nan
    return float((1 + int(np.argmax(sizes))) * cycle.motion.omega / (2 * np.pi))


def _cycle_id(point_id: str, mode: int, number: int) -> str:
    return f"{point_id}-{mode}-{number + 1}"


def _cycles(
    point_id: str, law_kind: str, families: Sequence[tuple[int, Family]]
) -> list[dict[str, Any]]:
    """Rows of all cycles; a cycle of two families has two rows, the second with ``same_as``."""
    earlier_cycles: list[tuple[str, Cycle]] = []
    rows = []
    for mode, family in families:
        for number, cycle in enumerate(family.cycles):
            name = _cycle_id(point_id, mode, number)
            same = next((other for other, c in earlier_cycles if same_cycle(c, cycle)), "")
            rows.append(cycle_row(name, mode, cycle, law_kind) | {"same_as": same})
            if not same:
                earlier_cycles.append((name, cycle))
    return rows


def cycle_row(name: str, mode: int, cycle: Cycle, law_kind: str) -> dict[str, Any]:
    """Row of a cycle."""
    motion, multipliers = cycle.motion, cycle.multipliers
    return {
        "cycle_id": name,
        "mode": mode,
        "status": cycle.status,
        "frequency_hz": motion.omega / (2 * np.pi),
        "torque_line_hz": torque_line(cycle),
        **{name: cycle.levels[name] for name in LEVELS},
        "radiated_power": np.nan,
        "torque_harmonics": cycle.torque_harmonics.tolist(),
        "stable": cycle.attracts,
        "instability": multipliers.instability,
        "n_unstable": multipliers.n_unstable,
        "multiplier": multipliers.modulus,
        "multiplier_error": multipliers.error,
        "growth_rate": multipliers.growth_rate,
        "n_harmonics": motion.harmonics,
        "harmonic_tail": motion.tail,
        "level_error": cycle.level_error,
        "velocity_error": cycle.velocity_error,
        "torque_peak_error": cycle.peak_error,
        "frequency_error": cycle.frequency_error,
        "basis_error": cycle.basis_error,
        "n_vectors": cycle.n_vectors,
        "balance_residual": cycle.residual,
        "same_as": "",
        "continued_from": "",
        "invalid_reason": motion_reason(law_kind, cycle.levels["open_share_max"]),
    }
