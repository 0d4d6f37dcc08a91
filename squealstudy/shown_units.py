"""Units in which values are shown: with a prefix, or as the study file writes them."""

from __future__ import annotations

PREFIXES = (("G", 1e-9), ("M", 1e-6), ("k", 1e-3))
PREFIXED = ("Pa", "N")  # units that take a prefix
MAX_PREFIXED = 1e6  # of a number before one: 5.4e17 Pa/m3 is no 5.4e8 GPa/m3


class UnitAsWritten(str):
    """An SI unit of numbers in tables, for which the study file has another: shown is that one.

    Attributes
    ----------
    written : str
        The unit of the file, as ``bar``.
    size : float
        Of it in this unit, as 1e5 of ``Pa``.
    """

    written: str
    size: float

    def __new__(cls, unit: str, written: str, size: float) -> UnitAsWritten:
        """The text is `unit`."""
        text = super().__new__(cls, unit)
        text.written, text.size = written, size
        return text

    def __getnewargs__(self) -> tuple[str, str, float]:  # type: ignore[override]
        """For copies: pandas makes deep ones of the facts of a table."""
        return str(self), self.written, self.size


def as_written(unit: str) -> tuple[str, float]:
    """The unit of the study file where it has another, else `unit`; and the factor to it."""
    return (unit.written, 1.0 / unit.size) if isinstance(unit, UnitAsWritten) else (unit, 1.0)


def prefixed(unit: str, largest: float) -> tuple[str, float]:
    """Unit in which values up to `largest` are shown, and the factor from SI to it."""
    if isinstance(unit, UnitAsWritten):
        return as_written(unit)
    prefixes = PREFIXES if unit.startswith(PREFIXED) else PREFIXES[2:] if unit == "m" else ()
    fitting = ((p, f) for p, f in prefixes if 1.0 <= largest * f < MAX_PREFIXED)
    prefix, factor = next(fitting, ("", 1.0))
    return prefix + unit, factor
