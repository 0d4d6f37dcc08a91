"""The verdict of a design study: its numbers, and the sentence whose words follow from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.engine.plan import has_mesh
from squealstudy.engine.reduced import shared_facts
from squealstudy.kinds.design.loop import Loop
from squealstudy.kinds.design.plan import DesignPlan
from squealstudy.kinds.design.state import (
    NONE_FOUND,
    NOTHING,
    PROVEN,
    STOPPED,
    UNDECIDED,
    UNPROVEN,
)
from squealstudy.tables.validity import broken_rules, validity_counts
from squealstudy.wording import amount, band_text, plural, setting

if TYPE_CHECKING:
    import pandas as pd

Solved = tuple[int, Mapping[str, Any]]  # a point of the loop and its row
BOUND_REL_TOLERANCE = 1e-6  # of a range: a variable is at its bound


def unstable_share(loop: Loop, ok: Mapping[int, Mapping[str, Any]]) -> float:
    """Share of the operation with an unstable mode, by occurrence; NaN where one is not known."""
    if not all(p in ok for p in range(loop.state.n_matrix)):
        return float("nan")
    unstable = [ok[p]["n_unstable"] > 0 for p in range(loop.state.n_matrix)]
    return float(loop.study.occurrence[unstable].sum())


def facts(plan: DesignPlan, loop: Loop, designs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The verdict, its sentence and its numbers, for the manifest."""
    state, study = loop.state, plan.design_study
    chosen = None
    if state.chosen is not None:
        chosen = next(d for d in designs if d["chosen"])
    changes = [] if state.chosen is None else changed(loop, state.chosen)
    least = (lambda k: None) if chosen is None else chosen.get
    return {
        "outcome": state.outcome,
        "failure": state.failure,
        "verdict": sentence(plan, loop, designs) + _target_text(loop),
        "today": 0,
        "chosen": None if chosen is None else int(chosen["design"]),
        "cost": None if chosen is None else float(chosen["cost"]),
        "changes": changes,
        "change": change_text(changes),
        "n_unstable": designs[0]["n_unstable"],
        "today_damping_ratio": designs[0]["min_damping_ratio"],
        "min_damping_ratio": least("min_damping_ratio"),
        "frequency_hz": least("frequency_hz"),
        "margin": study.goal.margin.damping_ratio,
        "probability": study.goal.margin.probability,
        "ranges": {v.name: v.range for v in study.variables},
        "operating": [s.name for s in study.sweeps[: study.n_operating]],
        "n_operating_points": state.n_matrix,
        "n_refined_points": len(state.points) - state.n_matrix,
        "n_in_view": len(state.view),
        "rounds": state.round,
        "n_designs": len(designs),
        "beside": _beside(loop, state.chosen),
        "today_beside": _beside(loop, study.nominal),
        **_reductions(plan),
        "targets": _targets(loop),
    }


def _beside(loop: Loop, design: np.ndarray | None) -> list[int]:
    """How many modes grow beside the band, at every operating point where a design was solved."""
    known = (None if design is None else loop.known(p, design) for p in range(loop.state.n_matrix))
    return [0 if own is None else len(own[1]["beside"]) for own in known]


def _targets(loop: Loop) -> dict[str, Any] | None:
    """What targets alone come to, and the nearest changes; None where they were not searched."""
    found = loop.state.realisation
    if found is None:
        return None
    return {
        "change": change_text(changed(loop, found.target)),
        "cost": loop.box.price(loop.change(found.target)),
        "enough": found.enough,
        "nearest": change_text(changed(loop, found.begun)),
        "matched": found.matched if np.isfinite(found.matched) else None,
    }


def _target_text(loop: Loop) -> str:
    """The same in words, with a space before them; empty where there are none."""
    facts = _targets(loop)
    if facts is None:
        return ""
    what = facts["change"] or "no change"
    met = "would meet the margin at the points in view, unproven"
    come = met if facts["enough"] else "comes nearest to the margin, and misses it"
    told = f" Of targets alone, which nobody can build, {what} {come}"
    if not facts["nearest"] or facts["matched"] is None:
        return f"{told}."
    part = f"{100 * facts['matched']:.3g} %"
    return (
        f"{told}; nearest to them, with {part} of their first-order effect, is {facts['nearest']}."
    )


def _reductions(plan: DesignPlan) -> dict[str, int]:
    """How many structures the designs have, and how many reductions those take."""
    if not has_mesh(plan.study):
        return {"n_structures": 0, "n_reductions": 0}
    alone = list(plan.structures.values())
    shared = shared_facts(plan).get("shared_basis", {"used": False})
    held = plan.shared_range
    if held is not None and shared["used"]:
        alone = [point for point in alone if not held.holds(point.values)]
    return {
        "n_structures": len(plan.structures),
        "n_reductions": len(alone) + (shared["reductions"] if shared["used"] else 0),
    }


def changed(loop: Loop, design: np.ndarray) -> list[dict[str, Any]]:
    """Every variable that a design changes: from what to what, and whether to its bound."""
    z, study, ends = loop.change(design), loop.study, at_bounds(loop, design)
    units = {p.name: p.unit for p in study.model.parameters}
    return [
        {
            "parameter": v.name,
            "from": v.nominal,
            "to": float(value),
            "unit": units.get(v.name, ""),
            "at_bound": bool(ends[k]),
        }
        for k, (v, value) in enumerate(zip(study.variables, design, strict=True))
        if abs(z[k]) > BOUND_REL_TOLERANCE
    ]


def at_bounds(loop: Loop, design: np.ndarray) -> np.ndarray:
    """Which variables (d,) of a design are at a bound, those that are as today too."""
    z = loop.change(design)
    near: np.ndarray = np.minimum(z - loop.whole.low, loop.whole.high - z) < BOUND_REL_TOLERANCE
    return near


def change_text(changes: Sequence[Mapping[str, Any]]) -> str:
    """Changes in words: ``k1 1.31 -> 1.2 MN/m``."""
    parts = []
    for c in changes:
        largest = max(abs(c["from"]), abs(c["to"]))
        before, after = (amount(v, c["unit"], largest, digits=5) for v in (c["from"], c["to"]))
        parts.append(f"{c['parameter']} {before.split(' ')[0]} -> {after}")
    return ", ".join(parts)


def beyond_validity(points: pd.DataFrame, design: int | None) -> str:
    """What the operating points of a design break, as the verdict's last sentence; or nothing.

    `points` is the table with its validity; None of design is today's.
    """
    own = points[(points["design"] == (design or 0)).to_numpy(bool)]
    outside, solved, rules = validity_counts(own)
    if not outside:
        return ""
    which = "the chosen design" if design else "today's design"
    return (
        f" But at {outside} of {plural(solved, 'solved operating point')} {which} is beyond what "
        f"the model is valid for, so that nothing of it is shown there: {broken_rules(rules)}."
    )


def _where(plan: DesignPlan, loop: Loop, p: int) -> str:
    """An operating point in words."""
    study = plan.design_study
    units = {q.name: q.unit for q in study.model.parameters}
    point = loop.state.points[p]
    return ", ".join(
        setting(s.name, float(v), units.get(s.name, ""))
        for s, v in zip(study.sweeps[: study.n_operating], point, strict=True)
    )


def _solved(loop: Loop, design: np.ndarray) -> list[Solved]:
    """The points at which a design was solved, with their rows."""
    found = ((p, loop.known(p, design)) for p in range(len(loop.state.points)))
    known = [(p, own[1]) for p, own in found if own is not None]
    return [(p, r) for p, r in known if r["status"] == "ok"]


def least_damped(found: Sequence[Solved]) -> Solved | None:
    """The point of least damping among those that have a mode in the band."""
    some = [item for item in found if np.isfinite(item[1]["min_damping_ratio"])]
    return min(some, key=lambda item: item[1]["min_damping_ratio"], default=None)


def _mode_text(plan: DesignPlan, loop: Loop, design: np.ndarray) -> str:
    """The mode of least damping of a design, with its place, and what grows beside the band."""
    solved = _solved(loop, design)

    def at(p: int) -> str:
        where = _where(plan, loop, p)
        return f" at {where}" if where else ""

    text, found = "no mode in the band where it was solved", least_damped(solved)
    if found is not None:
        p, row = found
        hz, zeta = row["frequency_hz"], row["min_damping_ratio"]
        text = f"least damping ratio {zeta:.4g}, mode at {hz:.5g} Hz ({row['main_component']})"
        text = f"{text if hz else 'steady sliding diverges without oscillation'}{at(p)}"
    beside = [(m["damping_ratio"], m["frequency_hz"], p) for p, r in solved for m in r["beside"]]
    if beside:
        zeta, hz, p = min(beside)
        text += f"; outside the band a mode at {hz:.5g} Hz grows, damping ratio {zeta:.4g}{at(p)}"
    return text


def _today(loop: Loop, band_hz: Sequence[float]) -> str:
    """How often today's design squeals, by the modes of the band."""
    state, today = loop.state, loop.study.nominal
    rows = [loop.rows[loop.ask(p, today)] for p in range(state.n_matrix)]
    unstable = sum(r["status"] == "ok" and r["n_unstable"] > 0 for r in rows)
    failed = sum(r["status"] != "ok" for r in rows)
    text = f"Today's design has an unstable mode {band_text(band_hz)} at {unstable} of "
    text += f"{state.n_matrix} operating points"
    if unstable and loop.goal.occurrence:
        share = unstable_share(loop, {p: r for p, r in enumerate(rows) if r["status"] == "ok"})
        text += f", {100 * share:.3g} % of the operation" if np.isfinite(share) else ""
    return text + (f" ({failed} could not be solved)" if failed else "")


def _proof(loop: Loop) -> str:
    """The checks of the chosen design that passed, and what could not be told."""
    assert loop.state.chosen is not None
    last = {c.kind: c for c in loop.state.checks if np.array_equal(c.design, loop.state.chosen)}
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
    asked = ["limit_cycles", "in_time", *(["full_order"] if loop.reduced else [])]
    missing = [words[k] for k in asked if k not in last]
    none = f"; not checked: {', '.join(missing)}" if missing else ""
    return "; ".join(parts) + none


def sentence(plan: DesignPlan, loop: Loop, designs: Sequence[Mapping[str, Any]]) -> str:
    """The verdict."""
    state, goal = loop.state, plan.design_study.goal
    today = _today(loop, plan.band_hz)
    assert state.chosen is not None
    chosen, margin = state.chosen, goal.margin.damping_ratio
    mode = _mode_text(plan, loop, chosen)
    if state.outcome == NOTHING:
        return f"{today}: {mode}. Nothing may change: the file has no [[variable]]."
    changes = changed(loop, chosen)
    price = loop.box.price(loop.change(chosen))
    change = change_text(changes) or "no change"
    searched = f"{plural(len(designs), 'design')} evaluated"
    kicks = f" with {len(state.extras)} demands of the proof" if state.extras else ""
    if state.failure:
        return (
            f"{today}; no design could be held against the margin of {margin:g}{kicks}, for "
            f"operating points of it could not be solved ({state.failure}). {searched}."
        )
    if state.outcome in (*PROVEN, UNDECIDED):
        text = f"at a cost of {price:.4g} ({change}) every operating point meets the margin"
        text = text if changes else "as it is it meets the margin"
        proof = "Proof" if state.outcome in PROVEN else "Not all of the proof could be told"
        return f"{today}; {text} of {margin:g}: {mode}. {proof}: {_proof(loop)}. {searched}."
    if state.outcome == NONE_FOUND:
        nearest = change_text(changes) or "today's design"
        seen = len(state.view)
        where = "" if seen >= len(state.points) else f", of {seen} operating points in view"
        ends = at_bounds(loop, chosen)
        bound = [v.name for v, end in zip(loop.study.variables, ends, strict=True) if end]
        binds = f"; at their bounds: {', '.join(bound)}" if bound else "; no variable at a bound"
        return (
            f"{today}; no design within the bounds was found that meets the margin of "
            f"{margin:g}{kicks}. Nearest comes {nearest}: {mode}{where}{binds}. {searched}."
        )
    why = "the limit of designs was reached" if state.outcome == STOPPED else "no proof succeeded"
    assert state.outcome in (STOPPED, UNPROVEN)
    return (
        f"{today}; {why}: the last candidate, at a cost of {price:.4g} ({change}), is not proven: "
        f"{mode}. Checks: {_proof(loop)}. {searched}."
    )
