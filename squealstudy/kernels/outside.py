"""Laws from outside the package: compiled alone, and called by kernels at their addresses.

A design's row of laws holds the addresses of its functions in this process, so that kernels are
compiled once for all laws. Such a row is of no use in another process.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numba

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.addresses import COUNT, NOTHING, NUMBER, PAIR, PLAIN, ROW, TRIPLE
from squealstudy.kernels.jit import REORDER, compiled_directory
from squealstudy.kernels.law_text import (
    PLACES,
    ContactLaws,
    Curves,
    Slopes,
    contact_text,
    curve_text,
    friction_text,
    law_module,
    law_names,
    slope_text,
)
from squealstudy.laws import ContactLawDefinition
from squealstudy.laws.registry import LawDefinition

SIGNATURES = {  # of functions by the names of `law_text`
    "contact_at": PAIR(ROW, NUMBER),
    "potential": NUMBER(ROW, NUMBER),
    "pressures": NOTHING(*[ROW] * 4, COUNT, COUNT),
    "mean_pressures": NOTHING(*[ROW] * 5, COUNT, COUNT),
    "mu_at": TRIPLE(ROW, NUMBER, NUMBER),
    "resistance": NUMBER(ROW, *[NUMBER] * 3),
    "slope": NUMBER(ROW, *[NUMBER] * 3),
    "partials": TRIPLE(ROW, *[NUMBER] * 3),
    "frictions": NOTHING(*[ROW] * 8, COUNT, COUNT),
}
_made: dict[str, dict[int, float]] = {}  # addresses by their places in a row
_alive: list[Any] = []  # what addresses are of


def contact_addresses(law: ContactLawDefinition, first: int) -> dict[int, float]:
    """Addresses of a contact law from outside by their places in a row of laws.

    `first` is the place of the law's parameters.
    """
    laws = {at.OUTSIDE: law}
    return _addresses(contact_text(laws, first, False), laws, {}, {})


def friction_addresses(curves: Curves, slopes: Slopes, first: int) -> dict[int, float]:
    """Addresses of a curve and a regularisation, by their codes, at least one from outside."""
    texts = friction_text(curves, slopes, first, False)
    if at.OUTSIDE in curves:
        texts += curve_text(curves, first, False)
    if at.OUTSIDE in slopes:
        texts += slope_text(slopes, False)
    return _addresses(texts, {}, curves, slopes)


def _addresses(
    texts: list[str], contact: ContactLaws, curves: Curves, slopes: Slopes
) -> dict[int, float]:
    laws: list[LawDefinition | None] = [*contact.values(), *curves.values(), *slopes.values()]
    chosen = [law for law in laws if law is not None]
    sources = [law.source for law in chosen]
    # what numba keeps names modules, which are others where a program imports the same file
    modules = sorted({f.__module__ for law in chosen for f in law.functions.values()})
    key = hashlib.sha256("\n".join([*texts, *sources, *modules]).encode()).hexdigest()[:16]
    if key not in _made:
        folder = compiled_directory() / f"outside-{key}"  # numba sees a law's own file alone
        with _kept_in(folder):
            names = law_names(contact, curves, slopes)
            names |= {"kernel": _called, "fast_kernel": partial(_called, fastmath=REORDER)}
            module = law_module(folder / f"law_choice_{key}.py", texts, names)
        found = {name: getattr(module, name) for name in PLACES if hasattr(module, name)}
        _alive.extend(found.values())
        _made[key] = {PLACES[name]: _address(function) for name, function in found.items()}
    return _made[key]


def _called(function: Callable[..., Any], fastmath: Collection[str] = ()) -> Any:
    """A function compiled to be called by its address."""
    if numba.config.DISABLE_JIT:
        return function
    signature = SIGNATURES[function.__name__]
    options = {"error_model": "numpy", "fastmath": set(fastmath)}
    return numba.cfunc(signature, cache=True, **options)(function)


def _address(function: Any) -> float:
    """Address of a compiled function, below 2^53: exact as a float."""
    if numba.config.DISABLE_JIT:
        number = float(1 + len(PLAIN))
        PLAIN[number] = function
        return number
    address = float(function.address)
    assert int(address) == function.address
    return address


@contextmanager
def _kept_in(folder: Path) -> Iterator[None]:
    """What is decorated within is compiled into a folder."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before
