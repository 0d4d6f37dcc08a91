"""Reductions of structures: each from its meshes, or all of a range on one basis.

For a range, structures at its ends and between are reduced one after the other, and their bases
joined, until at the next places the joint basis gives the roots that a reduction there gives. Where
that never happens, or where a structure has another contact, each structure is reduced for itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import (
    is_prepared,
    is_whole,
    load_prepared,
    load_value,
    prepared_path,
    save_value,
)
from squealstudy.engine.plan import Plan
from squealstudy.errors import ConvergenceError, ModelError, SquealstudyError, StudyFileError
from squealstudy.linalg.factor import solve_threads
from squealstudy.machine.resources import give_back_memory
from squealstudy.mechanics.reduction import Reduction, SpaceOf, reduced
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import ModeKey, OperatingPoint
from squealstudy.modes.full_order.finer_model import (
    ReductionRecord,
    root_distances,
)
from squealstudy.reduction.cmt import ComponentBasis, ComponentModes, ReductionSettings
from squealstudy.reduction.contact_space import ContactSpace, contact_space
from squealstudy.reduction.prepared import (
    PreparedModel,
    mean_contact_stiffness,
    mode_shapes,
)
from squealstudy.reduction.projected import AnyAssembly, projected
from squealstudy.reduction.shared_basis import (
    SharedBasis,
    Snapshot,
    is_accurate,
    shared_basis,
    with_snapshot,
)
from squealstudy.reduction.working_point import with_less_friction
from squealstudy.study.design import DesignPoint

MOST_ENTRIES = 60_000_000  # matrix entries of assemblies that a process keeps: about a gigabyte


@dataclass(frozen=True)
class SharedTask:
    """A range of structures that have one basis.

    Attributes
    ----------
    key : str
        Key of the range's basis in the cache.
    places : tuple of DesignPoint
        Structures that are reduced to make the basis, in this order.
    tests : int
        Number of last reductions, in a row, whose roots the basis made before them must give.
    """

    key: str
    places: tuple[DesignPoint, ...]
    tests: int


@dataclass(frozen=True)
class BuildTask:
    """The structure of a design point to assemble, reduce and store.

    `top_hz` is the highest frequency at which errors of the reduction are estimated, None where
    they are not asked for; `band_hz` is the whole band. `enriching` is how often directions that a
    finer model shows to be lacking join the basis (`with_finer_model`). `coarse_key` is the cache
    key of the same structure with fewer such enrichments, empty where there is none. `shared` is
    the range of structures that use one basis, None where the structure has its own.
    """

    point: DesignPoint
    nominal: OperatingPoint
    training: tuple[OperatingPoint, ...]
    settings: ReductionSettings
    top_hz: float | None
    band_hz: tuple[float, float]
    scales: tuple[Mapping[ModeKey, float], ...]
    enriching: int
    coarse_key: str
    threads: int
    shared: SharedTask | None = None

    def record(
        self, assembly: AnyAssembly, modes: Mapping[str, ComponentModes], top_hz: float
    ) -> ReductionRecord:
        """What a prepared model is made from, to compare it with a finer one."""
        return ReductionRecord(
            assembly,
            modes,
            (self.nominal, *self.training),
            top_hz,
            self.settings.damped_to,
            self.scales,
        )


def reduced_with_basis(
    task: BuildTask, contact: ContactSpace | None = None
) -> tuple[PreparedModel, tuple[np.ndarray, ...]]:
    """Assemble and reduce a structure.

    Returns the prepared model, and a block (n_component, k) of its basis for each component.
    `contact` is the contact space of the same structure; None: the one of its coarser model where
    the cache holds that, else it is computed.
    """
    shared = None if task.shared is None else _shared_of(task, task.shared)
    with threadpool_limits(1), solve_threads(task.threads):
        started = time.perf_counter()
        assembly = task.point.assembly()
        assembly_s = time.perf_counter() - started
        if contact is None and is_prepared(task.coarse_key):
            contact = load_prepared(task.coarse_key).space
        if shared is not None and shared.serves(assembly):
            prepared, blocks = _by_shared(task, shared, assembly, contact)
        else:
            prepared, basis = _reduced(task, assembly, contact)
            blocks = basis.blocks
    return replace(prepared, timings={"assembly_s": assembly_s, **prepared.timings}), blocks


def _reduced(
    task: BuildTask, assembly: AnyAssembly, space: ContactSpace | SpaceOf | None
) -> tuple[PreparedModel, ComponentBasis]:
    """The prepared model of an assembly and its basis, made with less friction if need be."""

    def reduced_at(nominal: OperatingPoint) -> Reduction:
        return reduced(
            assembly,
            nominal,
            task.settings,
            task.training,
            task.top_hz,
            task.scales,
            task.enriching,
            space,
        )

    record = with_less_friction(reduced_at, task.nominal)
    return record.prepared, record.basis


def _by_shared(
    task: BuildTask, shared: SharedBasis, assembly: Assembly, contact: ContactSpace | None = None
) -> tuple[PreparedModel, tuple[np.ndarray, ...]]:
    """Project the assembly on the shared basis, then reduce it with `_reduced`."""
    started = time.perf_counter()
    V = [np.asarray(block) for block in shared.blocks]
    small = projected(assembly, V)
    projection_s = time.perf_counter() - started
    space = contact or (lambda modes: shared.space(small, mode_shapes(small, modes)))
    prepared, basis = _reduced(task, small, space)
    blocks = tuple(
        block @ component_block for block, component_block in zip(V, basis.blocks, strict=True)
    )
    timings = {"projection_s": projection_s, **prepared.timings}
    prepared = replace(prepared, basis_error=shared.error, n_dof=assembly.n_dof, timings=timings)
    return prepared, blocks


# -- the basis of a range --------------------------------------------------------------------------
def shared_task(plan: Plan, point: DesignPoint) -> SharedTask | None:
    """The range with one basis that a design point's structure is in; None where in none."""
    common_range = plan.shared_range
    if common_range is None or not common_range.holds(point.values):
        return None
    designs = [plan.design({**point.values, **values}) for values in common_range.places()]
    return SharedTask(plan.shared_key(point), tuple(designs), common_range.tests)


def shared_key(plan: Plan) -> str:
    """Cache key of the basis for a plan's structures; empty if it is not made or not accurate."""
    if plan.shared_range is None or not is_whole(prepared_path(plan.shared_key(plan.first))):
        return ""
    key = plan.shared_key(plan.first)
    return key if _loaded(key).is_accurate else ""


@dataclass(frozen=True)
class BuiltOnBasis:
    """Builds assemblies of a range on its basis (some hundred degrees of freedom).

    Attributes
    ----------
    build : callable
        Takes values of all the model's parameters by name, returns the Assembly.
    key : str
        Key of the basis in the cache.
    names : tuple of str
        Names of the parameters that the assembly depends on.
    """

    build: Callable[[Mapping[str, float]], Assembly]
    key: str
    names: tuple[str, ...]

    def __call__(self, values: Mapping[str, float]) -> Assembly:
        """The assembly at values of parameters, in coordinates of the basis if it is made for it.

        The last ones are kept, because operating points of one design ask for the same few.
        """
        key = (self.key, *(values[name] for name in self.names))
        if key not in _built:
            assembly, basis = self.build(values), _loaded(self.key)
            if not basis.serves(assembly):
                return assembly
            blocks = [np.asarray(block) for block in basis.blocks]
            _built[key] = projected(assembly, blocks).sparse()
            while len(_built) > max(MOST_ENTRIES // _entries(_built[key]), 1):
                del _built[next(iter(_built))]
        return _built[key]


_built: dict[tuple[object, ...], Assembly] = {}


def _entries(assembly: Assembly) -> int:
    """Number of nonzero entries of an assembly's largest matrices."""
    c = assembly.contact
    return int(sum(A.nnz for A in (assembly.M, assembly.K_springs(), c.N, c.T, c.T_perp)))


def shared_facts(plan: Plan) -> dict[str, dict[str, Any]]:
    """Facts of the manifest about a range with one basis and its error; none if there is none."""
    if plan.shared_range is None or not is_whole(prepared_path(plan.shared_key(plan.first))):
        return {}
    basis: SharedBasis = load_value(prepared_path(plan.shared_key(plan.first)))
    facts = {
        "range": plan.shared_range.text,
        "reductions": basis.reductions,
        "error": basis.error if np.isfinite(basis.error) else None,
        "used": basis.is_accurate,
    }
    return {"shared_basis": facts}


def make_shared(task: BuildTask) -> tuple[str, str]:
    """Make and cache the basis of a task's range; (key, "") or (key, reason of failure)."""
    assert task.shared is not None
    try:
        _shared_of(task, task.shared)
    except StudyFileError:
        raise
    except SquealstudyError as error:
        return task.shared.key, str(error)
    finally:
        give_back_memory()
    return task.shared.key, ""


def _shared_of(task: BuildTask, shared: SharedTask) -> SharedBasis:
    """The basis of a task's range, from the cache or made now."""
    folder = prepared_path(shared.key)
    if not is_whole(folder):
        with threadpool_limits(1), solve_threads(task.threads):
            save_value(folder, _make_shared_basis(task, shared))
    return _loaded(shared.key)


@lru_cache(maxsize=1)
def _loaded(key: str) -> SharedBasis:
    basis: SharedBasis = load_value(prepared_path(key))
    return basis


def _make_shared_basis(task: BuildTask, shared: SharedTask) -> SharedBasis:
    """Reduce structures of the range until the basis made before gives the last ones' roots."""
    blocks: tuple[np.ndarray, ...] = ()
    # relative changes of roots: as the place joins the basis, and from the basis to its reduction
    tests: list[tuple[float, float]] = []
    first: Assembly | None = None
    stiffness: float | np.ndarray = 0.0
    count, failure = 0, None
    for point in shared.places:
        task_here = replace(task, point=point, shared=None, coarse_key="")
        try:
            assembly = point.assembly()
            if first is None:
                stiffness = mean_contact_stiffness(assembly, task.nominal)
            snapshot = Snapshot(assembly)
            prepared, basis = _reduced(
                task_here, assembly, _SnapshotSpace(assembly, stiffness, snapshot)
            )
        except (ConvergenceError, ModelError) as error:
            failure = error  # e.g. moduli that no material has together, or no steady sliding
            continue
        first = assembly if first is None else first
        snapshot.blocks = basis.blocks
        wider = with_snapshot(first, blocks, snapshot)
        if count > 1:
            states = task.record(assembly, {}, task.band_hz[1]).states
            before, again = (
                _by_shared(task_here, shared_basis(assembly, V, stiffness, count), assembly)[0]
                for V in (blocks, wider)
            )
            others = (again, prepared)
            lacking, apart = (root_distances(before, o, states, task.band_hz) for o in others)
            tests.append((lacking, apart))
        blocks, count = wider, count + 1
        if is_accurate(*_worst(tests, shared.tests)):
            break
    if first is None:
        assert failure is not None
        raise failure
    return shared_basis(first, blocks, stiffness, count, *_worst(tests, shared.tests))


def _worst(tests: list[tuple[float, float]], needed: int) -> tuple[float, float]:
    """Largest change of roots in the last `needed` + 1 tests, largest distance in `needed`.

    Infinite where there were fewer tests. Changes need one test more than distances: where
    reductions themselves differ, one place more has to be spanned.
    """
    lacking, error = np.array([(np.inf, np.inf)] * (needed + 1) + tests).T
    return float(lacking[-needed - 1 :].max()), float(error[-needed:].max())


@dataclass(frozen=True)
class _SnapshotSpace:
    """Makes the contact space of an assembly and keeps its static responses."""

    assembly: Assembly
    k_c: float | np.ndarray
    snapshot: Snapshot

    def __call__(self, modes: Mapping[str, ComponentModes]) -> ContactSpace:
        shapes = mode_shapes(self.assembly, modes)
        return contact_space(self.assembly, self.k_c, shapes, on_responses=self.snapshot.add)
