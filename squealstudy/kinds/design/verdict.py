"""The verdict of a design study: its numbers, and the sentence whose words follow from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.engine.parameter_units import units_of_study
from squealstudy.engine.plan import has_mesh
from squealstudy.engine.reduced import shared_facts
from squealstudy.kinds.design.design_search import DesignSearch
from squealstudy.kinds.design.plan import DesignPlan
from squealstudy.kinds.design.state import (
    NO_VARIABLES,
    NONE_FOUND,
    PROVEN,
    STOPPED,
    UNDECIDED,
    UNPROVEN,
)
from squealstudy.tables.validity import broken_rules, validity_counts
from squealstudy.wording import amount, band_text, listed, plural, setting

if TYPE_CHECKING:
    import pandas as pd

Solved = tuple[int, Mapping[str, Any]]  # an operating point and its row
# distance over the range, below which a variable is at its bound, or not changed
BOUND_REL_TOLERANCE = 1e-6
MOST_NAMED = 3  # variables that are not changed


def unstable_share(search: DesignSearch, ok: Mapping[int, Mapping[str, Any]]) -> float:
    """Share of the operation with an unstable mode, by occurrence; NaN where one is not known."""
    if not all(p in ok for p in range(search.state.n_matrix)):
        return float("nan")
    unstable = [ok[p]["n_unstable"] > 0 for p in range(search.state.n_matrix)]
    return float(search.study.occurrence[unstable].sum())


def facts(
    plan: DesignPlan, search: DesignSearch, designs: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """The verdict, its sentence and its numbers, for the manifest."""
    state, study = search.state, plan.design_study
    chosen = None
    if state.chosen is not None:
        chosen = next(d for d in designs if d["chosen"])
    changes = [] if state.chosen is None else changed(search, state.chosen)
    fact_of = (lambda k: None) if chosen is None else chosen.get
    return {
        "outcome": state.outcome,
        "failure": state.failure,
        "verdict": sentence(plan, search, designs) + _target_text(search),
        "today": 0,
        "chosen": None if chosen is None else int(chosen["design"]),
        "cost": None if chosen is None else float(chosen["cost"]),
        "changes": changes,
        "change": change_text(changes),
        "n_unstable": designs[0]["n_unstable"],
        "today_damping_ratio": designs[0]["min_damping_ratio"],
        "min_damping_ratio": fact_of("min_damping_ratio"),
        "frequency_hz": fact_of("frequency_hz"),
        "margin": study.goal.margin.damping_ratio,
        "probability": study.goal.margin.probability,
        "ranges": {v.name: v.range for v in study.variables},
        "operating": [s.name for s in study.sweeps[: study.n_operating]],
        "n_operating_points": state.n_matrix,
        "n_refined_points": len(state.points) - state.n_matrix,
        "n_in_view": len(state.active_points),
        "rounds": state.round,
        "n_designs": len(designs),
        "beside": _counts_outside_band(search, state.chosen),
        "today_beside": _counts_outside_band(search, study.nominal),
        **_reductions(plan),
        "targets": _targets(search),
    }


def _counts_outside_band(search: DesignSearch, design: np.ndarray | None) -> list[int]:
    """Number of modes that grow outside the band at each point of the matrix; 0 where unsolved."""
    finished_points = (
        None if design is None else search.finished_modes(p, design)
        for p in range(search.state.n_matrix)
    )
    return [0 if finished is None else len(finished[1]["beside"]) for finished in finished_points]


def _targets(search: DesignSearch) -> dict[str, Any] | None:
    """Facts on the search over targets alone and the nearest changes; None without one."""
    realisation = search.state.realisation
    if realisation is None:
        return None
    return {
        "change": change_text(changed(search, realisation.target)),
        "cost": search.box.price(search.change(realisation.target)),
        "enough": realisation.enough,
        "nearest": change_text(changed(search, realisation.begun)),
        "matched": realisation.matched if np.isfinite(realisation.matched) else None,
    }


def _target_text(search: DesignSearch) -> str:
    """Sentences on the targets, with a space before them; empty without targets."""
    facts = _targets(search)
    if facts is None:
        return ""
    what = facts["change"] or "no change"
    met = "would meet the margin at the points in view, unproven"
    come = met if facts["enough"] else "comes nearest to the margin, and misses it"
    opening = f" Of component modes alone, targets which nobody can build, {what} {come}"
    if not facts["nearest"] or facts["matched"] is None:
        return f"{opening}."
    part = f"{100 * facts['matched']:.3g} %"
    nearest = f"What can be built has {part} of that first-order effect at most, by "
    return f"{opening}. {nearest}{facts['nearest']}."


def _reductions(plan: DesignPlan) -> dict[str, int]:
    """Number of structures of the designs, and number of reductions for them."""
    if not has_mesh(plan.study):
        return {"n_structures": 0, "n_reductions": 0}
    alone = list(plan.structures.values())
    shared = shared_facts(plan).get("shared_basis", {"used": False})
    common_range = plan.shared_range
    if common_range is not None and shared["used"]:
        alone = [point for point in alone if not common_range.holds(point.values)]
    return {
        "n_structures": len(plan.structures),
        "n_reductions": len(alone) + (shared["reductions"] if shared["used"] else 0),
    }


def changed(search: DesignSearch, design: np.ndarray) -> list[dict[str, Any]]:
    """Facts on every variable that a design changes: both values, and whether it is at a bound."""
    z, study, ends = search.change(design), search.study, at_bounds(search, design)
    units = units_of_study(study)
    return [
        {
            "parameter": v.name,
            "from": v.nominal,
            "to": float(new_value),
            "unit": units.get(v.name, ""),
            "at_bound": bool(ends[k]),
        }
        for k, (v, new_value) in enumerate(zip(study.variables, design, strict=True))
        if abs(z[k]) > BOUND_REL_TOLERANCE
    ]


def at_bounds(search: DesignSearch, design: np.ndarray) -> np.ndarray:
    """Mask (d,) of the variables of a design that are at a bound, changed or not."""
    z = search.change(design)
    is_at_bound: np.ndarray = (
        np.minimum(z - search.whole.low, search.whole.high - z) < BOUND_REL_TOLERANCE
    )
    return is_at_bound


def change_text(changes: Sequence[Mapping[str, Any]]) -> str:
    """Changes in words: ``k1 1.31 -> 1.2 MN/m``."""
    parts = []
    for c in changes:
        largest = max(abs(c["from"]), abs(c["to"]))
        before, after = (amount(v, c["unit"], largest, digits=5) for v in (c["from"], c["to"]))
        parts.append(f"{c['parameter']} {before.split(' ')[0]} -> {after}")
    return ", ".join(parts)


def _unchanged(search: DesignSearch, changes: Sequence[Mapping[str, Any]]) -> str:
    """Text on variables that a design leaves as they are; empty for none."""
    changed_names = {c["parameter"] for c in changes}
    names = [v.name for v in search.study.variables if v.name not in changed_names]
    return f"; not needed: {listed(names, MOST_NAMED)}" if names else ""


def beyond_validity(points: pd.DataFrame, design: int | None) -> str:
    """A sentence on the assumptions that operating points of a design break; empty for none.

    `points` is the table with its columns of validity; `design` is None for today's design.
    """
    of_design = points[(points["design"] == (design or 0)).to_numpy(bool)]
    outside, solved, rules = validity_counts(of_design)
    if not outside:
        return ""
    which = "the chosen design" if design else "today's design"
    return (
        f" But at {outside} of {plural(solved, 'solved operating point')} {which} is beyond what "
        f"the model is valid for, so that nothing of it is shown there: {broken_rules(rules)}."
    )


def _where(plan: DesignPlan, search: DesignSearch, p: int) -> str:
    """An operating point in words."""
    study = plan.design_study
    units = {q.name: q.unit for q in study.model.parameters}
    point = search.state.points[p]
    return ", ".join(
        setting(s.name, float(v), units.get(s.name, ""))
        for s, v in zip(study.sweeps[: study.n_operating], point, strict=True)
    )


def _solved(search: DesignSearch, design: np.ndarray) -> list[Solved]:
    """Indices and rows of the points at which a design was solved."""
    finished_points = (
        (p, search.finished_modes(p, design)) for p in range(len(search.state.points))
    )
    with_rows = [(p, finished[1]) for p, finished in finished_points if finished is not None]
    return [(p, r) for p, r in with_rows if r["status"] == "ok"]


def least_damped(solved: Sequence[Solved]) -> Solved | None:
    """The point of least damping among those that have a mode in the band."""
    with_modes = [point for point in solved if np.isfinite(point[1]["min_damping_ratio"])]
    return min(with_modes, key=lambda point: point[1]["min_damping_ratio"], default=None)


def _mode_text(plan: DesignPlan, search: DesignSearch, design: np.ndarray) -> str:
    """Text on a design's mode of least damping and its point, and on modes that grow outside."""
    solved = _solved(search, design)

    def at(p: int) -> str:
        where = _where(plan, search, p)
        return f" at {where}" if where else ""

    text, least_damped_mode = "no mode in the band where it was solved", least_damped(solved)
    if least_damped_mode is not None:
        p, row = least_damped_mode
        hz, zeta = row["frequency_hz"], row["min_damping_ratio"]
        scatters = plan.design_study.goal.margin.probability is not None
        text = f"least damping {100 * zeta:.3g} %{' without scatter' * scatters}"
        text += f", mode at {hz:.5g} Hz ({row['main_component']})"
        text = f"{text if hz else 'steady sliding diverges without oscillation'}{at(p)}"
    beside = [(m["damping_ratio"], m["frequency_hz"], p) for p, r in solved for m in r["beside"]]
    if beside:
        zeta, hz, p = min(beside)
        text += f"; outside the band a mode at {hz:.5g} Hz grows, damping {100 * zeta:.3g} %{at(p)}"
    return text


def _today(search: DesignSearch, band_hz: Sequence[float]) -> str:
    """Text on the number of operating points at which today's design has an unstable mode."""
    state, today = search.state, search.study.nominal
    rows = [search.rows[search.evaluation(p, today)] for p in range(state.n_matrix)]
    unstable = sum(r["status"] == "ok" and r["n_unstable"] > 0 for r in rows)
    failed = sum(r["status"] != "ok" for r in rows)
    text = f"Today's design has an unstable mode {band_text(band_hz)} at {unstable} of "
    text += f"{state.n_matrix} operating points"
    if unstable and search.goal.occurrence:
        share = unstable_share(search, {p: r for p, r in enumerate(rows) if r["status"] == "ok"})
        text += f", {100 * share:.3g} % of the operation" if np.isfinite(share) else ""
    return text + (f" ({failed} could not be solved)" if failed else "")


def _proof(search: DesignSearch) -> str:
    """Text on all checks of the chosen design, and on checks that were not made."""
    assert search.state.chosen is not None
    last = {c.kind: c for c in search.state.checks if np.array_equal(c.design, search.state.chosen)}
    words = {
        "matrix": "the matrix",
        "refined": "points between",
        "full_order": "full order",
        "limit_cycles": "limit cycles",
        "in_time": "runs in time",
        "scatter": "scatter",
    }
    parts = []
    for kind, word in words.items():
        if kind not in last:
            continue
        check = last[kind]
        passed = {True: "", False: "FAILED, ", None: "undecided, "}[check.passed]
        parts.append(f"{word}: {passed}{check.text}")
    checks = ["limit_cycles", "in_time", *(["full_order"] if search.reduced else [])]
    missing = [words[k] for k in checks if k not in last]
    none = f"; not checked: {', '.join(missing)}" if missing else ""
    return "; ".join(parts) + none


def sentence(plan: DesignPlan, search: DesignSearch, designs: Sequence[Mapping[str, Any]]) -> str:
    """The verdict in a few sentences."""
    state, goal = search.state, plan.design_study.goal
    today = _today(search, plan.band_hz)
    assert state.chosen is not None
    chosen, margin = state.chosen, f"{100 * goal.margin.damping_ratio:g} %"
    if goal.margin.probability is not None:  # what has it without scatter may miss it
        margin += f" with probability {goal.margin.probability:g}"
    mode = _mode_text(plan, search, chosen)
    if state.outcome == NO_VARIABLES:
        return f"{today}: {mode}. Nothing may change: the file has no [[variable]]."
    changes = changed(search, chosen)
    price = search.box.price(search.change(chosen))
    change = change_text(changes) or "no change"
    searched = f"{plural(len(designs), 'design')} evaluated"
    kicks = f" with {len(state.demands)} demands of the proof" if state.demands else ""
    if state.failure:
        return (
            f"{today}; no design could be held against the margin of {margin}{kicks}, for "
            f"operating points of it could not be solved ({state.failure}). {searched}."
        )
    if state.outcome in (*PROVEN, UNDECIDED):
        change += _unchanged(search, changes)
        text = f"At a cost of {price:.4g} ({change}) every operating point meets the margin"
        text = text if changes else "As it is it meets the margin"
        proof = "Proof" if state.outcome in PROVEN else "Not all of the proof could be told"
        return f"{today}. {text} of {margin}: {mode}. {proof}: {_proof(search)}. {searched}."
    if state.outcome == NONE_FOUND:
        nearest = change_text(changes) or "today's design"
        n_active = len(state.active_points)
        where = "" if n_active >= len(state.points) else f", of {n_active} operating points in view"
        ends = at_bounds(search, chosen)
        bound = [v.name for v, end in zip(search.study.variables, ends, strict=True) if end]
        binds = f"; at their bounds: {', '.join(bound)}" if bound else "; no variable at a bound"
        return (
            f"{today}; no design within the bounds was found that meets the margin of "
            f"{margin}{kicks}. Nearest comes {nearest}: {mode}{where}{binds}. {searched}."
        )
    why = "the limit of designs was reached" if state.outcome == STOPPED else "no proof succeeded"
    assert state.outcome in (STOPPED, UNPROVEN)
    return (
        f"{today}; {why}: the last candidate, at a cost of {price:.4g} ({change}), is not proven: "
        f"{mode}. Checks: {_proof(search)}. {searched}."
    )
