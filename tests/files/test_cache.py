"""What the cache may hold."""

import typing
from dataclasses import fields, is_dataclass
from importlib import import_module

from squealstudy.engine.packed_values import CLASSES


def test_values_hold_no_class_that_is_not_allowed():
    """What the fields of a value's classes are made of has classes too."""
    missing = set()
    for name in CLASSES:
        module, _, own = name.rpartition(".")
        kind = getattr(import_module(module), own)
        hints = typing.get_type_hints(kind)
        names = [f.name for f in fields(kind)] if is_dataclass(kind) else kind._fields
        for found in _classes_in(hints[name] for name in names):
            if is_dataclass(found) or hasattr(found, "_fields"):
                missing |= {f"{found.__module__}.{found.__qualname__}"} - CLASSES
    assert not missing


def _classes_in(hints):
    for hint in hints:
        yield from _classes_in(typing.get_args(hint)) if typing.get_args(hint) else [hint]
