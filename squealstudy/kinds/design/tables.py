"""Tables of a design study: points, designs, margins, slopes, proof; and the verdict in a sentence.

Every word of the verdict follows from the tables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from squealstudy.engine.plan import has_mesh
from squealstudy.engine.rows import (
    FLAG,
    REAL,
    TEXT,
    WHOLE,
    WORKING_POINT_FIELDS,
    Fields,
    planned_rows,
    tabled,
    with_dtypes,
)
from squealstudy.engine.store import DESIGNS, MARGINS, PROOF, SLOPES, VARIANTS, Store
from squealstudy.engine.validity import write_points
from squealstudy.kinds.design.loop import Loop
from squealstudy.kinds.design.plan import DesignPlan
from squealstudy.kinds.design.rows import MODE_FIELDS, SCHEMA, SLOPE_FIELDS, SUMMARY_FIELDS
from squealstudy.kinds.design.state import (
    NONE_FOUND,
    NOTHING,
    PROVEN,
    STOPPED,
    UNDECIDED,
    UNPROVEN,
)
from squealstudy.kinds.design.variants import VARIANT_FIELDS, choice, variant_rows
from squealstudy.wording import plural, setting

if TYPE_CHECKING:
    import pandas as pd

Solved = tuple[int, Mapping[str, Any]]  # a point of the loop and its row
OWN_FIELDS = (("design", WHOLE), ("stage", TEXT))
ENDS = 1e-6  # of a range: a variable is at its bound
DESIGN_FIELDS = (
    ("design", WHOLE),
    ("role", TEXT),
    ("round", WHOLE),
    ("cost", REAL),
    ("n_points", WHOLE),
    ("n_failed", WHOLE),
    ("n_unstable", WHOLE),
    ("min_damping_ratio", REAL),
    ("frequency_hz", REAL),
    ("main_component", TEXT),
    ("worst_point", TEXT),
    ("margin", REAL),
    ("meets", FLAG),
    ("chosen", FLAG),
)
PROOF_FIELDS = (
    ("round", WHOLE),
    ("design", WHOLE),
    ("check", TEXT),
    ("passed", FLAG),
    ("n_points", WHOLE),
    ("value", REAL),
    ("text", TEXT),
)


def build_tables(plan: DesignPlan, store: Store, loop: Loop) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Write the six tables; that of the points, and the verdict for the manifest."""
    rows = planned_rows(plan, store, SCHEMA)
    numbers = {key: n for n, key in enumerate(loop.state.designs)}
    start = plan.design_study.n_operating
    own = slice(start, start + len(plan.design_study.variables))
    place = [numbers.get(np.array(a.of(own)).tobytes()) for a in plan.asked]
    for row, asked, number in zip(rows, plan.asked, place, strict=True):
        row |= {"design": number, "stage": asked.stage}
    designs = design_rows(plan, loop)
    names = [v.name for v in plan.design_study.variables]
    fields = [*DESIGN_FIELDS[:3], *((n, REAL) for n in names), *DESIGN_FIELDS[3:]]
    _write(store, DESIGNS, designs, fields)
    margins = [
        {"point_id": r["point_id"], "design": r["design"], **m} for r in rows for m in r["modes"]
    ]
    _write(store, MARGINS, margins, [("point_id", TEXT), ("design", WHOLE), *MODE_FIELDS])
    slopes = [
        {"point_id": r["point_id"], "mode": m["mode"], **s}
        for r in rows
        for m in r["modes"]
        for s in m["slopes"]
    ]
    _write(store, SLOPES, slopes, [("point_id", TEXT), ("mode", WHOLE), *SLOPE_FIELDS])
    checks = [
        {
            "round": c.round,
            "design": numbers[c.design.tobytes()],
            "check": c.kind,
            "passed": c.passed,
            "n_points": len(c.asks),
            "value": c.value,
            "text": c.text,
        }
        for c in loop.state.checks
    ]
    _write(store, PROOF, checks, PROOF_FIELDS)
    told = facts(plan, loop, designs)
    variants = variant_rows(plan, store, told)
    _write(store, VARIANTS, variants, VARIANT_FIELDS)
    told["choice"] = choice(variants)
    found = tabled(rows, (*OWN_FIELDS, *SUMMARY_FIELDS, *WORKING_POINT_FIELDS))
    return write_points(plan, store, found), {"design_study": told}


def _write(store: Store, name: str, rows: Sequence[Mapping[str, Any]], fields: Fields) -> None:
    schema = with_dtypes(pa.schema(list(fields)))
    store.write_table(name, pa.Table.from_pylist(list(rows), schema=schema))


def design_rows(plan: DesignPlan, loop: Loop) -> list[dict[str, Any]]:
    """A row a design that was evaluated, in the order in which designs were asked for.

    ``margin`` is by how much damping ratios exceed what was asked at the end, least over the
    operating points at which the design was solved; ``meets`` is missing where these are too few.
    """
    study, state = plan.design_study, loop.state
    chosen = None if state.chosen is None else state.chosen.tobytes()
    ids = dict(zip(plan.asked, plan.tasks.ids.astype(str).tolist(), strict=True))
    rows: list[dict[str, Any]] = []
    for key, design in state.designs.items():
        role, number = state.roles[key]
        asked = [loop.ask(p, design) for p in range(len(state.points))]
        known = [(p, loop.rows[a]) for p, a in enumerate(asked) if a in loop.rows]
        ok = [(p, r) for p, r in known if r["status"] == "ok"]
        worst = _least(ok)
        judged = loop.judged(design, [p for p, _ in known], False)
        margin = np.nan if judged is None else judged.worst
        everywhere = {p for p, _ in known} >= set(state.view)
        z = loop.change(design)
        rows.append(
            {
                "design": len(rows),
                "role": role,
                "round": number,
                **dict(zip((v.name for v in study.variables), map(float, design), strict=True)),
                "cost": loop.box.price(z),
                "n_points": len(known),
                "n_failed": sum(r["status"] != "ok" for _, r in known),
                "n_unstable": sum(r["n_unstable"] > 0 for _, r in ok),
                "min_damping_ratio": np.nan if worst is None else worst[1]["min_damping_ratio"],
                "frequency_hz": np.nan if worst is None else worst[1]["frequency_hz"],
                "main_component": "" if worst is None else worst[1]["main_component"],
                "worst_point": "" if worst is None else ids.get(loop.ask(worst[0], design), ""),
                "margin": margin,
                "meets": False if margin < 0 or len(ok) < len(known) else everywhere or None,
                "chosen": key == chosen,
            }
        )
    return rows


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
        "verdict": sentence(plan, loop, designs),
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
        "n_reductions": len(plan.structures) if has_mesh(plan.study) else 0,
    }


def changed(loop: Loop, design: np.ndarray) -> list[dict[str, Any]]:
    """Every variable that a design changes: from what to what, and whether to its bound."""
    z, study = loop.change(design), loop.study
    units = {p.name: p.unit for p in study.model.parameters}
    return [
        {
            "parameter": v.name,
            "from": v.nominal,
            "to": float(value),
            "unit": units.get(v.name, ""),
            "at_bound": bool(min(z[k] - loop.box.low[k], loop.box.high[k] - z[k]) < ENDS),
        }
        for k, (v, value) in enumerate(zip(study.variables, design, strict=True))
        if abs(z[k]) > ENDS
    ]


def change_text(changes: Sequence[Mapping[str, Any]]) -> str:
    """Changes in words: ``k1 1.31e+06 -> 1.2e+06 N/m``."""
    parts = [
        f"{c['parameter']} {c['from']:.5g} -> {c['to']:.5g}{' ' + c['unit'] if c['unit'] else ''}"
        for c in changes
    ]
    return ", ".join(parts)


def _where(plan: DesignPlan, loop: Loop, p: int) -> str:
    """An operating point in words."""
    study = plan.design_study
    units = {q.name: q.unit for q in study.model.parameters}
    point = loop.state.points[p]
    return ", ".join(
        setting(s.name, float(v), units.get(s.name, ""), abs(float(v)) or 1.0)
        for s, v in zip(study.sweeps[: study.n_operating], point, strict=True)
    )


def _worst(loop: Loop, design: np.ndarray) -> Solved | None:
    """Where a design has the least damping ratio, of the points at which it was solved."""
    asked = ((p, loop.ask(p, design)) for p in range(len(loop.state.points)))
    known = [(p, loop.rows[a]) for p, a in asked if a in loop.rows]
    return _least([(p, r) for p, r in known if r["status"] == "ok"])


def _least(found: Sequence[Solved]) -> Solved | None:
    """The point of least damping among those that have a mode in the band."""
    some = [item for item in found if np.isfinite(item[1]["min_damping_ratio"])]
    return min(some, key=lambda item: item[1]["min_damping_ratio"], default=None)


def _mode_text(plan: DesignPlan, loop: Loop, design: np.ndarray) -> str:
    """The mode of least damping of a design, with its place."""
    found = _worst(loop, design)
    if found is None:
        return "no mode in the band where it was solved"
    p, row = found
    where = _where(plan, loop, p)
    hz, zeta = row["frequency_hz"], row["min_damping_ratio"]
    if hz == 0.0:
        return f"steady sliding diverges without oscillation{' at ' + where if where else ''}"
    text = f"least damping ratio {zeta:.4g}, mode at {hz:.5g} Hz ({row['main_component']})"
    return f"{text}{' at ' + where if where else ''}"


def _today(loop: Loop) -> str:
    """How often today's design squeals."""
    state, today = loop.state, loop.study.nominal
    rows = [loop.rows[loop.ask(p, today)] for p in range(state.n_matrix)]
    unstable = sum(r["status"] == "ok" and r["n_unstable"] > 0 for r in rows)
    failed = sum(r["status"] != "ok" for r in rows)
    text = f"Today's design has an unstable mode at {unstable} of {state.n_matrix} operating points"
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
        "scatter": "scatter",
    }
    parts = []
    for kind, word in words.items():
        if kind not in last:
            continue
        check = last[kind]
        passed = {True: "", False: "FAILED, ", None: "undecided, "}[check.passed]
        parts.append(f"{word}: {passed}{check.text}")
    asked = ["limit_cycles", *(["full_order"] if loop.reduced else [])]
    missing = [words[k] for k in asked if k not in last]
    none = f"; not checked: {', '.join(missing)}" if missing else ""
    return "; ".join(parts) + none


def sentence(plan: DesignPlan, loop: Loop, designs: Sequence[Mapping[str, Any]]) -> str:
    """The verdict."""
    state, goal = loop.state, plan.design_study.goal
    today = _today(loop)
    assert state.chosen is not None
    chosen, margin = state.chosen, goal.margin.damping_ratio
    mode = _mode_text(plan, loop, chosen)
    if state.outcome == NOTHING:
        return f"{today}: {mode}. Nothing may change: the file has no [[variable]]."
    changes = changed(loop, chosen)
    price = loop.box.price(loop.change(chosen))
    change = change_text(changes) or "no change"
    searched = f"{plural(len(designs), 'design')} evaluated"
    if state.outcome in (*PROVEN, UNDECIDED):
        text = f"at a cost of {price:.4g} ({change}) every operating point meets the margin"
        text = text if changes else "it meets the margin as it is"
        proof = "Proof" if state.outcome in PROVEN else "Not all of the proof could be told"
        return f"{today}; {text} of {margin:g}: {mode}. {proof}: {_proof(loop)}. {searched}."
    if state.outcome == NONE_FOUND:
        nearest = change_text(changes) or "today's design"
        bound = [c["parameter"] for c in changes if c["at_bound"]]
        binds = f"; at their bounds: {', '.join(bound)}" if bound else "; no variable at a bound"
        kicks = f" with {len(state.extras)} demands of the proof" if state.extras else ""
        return (
            f"{today}; no design within the bounds was found that meets the margin of "
            f"{margin:g}{kicks}. Nearest comes {nearest}: {mode}{binds}. {searched}."
        )
    why = "the limit of designs was reached" if state.outcome == STOPPED else "no proof succeeded"
    assert state.outcome in (STOPPED, UNPROVEN)
    return (
        f"{today}; {why}: the last candidate, at a cost of {price:.4g} ({change}), is not proven: "
        f"{mode}. Checks: {_proof(loop)}. {searched}."
    )
