"""Fixtures: one coarse brake for the whole session, and how models are built."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import hypothesis
import pytest
import threadpoolctl

from squealstudy.models.assembly import Assembly
from squealstudy.models.catalogue import MODELS
from squealstudy.models.law import ContactLaw
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.cmt import (
    Basis,
    BasisSettings,
    ComponentModes,
    ReducedModel,
    component_modes,
    reduce_cmt,
)
from squealstudy.reduction.contact_space import ContactSpace, contact_space
from squealstudy.reduction.prepared import (
    PreparedModel,
    mode_shapes,
    prepare,
    reference_stiffness,
)
from squealstudy.reduction.working_point import WorkingPoint, working_point

threadpoolctl.threadpool_limits(1)  # as in workers; more threads are slower on a loaded machine
hypothesis.settings.register_profile(
    "repeatable", derandomize=True, deadline=None
)  # kernels may compile
hypothesis.settings.load_profile("repeatable")


@pytest.fixture(scope="session", autouse=True)
def cache_of_the_session(tmp_path_factory):
    """Reductions of the tests stay out of the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        if "SQUEALSTUDY_CACHE" not in os.environ:
            patch.setenv("SQUEALSTUDY_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def pytest_collection_modifyitems(config, items):
    """Full-size validation runs only where it is asked for: ``pytest -m full_size``."""
    if config.option.markexpr:
        return
    slow = [item for item in items if item.get_closest_marker("full_size")]
    config.hook.pytest_deselected(items=slow)
    items[:] = [item for item in items if item not in slow]


TOP = 8e3  # Hz, top of the band of the reduced brake; cutoffs beyond it as studies have them
CUTOFF = 1.5 * TOP
LOAD_CUTOFF = 1.125 * TOP
NOMINAL = OperatingPoint(0.5, 12e5, 0.5, ContactLaw())


@dataclass(frozen=True)
class Brake:
    """A generated brake, and what its nominal working point needs."""

    assembly: Assembly
    modes: dict[str, ComponentModes]
    space: ContactSpace
    point: WorkingPoint


def build_model(name, options=None, **values):
    """A model of the catalogue with default options and parameters but for those given."""
    definition = MODELS[name]
    chosen = {o.name: o.choices[0] for o in definition.options} | (options or {})
    return definition.build(chosen, definition.defaults() | values)


def prepare_brake(mesh) -> Brake:
    """The brake of a mesh density, up to its nominal working point."""
    assembly = build_model("disc_brake", {"mesh": mesh})
    modes = component_modes(assembly, CUTOFF)
    stiffness = reference_stiffness(assembly, NOMINAL)
    space = contact_space(assembly, stiffness, mode_shapes(assembly, modes))
    return Brake(assembly, modes, space, working_point(space, NOMINAL))


def reduce_brake(brake) -> tuple[ReducedModel, Basis]:
    """Trained at the nominal point and at the ends of a pressure range, 2 and 30 bar."""
    ends = [working_point(brake.space, replace(NOMINAL, pressure=p)) for p in (2e5, 30e5)]
    settings = BasisSettings(CUTOFF, CUTOFF, LOAD_CUTOFF)
    return reduce_cmt(brake.assembly, brake.modes, brake.point, settings, ends)


@pytest.fixture(scope="session")
def brake() -> Brake:
    return prepare_brake("coarse")


@pytest.fixture(scope="session")
def reduced(brake) -> tuple[ReducedModel, Basis]:
    return reduce_brake(brake)


@pytest.fixture(scope="session")
def prepared() -> PreparedModel:
    """The coarse brake up to 4 kHz, trained at both ends of 2 to 40 bar: small and fast."""
    assembly = build_model("disc_brake", {"mesh": "coarse"})
    ends = [replace(NOMINAL, pressure=p) for p in (2e5, 40e5)]
    return prepare(assembly, NOMINAL, BasisSettings(6e3, 6e3, 4.5e3), ends)
