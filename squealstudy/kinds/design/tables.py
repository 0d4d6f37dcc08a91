"""Tables of a design study: points, designs, margins, slopes, proof, variants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from squealstudy.engine.rows import (
    FLAG,
    REAL,
    TEXT,
    WHOLE_NUMBER,
    WORKING_POINT_FIELDS,
    Fields,
    planned_rows,
    tabled,
    with_dtypes,
)
from squealstudy.engine.store import DESIGNS, MARGINS, PROOF, SLOPES, VARIANTS, Store
from squealstudy.engine.validity import write_points
from squealstudy.kinds.design.design_search import DesignSearch
from squealstudy.kinds.design.plan import DesignPlan, operating_points
from squealstudy.kinds.design.rows import MODE_FIELDS, SCHEMA, SLOPE_FIELDS, SUMMARY_FIELDS
from squealstudy.kinds.design.variants import VARIANT_FIELDS, choice, variant_rows
from squealstudy.kinds.design.verdict import beyond_validity, facts, least_damped, unstable_share

if TYPE_CHECKING:
    import pandas as pd

OWN_FIELDS = (("design", WHOLE_NUMBER), ("analysis", TEXT), ("occurrence", REAL))
DESIGN_FIELDS = (
    ("design", WHOLE_NUMBER),
    ("origin", TEXT),
    ("round", WHOLE_NUMBER),
    ("cost", REAL),
    ("n_points", WHOLE_NUMBER),
    ("n_failed", WHOLE_NUMBER),
    ("n_unstable", WHOLE_NUMBER),
    ("unstable_share", REAL),
    ("min_damping_ratio", REAL),
    ("frequency_hz", REAL),
    ("main_component", TEXT),
    ("worst_point", TEXT),
    ("margin", REAL),
    ("meets_margin", FLAG),
    ("chosen", FLAG),
)
PROOF_FIELDS = (
    ("round", WHOLE_NUMBER),
    ("design", WHOLE_NUMBER),
    ("check", TEXT),
    ("passed", FLAG),
    ("n_points", WHOLE_NUMBER),
    ("value", REAL),
    ("text", TEXT),
)


def build_tables(
    plan: DesignPlan, store: Store, search: DesignSearch
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Write the six tables; returns that of the points, and the verdict for the manifest."""
    rows = planned_rows(plan, store, SCHEMA)
    numbers = {key: n for n, key in enumerate(search.state.designs)}
    start = plan.design_study.n_operating
    variable_columns = slice(start, start + len(plan.design_study.variables))
    design_numbers = [
        numbers.get(np.array(a.of(variable_columns)).tobytes()) for a in plan.evaluations
    ]
    shares = _shares(plan)
    for row, evaluation, number in zip(rows, plan.evaluations, design_numbers, strict=True):
        share = shares.get(evaluation.of(slice(start)), np.nan)
        row |= {"design": number, "analysis": evaluation.analysis, "occurrence": share}
    designs = design_rows(plan, search)
    names = [v.name for v in plan.design_study.variables]
    fields = [*DESIGN_FIELDS[:3], *((n, REAL) for n in names), *DESIGN_FIELDS[3:]]
    _write(store, DESIGNS, designs, fields)
    margins = [
        {"point_id": r["point_id"], "design": r["design"], **m} for r in rows for m in r["modes"]
    ]
    _write(store, MARGINS, margins, [("point_id", TEXT), ("design", WHOLE_NUMBER), *MODE_FIELDS])
    slopes = [
        {"point_id": r["point_id"], "mode": m["mode"], **s}
        for r in rows
        for m in r["modes"]
        for s in m["slopes"]
    ]
    _write(store, SLOPES, slopes, [("point_id", TEXT), ("mode", WHOLE_NUMBER), *SLOPE_FIELDS])
    checks = [
        {
            "round": c.round,
            "design": numbers[c.design.tobytes()],
            "check": c.kind,
            "passed": c.passed,
            "n_points": len(c.evaluations),
            "value": c.value,
            "text": c.text,
        }
        for c in search.state.checks
    ]
    _write(store, PROOF, checks, PROOF_FIELDS)
    verdict_facts = facts(plan, search, designs)
    variants = variant_rows(plan, store, verdict_facts)
    _write(store, VARIANTS, variants, VARIANT_FIELDS)
    verdict_facts["choice"] = choice(variants)
    point_table = tabled(rows, (*OWN_FIELDS, *SUMMARY_FIELDS, *WORKING_POINT_FIELDS))
    points = write_points(plan, store, point_table)
    verdict_facts["verdict"] += beyond_validity(points, verdict_facts["chosen"])
    return points, {"design_study": verdict_facts}


def _shares(plan: DesignPlan) -> dict[tuple[float, ...], float]:
    """Occurrence of each operating point of the matrix, by its values."""
    study = plan.design_study
    points = map(tuple, operating_points(study).astype(float).tolist())
    return dict(zip(points, study.occurrence.tolist(), strict=True))


def _write(store: Store, name: str, rows: Sequence[Mapping[str, Any]], fields: Fields) -> None:
    schema = with_dtypes(pa.schema(list(fields)))
    store.write_table(name, pa.Table.from_pylist(list(rows), schema=schema))


def design_rows(plan: DesignPlan, search: DesignSearch) -> list[dict[str, Any]]:
    """One row for each design that was evaluated, in the order in which designs were needed.

    ``margin`` is the least excess of damping ratios over the final demands, at the operating points
    at which the design was solved. ``meets_margin`` is missing where these points are too few.
    """
    study, state = plan.design_study, search.state
    chosen = None if state.chosen is None else state.chosen.tobytes()
    ids = dict(zip(plan.evaluations, plan.tasks.ids.astype(str).tolist(), strict=True))
    rows: list[dict[str, Any]] = []
    for key, design in state.designs.items():
        role, number = state.roles[key]
        finished_at = {p: search.finished_modes(p, design) for p in range(len(state.points))}
        evaluation_at = {
            p: finished[0] for p, finished in finished_at.items() if finished is not None
        }
        solved_rows = [(p, search.rows[a]) for p, a in evaluation_at.items()]
        ok = [(p, r) for p, r in solved_rows if r["status"] == "ok"]
        worst = least_damped(ok)
        constraints = search.constraints(design, [p for p, _ in solved_rows], None)
        margin = np.nan if constraints is None else constraints.worst
        everywhere = {p for p, _ in solved_rows} >= set(state.active_points)
        z = search.change(design)
        rows.append(
            {
                "design": len(rows),
                "origin": role,
                "round": number,
                **dict(zip((v.name for v in study.variables), map(float, design), strict=True)),
                "cost": search.box.price(z),
                "n_points": len(solved_rows),
                "n_failed": sum(r["status"] != "ok" for _, r in solved_rows),
                "n_unstable": sum(r["n_unstable"] > 0 for _, r in ok),
                "unstable_share": unstable_share(search, dict(ok)),
                "min_damping_ratio": np.nan if worst is None else worst[1]["min_damping_ratio"],
                "frequency_hz": np.nan if worst is None else worst[1]["frequency_hz"],
                "main_component": "" if worst is None else worst[1]["main_component"],
                "worst_point": "" if worst is None else ids.get(evaluation_at[worst[0]], ""),
                "margin": margin,
                "meets_margin": False
                if margin < 0 or len(ok) < len(solved_rows)
                else everywhere or None,
                "chosen": key == chosen,
            }
        )
    return rows
