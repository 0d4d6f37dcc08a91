"""Numbers as text with as many decimals as usual, and never fewer digits than tell them apart."""

from __future__ import annotations

LEAST_DIGITS = 3


def in_digits(value: float, decimals: int = 0) -> str:
    """`value` with fixed decimals; in significant digits where those would leave less than two.

    A slow machine's 0.00012 Hz is not "0 Hz".
    """
    if value and abs(value) < 10.0 ** (1 - decimals):
        return f"{value:.{LEAST_DIGITS}g}"
    return f"{value:.{decimals}f}"
