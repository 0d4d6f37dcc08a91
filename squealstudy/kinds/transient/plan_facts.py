"""What design points of a study in time share: start state, training designs, slowest speed.

A run starts from steady sliding, from the final state of an earlier run or from a limit cycle. The
automatic speed at which friction saturates is the same at all design points of a study.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.cycles.harmonics import series_at
from squealstudy.engine.cycle_states import stored_cycle
from squealstudy.engine.final_states import read_state, state_names
from squealstudy.engine.keys import source_hash
from squealstudy.engine.manifest_file import read_manifest
from squealstudy.engine.model_kind import Columns
from squealstudy.engine.plan import Plan
from squealstudy.engine.store import POINTS, Store
from squealstudy.errors import ResultsError
from squealstudy.kinds.transient.schedules import schedules_of
from squealstudy.kinds.transient.section import STUCK, TransientSection
from squealstudy.mechanics.regularisation import is_automatic
from squealstudy.models.operating import (
    REGULARISATION_SHARE,
    REGULARISATION_SPEED,
    SLIDING_SPEED,
    SLOPE,
)
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint
from squealstudy.study.sampling import design_points
from squealstudy.study.source import SourceText

NO_MOTION = {"batch", "start", "start_point", "slope_pilot"}  # keys that change no run
MOST_TRAINING = 4  # design points of the training runs
TRANSIENT_SOURCES = ("kinds/transient",)  # code of which `motion_identity` has the hash
PLAN_CACHE_SIZE = 4  # plans whose facts are kept
KEY = ("transient", "start")
POINT_KEY = ("transient", "start_point")


def motion_identity(plan: Plan) -> list[Any]:
    """All that the motion of a design point depends on, beside its parameters."""
    section, start = plan.study.section, start_of(plan)
    trained = training_designs(plan) if section.pod_vectors else ()
    return [
        section.model_dump(mode="json", exclude=NO_MOTION),
        (start is None and section.start != STUCK) or "perturbation" in section.model_fields_set,
        (STUCK if section.start == STUCK else "") if start is None else start.point_id,
        plan.study.definition.modes.stability_tolerance,
        [sorted(d.values.items()) for d in trained],
        source_hash(TRANSIENT_SOURCES),
        repr(schedules_of(plan)),
        *filter(None, [section.integrator.outside_source()]),
    ]


def training_designs(plan: Plan) -> tuple[DesignPoint, ...]:
    """Designs of the training runs: the nominal one, and some of those at ends of the sweeps."""
    chosen = {int(f(column)) for column in plan.coordinates.T for f in (np.argmin, np.argmax)}
    nominal = plan.design(plan.nominal_values)
    ends = (plan.tasks.without_names(i) for i in sorted(chosen))
    return (nominal, *(d for d in ends if d.values != nominal.values))[:MOST_TRAINING]


def slowest_speed(study: ResolvedStudy) -> float:
    """Slowest sliding speed of the design points of a study, m/s."""
    for k, sweep in enumerate(study.sweeps):
        if sweep.name == SLIDING_SPEED.name:
            return float(np.abs(design_points(study)[:, k]).min())
    return abs(study.values[SLIDING_SPEED.name])


def regularised(design: DesignPoint) -> bool:
    """Whether the slope of friction follows from a regularisation speed; else the file gives it."""
    return design.values[SLOPE.name] == 0


@lru_cache(maxsize=PLAN_CACHE_SIZE)
def regularisation_of(plan: Plan) -> dict[str, Any] | None:
    """Speeds from which slopes of friction follow, for manifest and screens.

    None where the file gives the slope of every design point.

    Returns
    -------
    dict
        ``speed``, ``speed_highest``: least and largest regularisation speed in use, m/s;
        ``slowest_sliding_speed``, m/s, and the ``share`` of it that is the automatic speed;
        ``points``: number of design points whose slope follows from such a speed; ``automatic``:
        number of those with the automatic speed.
    """
    study, points = plan.study, plan.tasks
    speeds = points.column(REGULARISATION_SPEED.name)[points.column(SLOPE.name) == 0]
    if not len(speeds):
        return None
    columns: Columns = {
        **study.values,
        **{s.name: plan.swept[:, k] for k, s in enumerate(study.sweeps)},
    }
    return {
        "speed": float(speeds.min()),
        "speed_highest": float(speeds.max()),
        "slowest_sliding_speed": slowest_speed(study),
        "share": REGULARISATION_SHARE,
        "points": len(speeds),
        "automatic": int(np.broadcast_to(is_automatic(columns), len(points)).sum()),
    }


@dataclass(frozen=True, eq=False)
class StartState:
    """Final state of an earlier run, or a state on a cycle, with its design point and its model.

    `q` and `v` (n,) are deviation from steady sliding and velocity, in the coordinates of the
    `representation`: component modes, or those of the hybrid model.
    """

    point_id: str
    prepared_key: str
    representation: str
    q: np.ndarray
    v: np.ndarray

    def scaled(self, factor: float) -> StartState:
        """The state times a factor."""
        return replace(self, q=factor * self.q, v=factor * self.v)


@lru_cache(maxsize=PLAN_CACHE_SIZE)
def start_of(plan: Plan) -> StartState | None:
    """The state that a study continues; None where it starts from steady sliding or stuck.

    Raises
    ------
    StudyFileError
        Where results are missing, of another kind, or have no final state of the chosen point.
    """
    section, source = plan.study.section, plan.study.source
    if not section.continued:
        return None
    if section.start_cycle:
        return _on_cycle(section, source)
    directory = Path(section.start)
    try:
        manifest = read_manifest(directory)
    except ResultsError as error:
        raise source.error(KEY, str(error)) from None
    if manifest is None:
        raise source.error(
            KEY,
            f"expected 'working_point' or results of a transient study; there are none in "
            f"'{section.start}': run that study first",
        )
    if manifest.get("kind") != "transient":
        raise source.error(
            KEY, f"'{section.start}' holds a {manifest.get('kind')} study, which has no final state"
        )
    store = Store(directory)
    try:
        finished = _finished(store)
        states = state_names(store)
        states = {k: name for k, name in states.items() if finished is None or k in finished}
        point_id = _chosen(section, source, list(states))
        path = store.whole(states[point_id])
    except ResultsError as error:
        raise source.error(KEY, str(error)) from None
    try:
        q, v, key, representation = read_state(path, point_id)
        return StartState(point_id, key, representation, q, v).scaled(section.start_scale)
    except (OSError, ValueError) as error:
        raise source.error(KEY, f"{path} is no final state ({error})") from None


def _on_cycle(section: TransientSection, source: SourceText) -> StartState:
    """The state of a limit cycle at phase theta = 0, where cosines are 1 and sines 0."""
    directory, cycle_id = Path(section.start_cycle).parent, Path(section.start_cycle).name
    try:
        manifest = read_manifest(directory)
        if manifest is None or manifest.get("kind") != "limit_cycles":
            raise source.error(
                KEY,
                f"expected 'cycle:DIRECTORY/ID' with results of limit cycles, '{directory}' holds "
                "none",
            )
        series = stored_cycle(Store(directory), cycle_id)
    except ResultsError as error:
        raise source.error(KEY, str(error)) from None
    synthesis, slope = series_at(np.zeros(1), (len(series.Q) - 1) // 2)
    q, v = (synthesis @ series.Q)[0], series.omega * (slope @ series.Q)[0]
    name = f"{series.cycle_id} {series.omega!r}"  # tells this start from others
    state = StartState(name, series.prepared_key, section.representation, q, v)
    return state.scaled(section.start_scale)


def _finished(store: Store) -> set[str] | None:
    """Ids of the design points whose runs ended well; None while there is no table of points."""
    if not (store.directory / POINTS).is_file():
        return None
    table = store.read_table(POINTS, ["point_id", "status"]).to_pylist()
    return {row["point_id"] for row in table if row["status"] == "ok"}


def _chosen(section: TransientSection, source: SourceText, points: Sequence[str]) -> str:
    """Id of the design point whose final state the study asks for; StudyFileError if not unique."""
    point_name = section.start_point
    if not points:
        raise source.error(KEY, f"no design point of '{section.start}' has reached its end")
    if point_name is None and len(points) == 1:
        return points[0]
    if point_name is None:
        raise source.error(
            KEY,
            f"'{section.start}' has {len(points)} final states: name one by start_point, "
            f"for example '{points[0]}'",
        )
    matching = [point for point in points if point.startswith(point_name)]
    if len(matching) != 1:
        what = "is not unique" if matching else "is not finished, failed, or is unknown"
        raise source.error(POINT_KEY, f"point '{point_name}' of '{section.start}' {what}")
    return matching[0]


def check_model(start: StartState, prepared_keys: set[str], section: TransientSection) -> str:
    """Why a state does not fit the models of a study; empty where it fits."""
    if prepared_keys != {start.prepared_key}:
        return (
            f"'{section.start}' is of another model, basis, nominal point, pressure range or "
            f"version of the package (reduction {start.prepared_key}, this study has "
            f"{', '.join(sorted(prepared_keys))}): if of the same model, run that study again"
        )
    if start.representation != section.representation:
        return f"'{section.start}' is {start.representation}, this study {section.representation}"
    return ""
