"""What an extension registers is gone after its tests: others ask what the package alone has."""

from __future__ import annotations

import sys

import pytest

from squealstudy import extensions
from squealstudy.models import catalogue
from squealstudy.modes import rungs
from squealstudy.motion import integrator
from squealstudy.study import kinds

REGISTRIES = (
    catalogue.MODELS,
    rungs._registered,
    integrator._integrators,
    kinds._registered,
)


@pytest.fixture(autouse=True, scope="module")
def registered():
    before = [dict(registry) for registry in REGISTRIES]
    files = dict(extensions._read)
    yield
    changed = [dict(registry) for registry in REGISTRIES] != before
    for registry, content in zip(REGISTRIES, before, strict=True):
        registry.clear()
        registry.update(content)
    if changed:
        for path in set(extensions._read) - set(files):
            del extensions._read[path]
        for name in [n for n in sys.modules if n.startswith("squealstudy_extension_my_")]:
            if "law" not in name and "curve" not in name:
                del sys.modules[name]
