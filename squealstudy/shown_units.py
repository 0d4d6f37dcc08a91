"""Units in which values are shown: those of the study file, or SI units with a prefix."""

from __future__ import annotations

PREFIXES = (("G", 1e-9), ("M", 1e-6), ("k", 1e-3))
PREFIXED = ("Pa", "N")  # units that take a prefix
MAX_PREFIXED = 1e6  # largest number before a prefix: 5.4e17 Pa/m3 is not shown as 5.4e8 GPa/m3


class UnitAsWritten(str):
    """The SI unit of numbers in tables, with the unit of the study file in which they are shown.

    Attributes
    ----------
    written : str
        The unit of the file, such as ``bar``.
    size : float
        Size of that unit in this one, such as 1e5 for ``bar`` in ``Pa``.
    """

    written: str
    size: float

    def __new__(cls, unit: str, written: str, size: float) -> UnitAsWritten:
        """Make a unit whose text is `unit`."""
        text = super().__new__(cls, unit)
        text.written, text.size = written, size
        return text

    def __getnewargs__(self) -> tuple[str, str, float]:  # type: ignore[override]
        """Arguments for copies; pandas makes deep copies of the facts of a table."""
        return str(self), self.written, self.size


def as_written(unit: str) -> tuple[str, float]:
    """The unit in which values are shown, that of the study file if known, and the factor to it."""
    return (unit.written, 1.0 / unit.size) if isinstance(unit, UnitAsWritten) else (unit, 1.0)


def prefixed(unit: str, largest: float) -> tuple[str, float]:
    """Unit in which values up to `largest` are shown, and the factor from SI to it."""
    if isinstance(unit, UnitAsWritten):
        return as_written(unit)
    prefixes = PREFIXES if unit.startswith(PREFIXED) else PREFIXES[2:] if unit == "m" else ()
    fitting = ((p, f) for p, f in prefixes if 1.0 <= largest * f < MAX_PREFIXED)
    prefix, factor = next(fitting, ("", 1.0))
    return prefix + unit, factor
