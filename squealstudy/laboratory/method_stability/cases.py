"""All cases of method-stability studies, by name: those of the files of this folder."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules

import squealstudy.laboratory.method_stability as folder
from squealstudy.laboratory.method_stability.contract import StabilityCase


def _found() -> dict[str, StabilityCase]:
    names = [found.name for found in iter_modules(folder.__path__, f"{folder.__name__}.")]
    values = [v for n in names if n != __name__ for v in vars(import_module(n)).values()]
    return {case.name: case for case in values if isinstance(case, StabilityCase)}


CASES: Mapping[str, StabilityCase] = _found()
