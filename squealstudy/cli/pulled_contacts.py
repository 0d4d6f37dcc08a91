"""Names of the contacts that are in tension in steady sliding."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from squealstudy.engine.cache import is_prepared, prepared_model
from squealstudy.engine.plan import Plan
from squealstudy.mechanics.failures import FAILURES
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.prepared import mean_contact_stiffness
from squealstudy.reduction.working_point import OPEN, working_point
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint
from squealstudy.tables.validity import pulling_rows

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.face import Study


def pulled_contacts(study: Study, points: pd.DataFrame) -> list[str]:
    """Names of contacts in tension at the first design point of a table where there are any.

    Empty if the model has a single contact, or contacts without names, and if the working point
    cannot be computed here.
    """
    rows = pulling_rows(points)
    if not len(rows) or not isinstance(study.resolved, ResolvedStudy):
        return []
    plan = cast("Plan", study.plan())
    of_point = np.flatnonzero(plan.tasks.ids.astype(str) == str(points["point_id"].iloc[rows[0]]))
    if not len(of_point):  # a point between those of the study
        return []
    try:
        return _pulled(plan.tasks[int(of_point[0])])
    except FAILURES:  # workers may start from another point's steady sliding, and so succeed
        return []


def _pulled(design: DesignPoint) -> list[str]:
    """Names at one design point."""
    assembly, operating = design.assembly(), design.operating_point()
    names = assembly.contact.pairs
    if len(set(names[: len(names) - len(assembly.contact.spring_points)])) < 2:
        return []
    if is_prepared(design.structure):
        space = prepared_model(design.structure).space
    else:
        stiffness = mean_contact_stiffness(assembly, operating)
        space = contact_space(assembly, stiffness, np.zeros((assembly.n_dof, 0)))
    point = working_point(space, operating)
    pressure, area = point.contact_pressure[point.touching], space.area[point.touching]
    mean = float(area @ pressure / area.sum())
    return list(dict.fromkeys(names[i] for i in np.flatnonzero(pressure < OPEN * mean).tolist()))
