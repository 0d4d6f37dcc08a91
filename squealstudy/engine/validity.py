"""Whether the assumptions hold at a design point whose results are there, and which one does not.

A point is invalid where a dimensionless group is beyond what a model or a method takes for granted
(`models.parameter.Assumption`, and the rules here). Its results are still those of the equations:
they say little of a brake. Reasons read ``rule: value``.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from squealstudy.engine.cache import is_prepared, prepared_model
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import FLAG, TEXT, Fields, points_table
from squealstudy.engine.store import POINTS, Store
from squealstudy.laws import CONTACT_LAWS
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.operating import LARGEST_MODAL_DAMPING
from squealstudy.reduction.prepared import natural_frequencies
from squealstudy.study.design import DesignPoint
from squealstudy.tables.validity import BETWEEN

if TYPE_CHECKING:
    import pandas as pd

FIELDS = (("valid", FLAG), ("invalid_reason", TEXT))  # last columns of a points table
SOLVED = ("ok", "inaccurate")  # statuses of points that have results
MOSTLY_OPEN = 0.5  # share of the contact area
FAR_KICK = 10.0  # times the sliding speed
CRITICAL = 1.0  # damping ratio from which on a mode does not oscillate
CLOSED_RULE = "a bilateral contact presses everywhere, share of it below 1 % of the mean pressure"
OPEN_RULE = f"the contact is closed over {1 - MOSTLY_OPEN:.0%} of its area or more, open share"
MODE_RULE = f"modal damping is light, a ratio of at most {LARGEST_MODAL_DAMPING:g}"
COMPONENT_RULE = "component modes are damped below critical"
OSCILLATES_RULE = "modes of the band are damped below critical, damping ratio"
KICK_RULE = (
    f"the disturbance is at most {FAR_KICK:g} times the sliding speed, or the motion begins far "
    "from steady sliding"
)


def parameter_reasons(plan: Plan) -> list[list[str]]:
    """Assumptions that the parameters of each design point break, known before it is solved."""
    critical = _damped_modes(plan)
    return [[*_broken(design), *critical[i]] for i, design in enumerate(plan.tasks)]


def with_validity(plan: Plan, points: pd.DataFrame) -> pd.DataFrame:
    """The points table with the columns FIELDS last.

    ``valid`` is a nullable boolean, missing where the point has no results; ``invalid_reason`` has
    what does not hold, reasons a worker found (a column of that name) included.

    Parameters
    ----------
    plan : Plan
    points : DataFrame
        A row for each of its design points, in order.
    """
    import pandas as pd

    solved = points["status"].isin(SOLVED).to_numpy(bool)
    found = points.get("invalid_reason", pd.Series("", index=points.index))
    reasons = []
    for i, (known, row) in enumerate(
        zip(parameter_reasons(plan), points.to_dict("records"), strict=True)
    ):
        own = [text for text in (found.iloc[i], *known, *_of_the_point(plan.tasks[i], row)) if text]
        reasons.append(BETWEEN.join(own) if solved[i] else "")
    valid = pd.array([not reason for reason in reasons], dtype="boolean")
    valid[~solved] = pd.NA
    return points.drop(columns="invalid_reason", errors="ignore").assign(
        valid=valid, invalid_reason=reasons
    )


def write_points(
    plan: Plan, store: Store, rows: Sequence[Mapping[str, Any]], fields: Fields
) -> pd.DataFrame:
    """Write the points table of chunk rows, with its validity; the table.

    Parameters
    ----------
    plan : Plan
    store : Store
        Of the results.
    rows : sequence of mapping
        A row for each of its design points, in order.
    fields : sequence of (str, DataType)
        Columns after those of every points table (`points_table`).
    """
    table = points_table(plan, rows, fields)
    known = [field for field in table.schema if field.name not in dict(FIELDS)]
    schema = pa.schema([*known, *FIELDS])
    frame = with_validity(plan, table.to_pandas())
    table = pa.Table.from_pandas(frame, schema=schema, preserve_index=False)
    store.write_table(POINTS, table)
    points: pd.DataFrame = table.to_pandas()
    return points


def open_reason(law_kind: str, share: float) -> str:
    """What a working point breaks whose contact is open over a share of its area, or nothing."""
    pulls = CONTACT_LAWS[law_kind].pulls
    rule, most = (CLOSED_RULE, 0.0) if pulls else (OPEN_RULE, MOSTLY_OPEN)
    return f"{rule}: {share:.3g}" if share > most else ""


def _broken(design: DesignPoint) -> list[str]:
    given: Mapping[str, float] = design.values  # noqa: PD011 - no data frame
    texts = [a.broken(given) for a in design.model.assumptions]
    for rule, most, parameters in (
        (MODE_RULE, LARGEST_MODAL_DAMPING, design.assembly_parameters()),
        (COMPONENT_RULE, np.nextafter(CRITICAL, 0.0), design.mode_parameters()),
    ):
        damped = [given[p.name] for p in parameters if p.quantity == "damping_ratio"]
        if max(damped, default=0.0) > most:
            texts.append(f"{rule}: {max(damped):.4g}")
    return [text for text in texts if text]


def _of_the_point(design: DesignPoint, row: Mapping[Hashable, object]) -> list[str]:
    """What the findings of a point break."""
    if isinstance(design.model, FamilyDefinition):
        return []
    texts = []
    if "class" not in row:  # at the working point; in time its worker has told
        texts.append(open_reason(design.law_kind, _number(row, "open_share")))
    elif CONTACT_LAWS[design.law_kind].pulls:
        texts.append(open_reason(design.law_kind, _number(row, "open_share_max")))
    kick = _number(row, "perturbation") / design.operating_point().sliding_speed
    texts += [f"{KICK_RULE}: {kick:.4g}"] if kick > FAR_KICK else []
    return texts


def _number(row: Mapping[Hashable, object], name: str) -> float:
    value = row.get(name)
    return float(value) if isinstance(value, int | float) else np.nan


def _damped_modes(plan: Plan) -> list[list[str]]:
    """A reason where a real mode of the band does not oscillate, for each design point.

    Damping that is proportional to stiffness rises with frequency: real modes are those of the
    structure's nominal working point.
    """
    if isinstance(plan.study.model, FamilyDefinition):
        return [[] for _ in plan.tasks]
    low, high = plan.band_hz
    highest: dict[str, float] = {}
    reasons: list[list[str]] = []
    for task in plan.tasks:
        state = task.state()
        zeta, beta = state.damping_ratio, state.stiffness_damping
        key = task.structure
        if zeta + np.pi * beta * high < CRITICAL or not is_prepared(key):
            reasons.append([])
            continue
        if key not in highest:
            hz = natural_frequencies(prepared_model(key), plan.nominal)
            highest[key] = float(hz[(hz >= low) & (hz <= high)].max(initial=0.0))
        ratio = zeta + np.pi * beta * highest[key]
        critical = highest[key] > 0 and ratio >= CRITICAL
        reasons.append([f"{OSCILLATES_RULE}: {ratio:.4g}"] if critical else [])
    return reasons
