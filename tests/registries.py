"""What extensions register is gone after the tests of a file: others ask what the package has."""

from __future__ import annotations

import sys
from collections.abc import Mapping, MutableMapping
from typing import Any

from squealstudy import columns, extensions
from squealstudy.engine import pictures
from squealstudy.models import catalogue
from squealstudy.modes import rungs
from squealstudy.motion import integrator
from squealstudy.study import kinds

PACKAGE = "squealstudy."
EXECUTED = "squealstudy_extension_"  # modules made of files outside the package
LAWS = ("law", "curve")  # in names of files: laws stay, whose kernels keep their addresses


def forget_extensions() -> None:
    """Unregister what is not of the package, but for laws; its files can be executed again."""
    _drop(catalogue.MODELS, {n: m.build.__module__ for n, m in catalogue.MODELS.items()})
    _drop(rungs._registered, {n: type(r).__module__ for n, r in rungs._registered.items()})
    _drop(kinds._registered, {n: type(k).__module__ for n, k in kinds._registered.items()})
    _drop(integrator._integrators, {n: i.__module__ for n, i in integrator._integrators.items()})
    _drop(pictures._REGISTERED, {n: p.draw.__module__ for n, p in pictures._REGISTERED.items()})
    for kind in set(columns.COLUMNS) - set(kinds.kind_names()):
        del columns.COLUMNS[kind]
    for path in [p for p in extensions._read if not any(w in p.stem for w in LAWS)]:
        del extensions._read[path]
    for name in [n for n in sys.modules if n.startswith(EXECUTED)]:
        if not any(word in name for word in LAWS):
            del sys.modules[name]


def _drop(registry: MutableMapping[str, Any], modules: Mapping[str, str]) -> None:
    """Remove from a registry what comes from no module of the package."""
    for name, module in modules.items():
        if not module.startswith(PACKAGE):
            del registry[name]
