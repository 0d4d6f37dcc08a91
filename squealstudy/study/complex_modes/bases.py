"""Sweep bases of a study's structures: made once, kept beside the prepared models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from squealstudy.analysis.reanalysis.brake_modes import BrakeModes
from squealstudy.analysis.reanalysis.brake_problem import BrakeProblem
from squealstudy.analysis.reanalysis.collocated import CollocatedSystem, Expansion
from squealstudy.analysis.reanalysis.family_modes import FamilyModes
from squealstudy.analysis.reanalysis.family_problem import FamilyProblem
from squealstudy.analysis.reanalysis.problem import Problem
from squealstudy.analysis.reanalysis.sweep_basis import Report, SweepBasis, build_sweep_basis
from squealstudy.errors import ConvergenceError
from squealstudy.reduction.prepared_family import PreparedFamily
from squealstudy.study.cache import prepared_path
from squealstudy.study.complex_modes.chart import Chart
from squealstudy.study.family_cache import prepared_any
from squealstudy.study.files import write_atomic
from squealstudy.study.keys import content_hash, source_hash
from squealstudy.system.design_state import DesignState
from squealstudy.system.parametric import DAMPING, MASS, STIFFNESS

MOST_KEPT = 2  # bases a process holds
Reader = BrakeModes | FamilyModes
SHARE = 1 / 3  # of the tolerance that the basis may use up
DAMPING_SHARE = 0.1  # and the interpolation of modal damping
# a basis to a looser tolerance is cut shorter and asks for more training points in exchange: at
# 1e-2 four times the time of 1e-4, for as many vectors
LOOSEST = 1e-4


@dataclass(frozen=True)
class BasisTask:
    """A structure, the box of its design points, and what the basis must reach."""

    key: str
    chart: Chart
    band_hz: tuple[float, float]
    tolerance: float

    @property
    def path(self) -> Path:
        """Where the basis is kept."""
        chart, law = self.chart.identity(), self.chart.design.law_kind
        code = [source_hash(), source_hash(("study/complex_modes",))]
        content = [code, chart, law, self.band_hz, self.tolerance]
        return prepared_path(self.key) / "sweep_bases" / f"{content_hash(content)}.npz"

    @property
    def refusal(self) -> Path:
        """Where it is said why there is no basis over this box."""
        return self.path.with_suffix(".reason")


def problem_of(task: BasisTask, exact_damping: bool = False) -> Problem:
    """The ladder's problem over the box of a task; `exact_damping` as of BrakeProblem."""
    prepared, chart = prepared_any(task.key), task.chart
    if isinstance(prepared, PreparedFamily):

        def values_at(theta: np.ndarray) -> dict[str, float]:
            return chart.design_at(theta).plain_values()

        return FamilyProblem(
            prepared.model, chart.dimension, values_at, task.band_hz, prepared.n_roots
        )

    def state_at(theta: np.ndarray) -> DesignState:
        return chart.design_at(theta).state()

    return BrakeProblem(prepared, chart.dimension, state_at, task.band_hz, exact_damping)


def reader_of(task: BasisTask, V: np.ndarray | None) -> Reader:
    """What turns roots with vectors in the coordinates of V into rows' modes."""
    prepared = prepared_any(task.key)
    if isinstance(prepared, PreparedFamily):
        return FamilyModes(prepared, V)
    return BrakeModes(prepared, V)


def make_basis(task: BasisTask, report: Report) -> SweepBasis:
    """The basis of a task, read where it is there, made and kept where it is not."""
    if task.path.is_file():
        return load_basis(task.path)
    problem = problem_of(task)
    interpolated = _modal_damping_error(problem, task.tolerance)
    trained_to = SHARE * min(task.tolerance, LOOSEST)
    basis = build_sweep_basis(problem, trained_to, report=report)
    basis = replace(basis, interpolated=interpolated)
    _save(task.path, basis)
    return basis


def refuse_basis(task: BasisTask, why: str) -> None:
    """Keep why a task has no basis, so that it is not tried again."""

    def write(temporary: Path) -> None:
        temporary.write_text(why)

    write_atomic(task.refusal, write)


def _modal_damping_error(problem: Problem, tolerance: float) -> float:
    """Error of its interpolation; ConvergenceError where that is not good enough."""
    if not isinstance(problem, BrakeProblem):
        return 0.0
    error = problem.modal_damping_error()
    if error > DAMPING_SHARE * tolerance:
        raise ConvergenceError(
            "not_converged", f"interpolated modal damping is wrong by {error:.0e} in damping ratio"
        )
    return error


class Served(NamedTuple):
    """What a worker keeps of a box: its problem, a basis where it has one, and readers."""

    problem: Problem
    basis: SweepBasis | None
    reduced: Reader
    full: Reader


def served(task: BasisTask, with_basis: bool) -> Served:
    """The problem of a task and its basis, made ready once a process."""
    path = f"{task.path} {with_basis}"
    if path not in _kept:
        while len(_kept) >= MOST_KEPT:
            _kept.pop(next(iter(_kept)))
        basis = load_basis(task.path) if with_basis else None
        full = reader_of(task, None)
        reduced = full if basis is None else reader_of(task, basis.V)
        _kept[path] = Served(problem_of(task, not with_basis), basis, reduced, full)
    return _kept[path]


_kept: dict[str, Served] = {}


def _save(path: Path, basis: SweepBasis) -> None:
    arrays: dict[str, Any] = {
        "V": basis.V,
        "flexibility": basis.flexibility,
        "trained": basis.trained,
        "facts": np.array(
            [basis.error, basis.seconds, basis.interpolated, float(basis.small.unit_mass)]
        ),
        "orders": np.array([e.order for e in basis.small.expansions]),
    }
    arrays |= {f"shapes.{i}": e.shapes for i, e in enumerate(basis.small.expansions)}
    arrays |= {f"stack.{order}": stack for order, stack in enumerate(basis.small.stacks)}

    def write(temporary: Path) -> None:
        with temporary.open("wb") as handle:
            np.savez(handle, **arrays)

    write_atomic(path, write)


def load_basis(path: Path) -> SweepBasis:
    """Read a basis that `make_basis` kept."""
    with np.load(path) as data:
        expansions = tuple(
            Expansion(int(order), data[f"shapes.{i}"]) for i, order in enumerate(data["orders"])
        )
        stacks = tuple(data[f"stack.{order}"] for order in (STIFFNESS, DAMPING, MASS))
        V, flexibility, trained = data["V"], data["flexibility"], data["trained"]
        error, seconds, interpolated, unit_mass = (float(x) for x in data["facts"])
        small = CollocatedSystem(V.shape[1], expansions, stacks, bool(unit_mass))
        return SweepBasis(V, flexibility, small, error, trained, seconds, interpolated)


def split_boxes(theta: np.ndarray, most: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Points (n, d) in boxes of at most `most`: (rows, low, high); the longest side is halved."""
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    pending: Sequence[np.ndarray] = [np.arange(len(theta))]
    while pending:
        rows, *rest = pending
        low, high = theta[rows].min(axis=0), theta[rows].max(axis=0)
        axis = int(np.argmax(high - low)) if theta.shape[1] else 0
        if len(rows) <= most or not (high > low).any():
            found.append((rows, low, high))
            pending = rest
            continue
        cut = np.median(theta[rows, axis])
        cut = cut if cut < high[axis] else (low[axis] + high[axis]) / 2
        below = theta[rows, axis] <= cut
        pending = [rows[below], rows[~below], *rest]
    return found
