"""The band of the modes to solve for, and the component-mode basis that is made for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.mechanics.defaults import (
    ASSEMBLY_CUTOFF_FACTOR,
    BASIS_TOLERANCE,
    COMPONENT_CUTOFF_FACTOR,
    TRANSIENT_BASIS,
    band_of,
)
from squealstudy.reduction.cmt import ReductionSettings

if TYPE_CHECKING:
    from squealstudy.models.parameter import ModelDefinition

LOAD_FACTOR = 1.125  # assembly modes up to this times the band are loads of the enrichment
SMALL_MODEL = np.inf  # Hz: a cutoff above every mode; bases of minimal models are complete


def reduction_settings(
    meshed: bool,
    top_hz: float,
    component_factor: float,
    assembly_factor: float,
    tolerance: float,
    enrichment: bool,
) -> ReductionSettings:
    """Settings of a basis for a band up to `top_hz` [Hz]; models not `meshed` keep all modes."""
    if not meshed:
        return ReductionSettings(SMALL_MODEL, SMALL_MODEL, 0.0, tolerance)
    loads = LOAD_FACTOR * top_hz if enrichment else 0.0
    return ReductionSettings(component_factor * top_hz, assembly_factor * top_hz, loads, tolerance)


@dataclass(frozen=True)
class Basis:
    """Band of the modes, and the component-mode basis that is made for it.

    Models without a mesh keep all their coordinates: these settings of a basis do not matter there.

    Attributes
    ----------
    band_hz : (low, high)
        Band of the modes, Hz, as in [modes] of study files.
    component_cutoff_factor, assembly_cutoff_factor : float
        Component and assembly modes are kept up to these factors times the top of the band.
    tolerance : float
        Enrichment shapes with relative singular values below this are left out.
    enrichment, residual_responses : bool
        Whether the basis holds static responses to friction forces, and to the residuals of reduced
        modes in the unreduced equations.
    tells_error : bool
        Whether there is a finer model, which tells how far reduced roots are from unreduced ones.
    ranges : mapping of str -> (low, high)
        Ranges of parameters that one basis is made for: pressure, contact laws, frequency scales.

    Raises
    ------
    ParameterError
        Where `band_hz` is no band.
    """

    band_hz: tuple[float, float]
    component_cutoff_factor: float = COMPONENT_CUTOFF_FACTOR
    assembly_cutoff_factor: float = ASSEMBLY_CUTOFF_FACTOR
    tolerance: float = BASIS_TOLERANCE
    enrichment: bool = True
    residual_responses: bool = True
    tells_error: bool = True
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "band_hz", checked_band(self.band_hz))

    @classmethod
    def of_modes(cls, model: ModelDefinition) -> Basis:
        """Settings that studies of complex modes have by default."""
        return cls(band_of(model.name))

    @classmethod
    def in_time(cls, model: ModelDefinition) -> Basis:
        """Settings that studies in time and of limit cycles have by default."""
        return cls(
            band_of(model.name),
            tolerance=TRANSIENT_BASIS["tolerance"],
            assembly_cutoff_factor=TRANSIENT_BASIS["assembly_cutoff_factor"],
            residual_responses=bool(TRANSIENT_BASIS["residual_responses"]),
            tells_error=False,
        )

    def settings(self, meshed: bool) -> ReductionSettings:
        """Settings for the reduction of a model that is `meshed` or not."""
        return reduction_settings(
            meshed,
            self.band_hz[1],
            self.component_cutoff_factor,
            self.assembly_cutoff_factor,
            self.tolerance,
            self.enrichment,
        )

    @property
    def identity(self) -> tuple[object, ...]:
        """Hashable identity of a basis."""
        ranges = tuple(sorted(self.ranges.items()))
        numbers = (self.component_cutoff_factor, self.assembly_cutoff_factor, self.tolerance)
        flags = (self.enrichment, self.residual_responses, self.tells_error)
        return (self.band_hz, *numbers, *flags, ranges)


def checked_band(band_hz: object) -> tuple[float, float]:
    """A band [Hz] as two floats; ParameterError where it is none."""
    try:
        ends = list(band_hz)  # type: ignore[call-overload]
    except TypeError:
        raise ParameterError("band", f"expected [low, high] in Hz, got {band_hz!r}") from None
    if len(ends) != 2:
        raise ParameterError("band", f"expected two frequencies [low, high], got {band_hz!r}")
    for end in ends:
        if isinstance(end, bool | np.bool_) or not isinstance(end, int | float | np.number):
            raise ParameterError("band", f"expected a number of Hz, got {end!r}")
        if not np.isfinite(end):
            raise ParameterError("band", f"expected a finite number of Hz, got {end!r}")
    low, high = (float(end) for end in ends)
    if not 0.0 <= low < high:
        raise ParameterError("band", f"expected 0 <= low < high, got {band_hz!r}")
    return low, high
