"""The catalogue of rungs: every file in this folder is one, under the name of the file."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

from squealstudy.extensions import note_registered

if TYPE_CHECKING:
    from squealstudy.modes.rung import Rung

AUTO = "auto"  # value in study files that chooses the rung of least cost
_registered: dict[str, Rung] = {}


def register_rung(rung: Rung) -> None:
    """Add a rung from outside the package, under its name.

    Parameters
    ----------
    rung : Rung
        An instance.

    Raises
    ------
    TypeError
        An argument that is no instance of a Rung, such as a class.
    ValueError
        Where another rung has that name.
    """
    from squealstudy.modes.rung import Rung

    if not isinstance(rung, Rung):
        raise TypeError(f"expected an instance of a Rung, got {rung!r}")
    registered = _registered.get(rung.name, rung)
    if rung.name in (*_own_names(), AUTO) or type(registered).__module__ != type(rung).__module__:
        raise ValueError(f"there is a rung named '{rung.name}' already")
    _registered[rung.name] = rung
    note_registered(type(rung).__module__)


def rung_names() -> tuple[str, ...]:
    """Names of all rungs; none is imported."""
    return (*_own_names(), *_registered)


def rung_named(name: str) -> Rung:
    """The rung of that name; KeyError where there is none."""
    if name in _registered:
        return _registered[name]
    if name not in _own_names():
        raise KeyError(name)
    rung: Rung = import_module(f"{__name__}.{name}").RUNG
    return rung


def all_rungs() -> list[Rung]:
    """Every rung, in the order of `rung_names`."""
    return [rung_named(name) for name in rung_names()]


def exact_rung(reduced: bool) -> Rung:
    """The exact rung of least cost for models with component-mode coordinates, or without."""
    from squealstudy.modes.rung import Scope

    scope = Scope(reduced=reduced, varied=0, points=1)
    serving = [rung for rung in all_rungs() if rung.exact and not rung.refusal(scope)]
    return min(serving, key=lambda rung: rung.relative_cost(1, 0))


def full_order_rung() -> Rung:
    """The rung of the unreduced model, the reference of all others."""
    return next(rung for rung in all_rungs() if rung.exact and rung.unreduced)


@cache
def _own_names() -> tuple[str, ...]:
    return tuple(sorted(module.name for module in pkgutil.iter_modules(__path__)))
