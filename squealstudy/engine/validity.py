"""Whether the assumptions of model and method hold at a solved design point, or which do not.

A point is invalid where a dimensionless group is beyond what a model or a method assumes
(`models.parameter.Assumption`, and the rules here). Its results still solve the equations, but say
little of a brake. Reasons read ``rule: value``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from squealstudy.engine.cache import is_prepared, prepared_model
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import FLAG, TEXT, points_table, with_dtypes
from squealstudy.engine.store import POINTS, Store
from squealstudy.laws import CONTACT_LAWS
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.operating import LARGEST_MODAL_DAMPING
from squealstudy.models.parameter_names import DAMPING_RATIO
from squealstudy.reduction.prepared import natural_frequencies
from squealstudy.stacked.modes import natural_frequencies as natural_frequencies_of_batch
from squealstudy.tables.validity import BETWEEN, CLOSED_RULE, MIN_CLOSED_SHARE, OPEN_RULE

if TYPE_CHECKING:
    import pandas as pd

FIELDS = (("valid", FLAG), ("invalid_reason", TEXT))  # last columns of a points table
# columns of a points table from which validity follows
VALIDITY_INPUTS = (
    "status",
    "class",
    "open_share",
    "open_share_max",
    "perturbation",
    "invalid_reason",
)
SOLVED = ("ok", "inaccurate")  # statuses of points that have results
ALL_OPEN_SHARE = 1.0 - 1e-9  # open share of the contact area that is 1 but for round-off
FAR_KICK = 10.0  # largest start velocity over the sliding speed of a valid kick
TABLE_END_SLACK = (
    1e-9  # share of a table's range: points on its ends, but for round-off, are within
)
CRITICAL_DAMPING_RATIO = 1.0  # a mode with this damping ratio or more does not oscillate
MODE_RULE = f"modal damping is light, a ratio of at most {LARGEST_MODAL_DAMPING:g}"
COMPONENT_RULE = "component modes are damped below critical"
OSCILLATES_RULE = "modes of the band are damped below critical, damping ratio"
KICK_RULE = (
    f"the disturbance is at most {FAR_KICK:g} times the sliding speed, or the motion begins far "
    "from steady sliding"
)


@dataclass(frozen=True, eq=False)
class BrokenRule:
    """An assumption, and the design points that break it.

    Attributes
    ----------
    rule : str
        The assumption, in words.
    rows : ndarray (m,)
        Rows of the m design points among all, ascending.
    values : ndarray (m,)
        The number that is beyond its bound, at each of these points.
    """

    rule: str
    rows: np.ndarray
    values: np.ndarray

    def texts(self) -> Iterator[tuple[int, str]]:
        """Yield the row and the reason of each design point."""
        for row, number in zip(self.rows.tolist(), self.values.tolist(), strict=True):
            yield row, f"{self.rule}: {number:.4g}"


def parameter_reasons(plan: Plan) -> list[BrokenRule]:
    """Assumptions that parameters of design points break, before any is solved.

    In the order in which a point's reasons list them, without those that no point breaks.
    """
    points = plan.tasks
    columns, count = points.columns, len(points)
    broken_rules = [
        _beyond_limit(a.rule, a.values(columns, count), a.most)
        for a in plan.study.model.assumptions
    ]
    for rule, limit, parameters in (
        (MODE_RULE, LARGEST_MODAL_DAMPING, plan.first.assembly_parameters()),
        (
            COMPONENT_RULE,
            float(np.nextafter(CRITICAL_DAMPING_RATIO, 0.0)),
            plan.first.mode_parameters(),
        ),
    ):
        damped = [points.column(p.name) for p in parameters if p.quantity == DAMPING_RATIO]
        if damped:
            broken_rules.append(_beyond_limit(rule, np.maximum.reduce(damped), limit))
    broken_rules.append(_damped_modes(plan))
    for table in plan.study.model.tables:
        for name, knots in zip(table.over, table.at, strict=True):
            low, high = knots[0], knots[-1]
            rule = f"the table of {table.name} is over {name} from {low:g} to {high:g}, {name}"
            values, slack = points.column(name), TABLE_END_SLACK * (high - low)
            rows = np.flatnonzero(~((values >= low - slack) & (values <= high + slack)))
            broken_rules.append(BrokenRule(rule, rows, values[rows]))
    return [broken for broken in broken_rules if len(broken.rows)]


def _beyond_limit(rule: str, values: np.ndarray, limit: float) -> BrokenRule:
    rows = np.flatnonzero(~(values <= limit))
    return BrokenRule(rule, rows, values[rows])


def points_by_rule(broken_rules: Sequence[BrokenRule]) -> list[tuple[str, int]]:
    """How many design points break each rule, the most frequent first."""
    rows: dict[str, list[np.ndarray]] = {}
    for broken in broken_rules:
        rows.setdefault(broken.rule, []).append(broken.rows)
    counts = [(rule, len(np.unique(np.concatenate(row_sets)))) for rule, row_sets in rows.items()]
    return sorted(counts, key=lambda item: -item[1])


def with_validity(plan: Plan, points: pd.DataFrame) -> pd.DataFrame:
    """The points table with the columns FIELDS last.

    ``valid`` is a nullable boolean, missing where the point has no results. ``invalid_reason``
    lists the broken assumptions, first those that a worker has noted in a column of that name.

    Parameters
    ----------
    plan : Plan
    points : DataFrame
        A row for each design point of the plan, in order.
    """
    import pandas as pd

    solved = points["status"].isin(SOLVED).to_numpy(bool)
    reasons = np.full(len(points), "", dtype=object)
    for row, text in _reasons(plan, points):
        if solved[row]:
            reasons[row] += f"{BETWEEN if reasons[row] else ''}{text}"
    valid = pd.array(reasons == "", dtype="boolean")
    valid[~solved] = pd.NA
    return points.drop(columns="invalid_reason", errors="ignore").assign(
        valid=valid, invalid_reason=reasons
    )


def write_points(plan: Plan, store: Store, findings: pa.Table) -> pd.DataFrame:
    """Write the points table with its validity, and return it.

    Parameters
    ----------
    plan : Plan
    store : Store
        Files of the results.
    findings : Table
        What was computed, a row for each design point in order (`points_table`).
    """
    table = points_table(plan, findings)
    validity_inputs = table.select([name for name in VALIDITY_INPUTS if name in table.column_names])
    validity = with_validity(plan, validity_inputs.to_pandas())[[name for name, _ in FIELDS]]
    table = table.select([name for name in table.column_names if name not in dict(FIELDS)])
    for name, kind in FIELDS:
        table = table.append_column(pa.field(name, kind), pa.array(validity[name], kind))
    store.write_table(POINTS, table.cast(with_dtypes(table.schema)))
    points: pd.DataFrame = table.to_pandas()
    return points


def open_reason(law_kind: str, share: float) -> str:
    """The rule that a working point breaks whose contact is open over a share (0 to 1) of its area.

    With the share, as ``rule: share``; empty where no rule is broken.
    """
    pulls = CONTACT_LAWS[law_kind].pulls
    rule, largest_share = (CLOSED_RULE, 0.0) if pulls else (OPEN_RULE, 1.0 - MIN_CLOSED_SHARE)
    if share <= largest_share:
        return ""
    # only contact that touches nowhere reads as 1: with one facet still closed it reads as 0.999
    return f"{rule}: {1.0 if share > ALL_OPEN_SHARE else min(share, 0.999):.3g}"


def motion_reason(law_kind: str, share: float) -> str:
    """The rule that a run or cycle breaks; `share` (0 to 1) is the most of its contact ever open.

    Only laws that pull break one, because they have no open contact; the others hold for it.
    """
    return open_reason(law_kind, share) if CONTACT_LAWS[law_kind].pulls else ""


def _reasons(plan: Plan, points: pd.DataFrame) -> Iterator[tuple[int, str]]:
    """Yield rows of points with a reason: from its worker, its parameters or its results."""
    if "invalid_reason" in points:
        by_worker = points["invalid_reason"].fillna("").to_numpy(object)
        yield from ((int(row), by_worker[row]) for row in np.flatnonzero(by_worker != ""))
    for broken in parameter_reasons(plan):
        yield from broken.texts()
    if not isinstance(plan.study.model, FamilyDefinition):
        yield from _of_findings(plan, points)


def _of_findings(plan: Plan, points: pd.DataFrame) -> Iterator[tuple[int, str]]:
    """Yield rows of points with a rule that their results break."""
    kind = plan.first.law_kind
    in_time = "class" in points  # then the worker has checked steady sliding itself
    share = _numbers(points, "open_share_max" if in_time else "open_share")
    reason_of = motion_reason if in_time else open_reason
    for row in np.flatnonzero(share > 0).tolist():
        if text := reason_of(kind, share[row]):
            yield row, text
    distance = _numbers(points, "perturbation")
    for row in np.flatnonzero(np.isfinite(distance)).tolist():
        kick = distance[row] / abs(plan.tasks[row].operating_point().sliding_speed)
        if kick > FAR_KICK:
            yield row, f"{KICK_RULE}: {kick:.4g}"


def _numbers(points: pd.DataFrame, name: str) -> np.ndarray:
    """A column as numbers (n,); NaN where it has none, or where there is no such column."""
    if name not in points:
        return np.full(len(points), np.nan)
    return points[name].to_numpy(dtype=float, na_value=np.nan)


@np.errstate(over="ignore")  # an infinite ratio is beyond the limit too
def _damped_modes(plan: Plan) -> BrokenRule:
    """Points at which a real mode of the band is damped so much that it does not oscillate.

    Damping proportional to stiffness rises with frequency, so the highest mode of the band decides.
    Real modes of a reduced structure are those at the study's nominal working point.
    """
    points, (low, high) = plan.tasks, plan.band_hz
    columns = points.columns
    zeta, beta = columns.get("damping_ratio", 0.0), columns.get("stiffness_damping", 0.0)
    max_damping_ratio = np.broadcast_to(zeta + np.pi * beta * high, len(points))
    ratio = np.zeros(len(points))
    if (
        not isinstance(plan.study.model, FamilyDefinition)
        and (max_damping_ratio >= CRITICAL_DAMPING_RATIO).any()
    ):
        if plan.stacked:
            rows = np.flatnonzero(max_damping_ratio >= CRITICAL_DAMPING_RATIO)
            part = points.at(rows)
            hz = natural_frequencies_of_batch(part.model, part.options, part.columns, len(part))
            highest_hz = np.where((hz >= low) & (hz <= high), hz, 0.0).max(axis=1)
            damping_ratio = np.broadcast_to(zeta, len(points))[rows]
            with_modes = np.flatnonzero(highest_hz > 0)
            damping_ratio = (
                damping_ratio[with_modes]
                + np.pi
                * np.broadcast_to(beta, len(points))[rows[with_modes]]
                * highest_hz[with_modes]
            )
            ratio[rows[with_modes]] = damping_ratio
            return _beyond_limit(
                OSCILLATES_RULE, ratio, float(np.nextafter(CRITICAL_DAMPING_RATIO, 0.0))
            )
        for key, rows in points.of_structures():
            if not (max_damping_ratio[rows] >= CRITICAL_DAMPING_RATIO).any() or not is_prepared(
                key
            ):
                continue
            hz = natural_frequencies(prepared_model(key), plan.nominal)
            highest = float(hz[(hz >= low) & (hz <= high)].max(initial=0.0))
            if highest > 0:
                ratio[rows] = np.broadcast_to(zeta + np.pi * beta * highest, len(points))[rows]
    return _beyond_limit(OSCILLATES_RULE, ratio, float(np.nextafter(CRITICAL_DAMPING_RATIO, 0.0)))
