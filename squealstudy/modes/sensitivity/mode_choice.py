"""Which complex modes of a design point are looked into."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ModeChoice:
    """All unstable modes, a number of modes by growth, or those nearest given frequencies.

    Attributes
    ----------
    count : int or None
        The modes of largest growth rate; None for all unstable ones.
    frequencies_hz : tuple of float
        Where there are any, the mode nearest each, by |lambda| / 2 pi.
    stability_tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    """

    count: int | None = None
    frequencies_hz: tuple[float, ...] = ()
    stability_tolerance: float = 0.0


def chosen_roots(lam: np.ndarray, choice: ModeChoice) -> list[complex]:
    """The chosen ones among the roots of a band, largest growth first; real roots are no modes."""
    modes = lam[lam.imag > 0]
    if choice.frequencies_hz and len(modes):
        distance = np.abs(np.abs(modes)[:, None] / (2 * np.pi) - np.array(choice.frequencies_hz))
        modes = modes[np.unique(distance.argmin(axis=0))]
    elif choice.count is None:
        modes = modes[modes.real / np.abs(modes) > choice.stability_tolerance]
    by_growth = modes[np.argsort(-modes.real, kind="stable")]
    return [complex(root) for root in by_growth[: choice.count]]
