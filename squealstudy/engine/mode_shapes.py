"""Shapes of the modes in a results directory, expanded to all nodes of the model.

The design point is solved again by the exact method, which gives the vector and the working point;
the root must be that of the table. The basis that leads back to all nodes is not part of a reduced
model: it is made again the first time, and then kept in the cache beside that model.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import pandas as pd

from squealstudy.engine.cache import (
    is_prepared,
    is_whole,
    known_gap,
    load_prepared,
    load_value,
    prepared_path,
    save_prepared,
    save_value,
)
from squealstudy.engine.manifest import MATRICES_FOLDER
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.engine.recorded_code import execute_recorded
from squealstudy.engine.reduced import BuildTask, reduced_with_basis
from squealstudy.engine.result_names import MANIFEST
from squealstudy.engine.result_tables import ResultTables
from squealstudy.engine.structures import build_task
from squealstudy.errors import ResultsError, SquealstudyError
from squealstudy.machine.resources import cores
from squealstudy.models.assembly import Assembly
from squealstudy.models.components.definition import FileDefinition
from squealstudy.modes.full_order.modes import FULL
from squealstudy.modes.point import band_modes, state_working_point
from squealstudy.progress import Progress, progress
from squealstudy.reduction.cmt import Expansion, ReducedModel
from squealstudy.shapes.shape import Label, Shape, shape_of
from squealstudy.study.definition import read_tables
from squealstudy.study.friction_maps import recorded_map
from squealstudy.study.source import SourceText, changed
from squealstudy.system.linearise import linearise
from squealstudy.tables.other_codes import roots_of

# largest relative distance of two solutions of one root by different versions of LAPACK
SAME_ROOT_REL_DISTANCE = 1e-6
ERROR_ALLOWANCE = 3.0  # further distance allowed, in estimated errors of the table's root
# largest relative distance of a root of full order from its reduced one
FULL_ORDER_REL_DISTANCE = 2e-3
EXPANSION = "expansion"  # folder beside a prepared model


def shape(
    results: ResultTables, point: str | int | None, mode: int | None, track: int | None
) -> Shape:
    """The shape of a mode (`Results.shape`)."""
    row, numbers = chosen_modes(results, point, mode, track)
    return point_shapes(results, row).shape(numbers[0])


def chosen_modes(
    results: ResultTables,
    point: str | int | None = None,
    mode: int | None = None,
    track: int | None = None,
) -> tuple[int, list[int]]:
    """Row of a design point and numbers of its modes that oscillate, the fastest growing first.

    Parameters
    ----------
    point : str, int or None
        Point as in `Results.row_of`; None: the one at which the mode of `track`, or any mode, grows
        fastest.
    mode : int or None
        Number of the mode at `point`, which must then be given.
    track : int or None
        Number of the mode in rankings.

    Raises
    ------
    ResultsError
        Where there is no such point or mode, or the point failed.
    """
    expect_complex_modes(results)
    points, modes = results.points, results.modes
    oscillating = modes[~modes["overdamped"]]
    if mode is not None and point is None:
        raise ResultsError("modes are numbered at a design point: name it beside the mode")
    if track is not None:
        oscillating = oscillating[oscillating["track"] == track]
        if oscillating.empty:
            track_numbers = modes.loc[modes["track"] >= 0, "track"]
            which = (
                f"tracks are 0 to {track_numbers.max()}"
                if len(track_numbers)
                else "modes were not tracked"
            )
            raise ResultsError(f"{results.directory}: no mode of track {track}; {which}")
    if point is None and oscillating.empty:
        raise ResultsError(f"{results.directory}: no mode oscillates at any design point")
    if point is None:
        point = str(
            oscillating["point_id"].iloc[int(oscillating["growth_rate"].to_numpy().argmax())]
        )
    row = results.row_of(point)
    point_row = points.iloc[row]
    if point_row["status"] == "failed" or not (modes["point_id"] == point_row["point_id"]).any():
        reason = f"{point_row['status']}: {point_row['message']}"
        raise ResultsError(f"design point {row} ({point_row['point_id']}) has no modes: {reason}")
    of_point = oscillating[oscillating["point_id"] == point_row["point_id"]]
    if mode is not None:
        of_point = of_point[of_point["mode"] == mode]
    if of_point.empty:
        raise _no_mode(modes[modes["point_id"] == point_row["point_id"]], row, mode, track)
    return row, of_point.sort_values("growth_rate", ascending=False)["mode"].tolist()


def expect_complex_modes(results: ResultTables) -> None:
    """Raise ResultsError for results that have no modes with a shape."""
    if "modes" not in results.tables or "growth_rate" not in results.modes:
        raise ResultsError(
            f"{results.directory}: shapes are those of complex modes, these are results of kind "
            f"{results.kind}"
        )


def _no_mode(
    point_modes: pd.DataFrame, row: int, mode: int | None, track: int | None
) -> ResultsError:
    """Error that explains why a point with these modes does not have the one asked for."""
    chosen = point_modes[point_modes["mode"] == mode]
    if chosen["overdamped"].any():
        return ResultsError(f"mode {mode} of design point {row} is overdamped: it has no shape")
    if len(chosen):
        return ResultsError(f"mode {mode} of design point {row} is not of track {track}")
    if mode is None:
        which = "nothing that oscillates" if track is None else f"no mode of track {track}"
        return ResultsError(f"design point {row} has {which}")
    return ResultsError(f"design point {row} has no mode {mode}: it has 1 to {len(point_modes)}")


_last: dict[tuple[str, str, int], PointShapes] = {}


def point_shapes(results: ResultTables, row: int) -> PointShapes:
    """The shapes of the design point in this row; those of the last call stay in memory."""
    key = str(results.directory.resolve()), str(results.manifest.get("study_hash", "")), row
    if key not in _last:
        _last.clear()  # an assembly is large
        _last[key] = PointShapes(results, row)
    return _last[key]


class PointShapes:
    """Parts that the shapes of one design point share.

    Attributes
    ----------
    system : LinearisedModel
        The model linearised about the point's steady sliding.
    lam, psi : ndarray (m,), (n, m) complex
        Roots [rad/s] of the complex modes in the band, and their vectors.

    Raises
    ------
    ResultsError
        Where the model has no mesh, or this version cannot make the results again.
    """

    def __init__(self, results: ResultTables, row: int) -> None:
        self._results, self._row = results, row
        self._plan = plan_of(results)
        if not has_mesh(self._plan.study):
            name = self._plan.study.model.name
            raise ResultsError(
                f"{results.directory}: the model {name} has no mesh, and so no shape to show"
            )
        self._design = self._plan.tasks[row]
        with progress() as tell:
            self._expansion = expansion(self._plan, row, tell)
        state = self._design.state()
        prepared = load_prepared(self._design.structure)
        gap = known_gap(self._design.structure, self._design)
        self._point = state_working_point(prepared, state, gap)
        self.system = linearise(self._expansion.model, self._point, state)
        self.lam, self.psi, *_ = band_modes(self.system, self._point, self._plan.band_hz)
        point_id = results.points["point_id"].iloc[row]
        self._modes = results.modes[results.modes["point_id"] == point_id]

    @property
    def model(self) -> ReducedModel:
        """The reduced model, in whose coordinates `psi` is given."""
        return self._expansion.model

    @cached_property
    def _assembly(self) -> Assembly:
        return self._design.assembly()

    def shape(self, mode: int) -> Shape:
        """The shape of a mode by its number at the point; ResultsError where there is none."""
        mode_rows = self._modes[self._modes["mode"] == mode]
        if mode_rows.empty:
            raise _no_mode(self._modes, self._row, mode, None)
        i = self._partner(mode)
        track = int(mode_rows["track"].iloc[0])
        return shape_of(
            self._assembly,
            self._expansion,
            self._point,
            self.system,
            complex(self.lam[i]),
            self.psi[:, i],
            self._label(mode, track if track >= 0 else None),
        )

    def motion(self, u: np.ndarray, lam: complex, motion_name: str) -> Shape:
        """The shape of a harmonic motion u (n,) exp(lam t) that is no mode."""
        label = replace(self._label(0, None), motion=motion_name)
        system = self.system
        return shape_of(self._assembly, self._expansion, self._point, system, lam, u, label)

    def has_model(self, prepared_key: str, n: int) -> bool:
        """Whether a run has the coordinates of these shapes: the same structure and basis."""
        own_model = self._expansion.model
        if prepared_key != self._design.structure or own_model.n != n:
            return False
        return same_coordinates(own_model, load_prepared(prepared_key).model)

    def _label(self, mode: int, track: int | None) -> Label:
        """What identifies the shape of a mode: study, design point and track."""
        results, point_row = self._results, self._results.points.iloc[self._row]
        names = results.parameters
        return Label(
            study=str(results.manifest["name"]),
            point_id=str(point_row["point_id"]),
            row=self._row,
            values={name: float(point_row[name]) for name in names},
            units={name: results.units.get(name, "") for name in names},
            mode=mode,
            track=track,
            fastest_hz=None if track is None else self._fastest_hz(track),
        )

    def _fastest_hz(self, track: int) -> float:
        """Frequency [Hz] of a tracked mode at the design point where it grows fastest."""
        modes = self._results.modes
        of_track = modes[(modes["track"] == track).to_numpy() & ~modes["overdamped"].to_numpy(bool)]
        return float(
            of_track["frequency_hz"].iloc[int(of_track["growth_rate"].to_numpy().argmax())]
        )

    def _partner(self, mode: int) -> int:
        """Index in `lam` of the root of a mode in the table; ResultsError where there is none."""
        table = self._modes
        roots = roots_of(table)
        i = int(np.flatnonzero(table["mode"] == mode)[0])
        row = table.iloc[i]
        if row["overdamped"]:
            raise _no_mode(table, self._row, mode, None)
        share = FULL_ORDER_REL_DISTANCE if row["method"] == FULL else SAME_ROOT_REL_DISTANCE
        allowed = share * abs(roots[i]) + ERROR_ALLOWANCE * np.nan_to_num(row["error_rung"])
        distance = np.abs(self.lam - roots[i])
        partner = int(distance.argmin()) if len(distance) else -1
        if partner < 0 or distance[partner] > allowed or self._other(roots, partner) != i:
            now = f"{abs(self.lam[partner]) / (2 * np.pi):.6g} Hz" if partner >= 0 else "none"
            raise ResultsError(
                f"{self._results.directory}: mode {mode} of design point {self._row} is at "
                f"{row['frequency_hz']:.6g} Hz in the table, the nearest of this version of "
                f"squealstudy is {now}: run the study again"
            )
        return partner

    def _other(self, roots: np.ndarray, number: int) -> int:
        """Index of the table's root that is nearest to the root `number` of `lam`."""
        return int(np.abs(roots - self.lam[number]).argmin())


def same_coordinates(rebuilt: ReducedModel, stored: ReducedModel) -> bool:
    """Whether a model that was made again has the coordinates of the stored one."""
    return rebuilt.n == stored.n and all(
        np.allclose(
            getattr(rebuilt, name),
            getattr(stored, name),
            rtol=0.0,
            atol=SAME_ROOT_REL_DISTANCE * size,
        )
        for name in ("N", "T", "T_perp")
        for size in [np.abs(getattr(stored, name)).max()]
    )


def plan_of(results: ResultTables) -> Plan:
    """The plan of results, with the design points that their run had.

    Raises
    ------
    ResultsError
        Where the study has code that this user has not run (`recorded_code.execute_recorded`), or
        its model file has changed since.
    """
    source = SourceText(results.directory / MANIFEST, str(results.fact("study")))
    tables = source.tables
    hashes = execute_recorded(results.manifest, results.directory)
    head = tables.get("study")
    if isinstance(head, dict) and "extensions" in head:
        if not hashes:
            raise ResultsError(
                f"{results.directory}: the study has code of its own, and these results do not "
                "keep which: run the study again"
            )
        tables = changed(source, tables, {"study.extensions": None})
    if "model_file" in results.manifest:  # it is where it was, the results may be elsewhere
        tables = changed(source, tables, {"model.file": results.manifest["model_file"]["path"]})
    if MATRICES_FOLDER in results.manifest:
        tables = changed(source, tables, {"model.folder": results.manifest[MATRICES_FOLDER]})
    tables = dict(recorded_map(tables, results.manifest["nominal"]))
    study = replace(read_tables(source, tables), extensions=hashes)
    if (
        isinstance(study.model, FileDefinition)
        and list(study.model.files) != (results.manifest["model_file"]["files"])
    ):
        raise ResultsError(
            f"{results.directory}: {study.model.path}, or a file that it reads, has changed since: "
            "run the study again"
        )
    names = [sweep.name for sweep in study.sweeps]
    swept = results.points[names].to_numpy(dtype=float)
    return Plan(study, swept, bool(results.manifest.get("basis_enriched", False)))


def expansion(plan: Plan, row: int, tell: Progress) -> Expansion:
    """The basis from a design point's reduced model to all nodes, from the cache or made now.

    Raises
    ------
    ResultsError
        Where the structure cannot be made.
    """
    design = plan.tasks[row]
    key = design.structure
    folder = prepared_path(key) / EXPANSION
    if is_prepared(key) and is_whole(folder):
        cached: Expansion = load_value(folder)
        return cached
    task = build_task(plan, design, cores())
    assert isinstance(task, BuildTask)
    if is_cached := is_prepared(key):
        stage, space = "basis of shapes, once for each structure", load_prepared(key).space
        if not task.enriching:  # then the basis needs no finer model
            task = replace(task, top_hz=None)
    else:
        stage, space = "reduction for shapes: the cache holds none of this version", None
    tell(stage, 0, 1)
    try:
        prepared, blocks = reduced_with_basis(task, space)
    except SquealstudyError as error:
        raise ResultsError(f"{plan.study.source.path}: {error}") from error
    if not is_cached:
        save_prepared(key, prepared)
    made_now = Expansion(prepared.model, blocks)
    save_value(folder, made_now)
    tell(stage, 1, 1)
    return made_now
