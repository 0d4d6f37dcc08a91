"""Units in which values are shown: those of the study file, or SI units with a prefix."""

from __future__ import annotations

from typing import Any

PREFIXES = (("G", 1e-9), ("M", 1e-6), ("k", 1e-3))
PREFIXED = ("Pa", "N")  # units that take a prefix
FULL_UNIT = 1.0 - 1e-9  # values from this share of a unit on are shown in the unit
MAX_PREFIXED = 1e6  # largest number before a prefix: 5.4e17 Pa/m3 is not shown as 5.4e8 GPa/m3


class UnitAsWritten(str):
    """The SI unit of numbers in tables, with the unit of the study file in which they are shown.

    Attributes
    ----------
    written : str
        The unit of the file, such as ``bar``.
    size : float
        Size of that unit in this one, such as 1e5 for ``bar`` in ``Pa``.
    others : tuple of (str, float)
        Other units of the file and their sizes, such as ``kN`` beside ``N``.
    """

    written: str
    size: float
    others: tuple[tuple[str, float], ...]

    def __new__(
        cls, unit: str, written: str, size: float, others: tuple[tuple[str, float], ...] = ()
    ) -> UnitAsWritten:
        """Make a unit whose text is `unit`."""
        text = super().__new__(cls, unit)
        text.written, text.size, text.others = written, size, others
        return text

    def __getnewargs__(self) -> tuple[Any, ...]:
        """Arguments for copies; pandas makes deep copies of the facts of a table."""
        return str(self), self.written, self.size, self.others

    def of_size(self, largest: float) -> tuple[str, float]:
        """The largest unit of the file of which `largest` is one at least, else the least one."""
        units = sorted([(self.written, self.size), *self.others], key=lambda unit: -unit[1])
        fitting = (unit for unit in units if largest >= unit[1] * FULL_UNIT)
        return next(fitting, (self.written, self.size) if largest == 0.0 else units[-1])


def as_written(unit: str) -> tuple[str, float]:
    """The unit in which values are shown, that of the study file if known, and the factor to it."""
    return (unit.written, 1.0 / unit.size) if isinstance(unit, UnitAsWritten) else (unit, 1.0)


def prefixed(unit: str, largest: float) -> tuple[str, float]:
    """Unit in which values up to `largest` are shown, and the factor from SI to it."""
    if isinstance(unit, UnitAsWritten):
        written, size = unit.of_size(largest)
        return written, 1.0 / size
    prefixes = PREFIXES if unit.startswith(PREFIXED) else PREFIXES[2:] if unit == "m" else ()
    fitting = ((p, f) for p, f in prefixes if 1.0 <= largest * f < MAX_PREFIXED)
    prefix, factor = next(fitting, ("", 1.0))
    return prefix + unit, factor
