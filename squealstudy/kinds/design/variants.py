"""Variants of a design study, which are studies of their own, set beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from squealstudy.engine.manifest import SIDE_STUDIES
from squealstudy.engine.manifest_file import read_manifest
from squealstudy.engine.rows import REAL, TEXT, WHOLE_NUMBER
from squealstudy.engine.store import Store
from squealstudy.kinds.design.plan import DesignPlan, first_plan
from squealstudy.kinds.design.state import PROVEN
from squealstudy.models.components.definition import FileDefinition
from squealstudy.study.definition import ResolvedStudy
from squealstudy.wording import plural

FOLDER = "variants"
AS_IN_FILE, FAILED = "as in the file", "failed"
# outcome of a variant that is proven in the band, but has more growing modes outside it than the
# file's own design
MOVED_OUT = "moved_out"
VARIANT_FIELDS = (
    ("variant", TEXT),
    ("model", TEXT),
    ("outcome", TEXT),
    ("n_operating_points", WHOLE_NUMBER),
    ("n_unstable", WHOLE_NUMBER),
    ("today_damping_ratio", REAL),
    ("min_damping_ratio", REAL),
    ("frequency_hz", REAL),
    ("change", TEXT),
    ("change_cost", REAL),
    ("cost", REAL),
    ("n_designs", WHOLE_NUMBER),
    ("folder", TEXT),
    ("text", TEXT),
)
OF_FACTS = (  # columns that are facts of a study under the same names
    "outcome",
    "n_operating_points",
    "n_unstable",
    "today_damping_ratio",
    "min_damping_ratio",
    "frequency_hz",
    "change",
    "n_designs",
)


def plans(plan: DesignPlan) -> dict[str, DesignPlan]:
    """Plan of each variant, by the folder of its results."""
    return {
        f"{FOLDER}/{alternative.name}": first_plan(alternative.study)
        for alternative in plan.design_study.alternatives
    }


def variant_rows(plan: DesignPlan, store: Store, facts: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One row for the file's own design and for every variant; empty without variants."""
    study = plan.design_study
    if not study.alternatives:
        return []
    rows = [_row(AS_IN_FILE, study, 0.0, "", facts, "")]
    reasons = (read_manifest(store.directory) or {}).get(SIDE_STUDIES, {})
    for alternative in study.alternatives:
        folder = f"{FOLDER}/{alternative.name}"
        manifest = {} if reasons.get(folder) else read_manifest(store.directory / folder) or {}
        variant_facts = manifest.get("design_study")
        row = _row(
            alternative.name,
            alternative.study,
            alternative.cost,
            folder,
            variant_facts,
            str(reasons.get(folder, "")),
        )
        if variant_facts and row["outcome"] in PROVEN:
            outside = zip(variant_facts["beside"], facts["today_beside"], strict=True)
            if any(n > today for n, today in outside):  # modes that grow beside the band
                row["outcome"] = MOVED_OUT
        rows.append(row)
    return rows


def _row(
    name: str,
    study: ResolvedStudy,
    cost: float,
    folder: str,
    facts: Mapping[str, Any] | None,
    reason: str,
) -> dict[str, Any]:
    """Row of the table of alternatives, for one alternative."""
    model = study.model
    head = {
        "variant": name,
        "model": study.definition.model.file if isinstance(model, FileDefinition) else model.name,
        "folder": folder,
    }
    if facts is None:
        none = dict.fromkeys(name for name, _ in VARIANT_FIELDS)
        cells = {"outcome": FAILED, "change": "", "text": reason or "it has no results"}
        return {**none, **head, **cells}
    change_cost = facts["cost"]
    return {
        **head,
        **{key: facts[key] for key in OF_FACTS},
        "change_cost": change_cost,
        "cost": None if change_cost is None else cost + change_cost,
        "text": facts["verdict"],
    }


def cheapest(rows: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Cheapest variant whose proof succeeded, the first of several."""
    proven = [r for r in rows if r["outcome"] in PROVEN]
    return min(proven, key=lambda r: r["cost"], default=None)


def choice(rows: Sequence[Mapping[str, Any]]) -> str:
    """A sentence on the alternative that costs least; empty without variants."""
    if not rows:
        return ""
    best = cheapest(rows)
    proven = sum(r["outcome"] in PROVEN for r in rows)
    counted = (
        f"{proven} of {plural(len(rows), 'alternative')} {'is' if proven == 1 else 'are'} proven"
    )
    if best is None:
        return f"Neither the file's own design nor a variant can be chosen: {counted}."
    name = "the file's own design" if best["variant"] == AS_IN_FILE else f"'{best['variant']}'"
    how = best["change"] or "no change"
    unlooked = "" if best["outcome"] == PROVEN[0] else ", large motions not looked at"
    zeta = best["min_damping_ratio"]
    damped = "no mode in the band" if np.isnan(zeta) else f"least damping {100 * zeta:.3g} %"
    cheapest_text = f"Cheapest: {name} ({how}), cost {best['cost']:.4g}, {damped}."
    return f"{cheapest_text} {counted[:1].upper()}{counted[1:]}{unlooked}."
