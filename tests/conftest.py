"""Fixtures: one coarse brake and one cache for all processes of a session; how models are built.

The whole suite runs on up to four processes, named files or tests in one.
"""

from __future__ import annotations

import gc
import hashlib
import importlib
import os
import pickle
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import date
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import code_paths
import hypothesis
import numpy as np
import pytest
import threadpoolctl
from registries import forget_extensions

os.environ.pop("COLUMNS", None)  # workers of pytest-xdist have 80, one process has none

from squealstudy.kernels.jit import compiled_directory
from squealstudy.laws import contact_law
from squealstudy.linalg.band_roots import BandRoots
from squealstudy.machine.locks import lock
from squealstudy.mechanics.basis import LOAD_FACTOR
from squealstudy.models.assembly import Assembly
from squealstudy.models.catalogue import MODELS
from squealstudy.models.catalogue.disc_brake import assemble as disc_brake_assembly
from squealstudy.models.catalogue.disc_brake.solids import DENSITIES
from squealstudy.models.operating import OperatingPoint
from squealstudy.modes.full_order.modes import full_order_roots, full_order_system
from squealstudy.motion.warmup import warm_kernels
from squealstudy.reduction.cmt import (
    ComponentBasis,
    ComponentModes,
    ReducedModel,
    ReductionSettings,
    component_modes,
    reduce_cmt,
)
from squealstudy.reduction.contact_space import ContactSpace, contact_space
from squealstudy.reduction.prepared import (
    PreparedModel,
    mean_contact_stiffness,
    mode_shapes,
    with_shapes,
)
from squealstudy.reduction.working_point import WorkingPoint, working_point

threadpoolctl.threadpool_limits(1)  # as in workers; more threads are slower on a loaded machine
hypothesis.settings.register_profile(
    "repeatable", derandomize=True, deadline=None
)  # kernels may compile
hypothesis.settings.load_profile("repeatable")


MOST_WORKERS = 4
TENTHS = 10  # of the tests of full size: a day of ten has its own
LONGEST = (  # files that begin first, so that none of them ends a run alone
    *("test_cluster", "test_design", "test_plots", "test_fidelity", "test_shipped_studies"),
    *("test_shipped_transients", "test_boundary", "test_sweep_basis", "test_fixed_jacobian"),
)
EXTENDING = ("test_stacked_sensitivity",)  # files that read extensions, in another folder
CACHE = "SQUEALSTUDY_CACHE"
COMPILED = "NUMBA_CACHE_DIR"
SHARED = "SQUEALSTUDY_TESTS_SHARED"


@pytest.hookimpl(wrapper=True)
def pytest_xdist_auto_num_workers(config):
    """None for what is named on the command line: starting them takes longer than most tests."""
    processors = yield
    return min(processors, MOST_WORKERS) if config.args == config.getini("testpaths") else 0


def pytest_addoption(parser):
    parser.addoption(
        "--full-size-tenth",
        metavar="DATE",
        type=lambda text: date.fromisoformat(text).toordinal(),
        help="the tests of full size that this day has too: a tenth, another on each of ten days",
    )


def is_worker(config) -> bool:
    return hasattr(config, "workerinput")


def pytest_configure(config):
    """What all processes share: reductions out of the user's cache, kernels compiled in it.

    Kernels are named by a hash of their sources: what was compiled before serves. Workers inherit.
    """
    absent = code_paths.missing()
    if absent:
        raise pytest.UsageError(f"code paths asked for and not in effect: {', '.join(absent)}")
    sys.dont_write_bytecode = False  # hundreds of processes would each compile the package anew
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.fsync = lambda descriptor: None  # a run waits for the disk twenty times
    if is_worker(config):
        return
    if hasattr(config.option, "loadscopereorder"):  # from pytest-xdist 3.7 on
        config.option.loadscopereorder = False  # else files with most tests come first
    shared = tempfile.mkdtemp(prefix="squealstudy-tests-")
    os.environ.setdefault(COMPILED, str(compiled_directory().parent))
    os.environ.setdefault(CACHE, str(Path(shared) / "cache"))
    os.environ[SHARED] = shared


def pytest_unconfigure(config):
    if hasattr(config, "compiling"):
        config.compiling.terminate()  # of a selection that needed no kernels
        config.compiling.wait()
    if not is_worker(config) and SHARED in os.environ:
        shutil.rmtree(os.environ[SHARED], ignore_errors=True)


@cache
def needs_kernels(path: Path) -> bool:
    """Whether the tests of a file integrate in time, as far as its words tell."""
    return bool(re.search("transient|newmark|hybrid|integrat|belt|simulate", path.read_text()))


def pytest_sessionstart(session):
    """Kernels are compiled beside the tests that need none, which come first."""
    if session.config.getoption("numprocesses", 0) and not session.config.option.collectonly:
        code = "from squealstudy.motion.warmup import warm_kernels; warm_kernels()"
        session.config.compiling = subprocess.Popen([sys.executable, "-c", code])


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """What is collected stays: it is not looked through for garbage again and again."""
    gc.disable()
    done = yield
    gc.freeze()
    gc.set_threshold(100_000)
    gc.enable()
    return done


@pytest.fixture(autouse=True)
def sentences_in_one_line(monkeypatch):
    """Tests look for what is said, not for where a line of a file is broken."""
    monkeypatch.setattr("squealstudy.screen.WIDTH_OF_SENTENCES", 100_000)


@pytest.fixture(scope="module", autouse=True)
def compiled_kernels(request):
    """Waits for the kernels where they are being compiled, and loads them."""
    if is_worker(request.config) and needs_kernels(request.path):
        warm_kernels()


@pytest.fixture(scope="module", autouse=True)
def _the_package_alone():
    """What the tests of a file register is unknown to those of other files."""
    yield
    forget_extensions()


def shared(name: str, make: Callable[[], Any]) -> Any:
    """What the first process of the session to ask for it has made."""
    path = Path(os.environ[SHARED]) / f"{name}.pickle"
    with lock(path.with_suffix(".lock")):
        if not path.exists():
            path.write_bytes(pickle.dumps(make()))
        return pickle.loads(path.read_bytes())


def runs_on(name: str, day: int) -> bool:
    """Whether a test of full size, or what several of them share, belongs to the tenth of a day."""
    number = int(hashlib.sha256(name.encode()).hexdigest(), 16)
    return number % TENTHS == day % TENTHS


def order(path: Path) -> tuple[bool, bool, int]:
    """Place of a file among all: those without kernels first, and of each sort the longest.

    Extensions last: laws that they register stay known in their process.
    """
    place = LONGEST.index(path.stem) if path.stem in LONGEST else len(LONGEST)
    extends = path.parent.name == "extension" or path.stem in EXTENDING
    return extends, needs_kernels(path), place


def pytest_collection_modifyitems(config, items):
    """What is of full size runs where it is asked for: `-m full_size`, `--full-size-tenth DATE`.

    Tests that name what they share (`full_size("kernels of ..")`) have one day, so that it is made
    on that day alone. What takes many minutes (`by_hand`) runs by `-m by_hand` alone.
    """
    if is_worker(config):
        items.sort(key=lambda item: order(item.path))
    day = config.option.full_size_tenth
    if config.option.markexpr and day is None:
        return

    def left_out(item) -> bool:
        if item.get_closest_marker("by_hand"):
            return True
        mark = item.get_closest_marker("full_size")
        return mark is not None and (
            day is None or not runs_on(*(mark.args or (item.nodeid,)), day)
        )

    slow = [item for item in items if left_out(item)]
    config.hook.pytest_deselected(items=slow)
    items[:] = [item for item in items if not left_out(item)]


BENCHMARKS = Path(__file__).parents[1] / "studies" / "benchmarks"
DATA = "SQUEALSTUDY_DATA"
M0 = (
    Path(os.environ.pop(DATA, "") or Path(__file__).resolve().parents[2] / "shared" / "data") / "m0"
)
TOP = 4e3  # Hz, top of the band of the reduced brake, which holds its first lock-in
CUTOFF = 1.5 * TOP  # as studies have it, whose [reduction] takes loads up to LOAD_FACTOR
COARSE = {"mesh": "coarse", "contact_points": 2}  # the fewest of everything
PRESSURES = (2e5, 40e5)  # Pa, ends of the range that the basis is trained for
NOMINAL = OperatingPoint(0.5, 12e5, 0.5, contact_law())


@dataclass(frozen=True)
class Brake:
    """A generated brake, and what its nominal working point needs."""

    assembly: Assembly
    modes: dict[str, ComponentModes]
    space: ContactSpace
    point: WorkingPoint


def benchmark(name: str) -> ModuleType:
    """A script of studies/benchmarks, as a module."""
    if str(BENCHMARKS) not in sys.path:
        sys.path.append(str(BENCHMARKS))  # scripts import what lies beside them
    return importlib.import_module(name)


def build_model(name, options=None, **values):
    """A model of the catalogue with default options and parameters but for those given."""
    definition = MODELS[name]
    chosen = {o.name: o.choices[0] for o in definition.options} | (options or {})
    return definition.build(chosen, definition.defaults() | values)


def prepare_brake(mesh, top=TOP) -> Brake:
    """The brake of a mesh density, up to its nominal working point."""
    assembly = build_model("disc_brake", COARSE | {"mesh": mesh})
    modes = component_modes(assembly, 1.5 * top)
    stiffness = mean_contact_stiffness(assembly, NOMINAL)
    space = contact_space(assembly, stiffness, mode_shapes(assembly, modes))
    return Brake(assembly, modes, space, working_point(space, NOMINAL))


def reduce_brake(brake, top=TOP) -> tuple[ReducedModel, ComponentBasis]:
    """Trained at the nominal point and at the ends of a pressure range."""
    ends = [working_point(brake.space, replace(NOMINAL, brake_pressure=p)) for p in PRESSURES]
    settings = ReductionSettings(1.5 * top, 1.5 * top, LOAD_FACTOR * top)
    return reduce_cmt(brake.assembly, brake.modes, brake.point, settings, ends)


def full_order(assembly, modes, point, state, band_hz, cutoff) -> BandRoots:
    """Roots of the unreduced equations about a working point, in a band in Hz."""
    system = full_order_system(assembly, modes, point, state, cutoff)
    low, high = band_hz
    return full_order_roots(system, (2 * np.pi * low, 2 * np.pi * high))


@pytest.fixture(scope="session")
def m0_files() -> Path:
    """The folder of the brake M0, which a clone does not hold."""
    if not M0.is_dir():
        pytest.skip(f"M0 IS NOT CHECKED: its matrices are not at {M0}")
    return M0


@pytest.fixture(scope="session")
def brake() -> Brake:
    """The coarse brake with fewer cells in its disc and caliper: a third of its cost."""

    def made() -> Brake:
        from tiny_meshes import SMALL  # which imports most of the package

        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(DENSITIES, "coarse", SMALL)
            return prepare_brake("coarse")

    return shared("brake", made)


@pytest.fixture(scope="session")
def least_brake() -> Brake:
    """The same of the smallest meshes."""

    def made() -> Brake:
        from tiny_meshes import TINY as TINY_MESHES  # which imports most of the package

        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(DENSITIES, "coarse", TINY_MESHES)
            return prepare_brake("coarse")

    return shared("least_brake", made)


@pytest.fixture(scope="session")
def reduced(brake) -> tuple[ReducedModel, ComponentBasis]:
    return shared("reduced", lambda: reduce_brake(brake))


@pytest.fixture(scope="session")
def prepared(brake, reduced) -> PreparedModel:
    """The same brake as workers have it."""
    return with_shapes(brake.assembly, brake.space, *reduced, brake.point)


@pytest.fixture(scope="module")
def assembled_once():
    """Within a file the generated brake is assembled once for the same options and values."""
    assembled: dict[Any, Assembly] = {}
    assemble = disc_brake_assembly.assemble

    def kept(options, values):
        key = tuple(sorted(options.items())), tuple(sorted(values.items())), id(DENSITIES["coarse"])
        if key not in assembled:
            assembled[key] = assemble(options, values)
        return assembled[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(disc_brake_assembly, "assemble", kept)
        yield


@pytest.fixture
def meshed_as_brake(monkeypatch):
    """Other models of the coarse mesh have that of `brake`."""
    from tiny_meshes import SMALL

    monkeypatch.setitem(DENSITIES, "coarse", SMALL)


@pytest.fixture(scope="module")
def tiny_brake():
    """Within a file the coarse meshes are the smallest, with one cache for all such files."""
    from tiny_meshes import tiny_cache, tiny_meshes  # which imports most of the package

    with tiny_meshes(tiny_cache()) as patch:
        yield patch


@pytest.fixture
def one_by_one(monkeypatch):
    """Small models, too, are prepared, kept in the cache and solved point by point, as others."""
    for kind in ("complex_modes", "sensitivity"):
        monkeypatch.setattr(f"squealstudy.kinds.{kind}.kind.stacks", lambda plan: False)


TINY = [  # first_brake.toml in seconds
    ("start = 0.1\nstop = 0.7\nnum = 7", "values = [0.1, 0.4, 0.5]"),
    ("values = [0.9, 1.0, 1.1]", "values = [1.0, 1.1]"),
    ("8000.0]", "3500.0]\nreference_points = 0\nrefine_tracking = false"),
]


@pytest.fixture(scope="module")
def first_brake(tmp_path_factory, tiny_brake) -> Path:
    """A folder with a smaller studies/first_brake.toml and its results/first_brake."""
    made = Path(os.environ[SHARED]) / "first_brake"
    with lock(made.with_suffix(".lock")):
        if not (made / "results").exists():
            run_first_brake(made)
    return Path(shutil.copytree(made, tmp_path_factory.mktemp("pages") / "first_brake"))


def run_first_brake(folder: Path) -> None:
    text = (Path(__file__).parents[1] / "studies" / "first_brake.toml").read_text(encoding="utf-8")
    for old, new in TINY:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "studies" / "first_brake.toml"
    path.parent.mkdir(parents=True)
    path.write_text(text, encoding="utf-8")
    import squealstudy

    squealstudy.run(path, folder / "results" / "first_brake", jobs=1)
