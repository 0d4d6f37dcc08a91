"""The sections of a study file that say what varies, and how sweeps are combined."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from squealstudy.study.section import FloatList, Section

Scale = Literal["linear", "log"]
DistributionName = Literal["uniform", "normal", "truncated_normal", "lognormal"]

ADDED_MASS = "added_mass."  # beginning of parameters that add a mass, kg, on the set named after it
MOST_LEVELS = 1_000_000
# a plan needs 8 bytes for each sweep and 16 for the id of each point: some gigabytes for so many
MOST_POINTS = 100_000_000
MOST_REFINEMENTS = 10
LARGEST_SEED = 2**32 - 1
QUANTITY = ("number", "string")  # types in the JSON Schema of a value of a parameter


class SweepSection(Section):
    """One parameter that varies: a list of values, or a range."""

    parameter: str = Field(
        description="a parameter of the model, or <component>.modes[12-14].frequency_scale, "
        "<component>.modes[3,7].damping_ratio"
    )
    values: FloatList | None = Field(
        default=None,
        description='the values, SI units or texts like "12 bar"; grid and zip only',
        json_schema_extra={"minItems": 1, "items": {"type": list(QUANTITY)}},
    )
    start: float | None = Field(
        default=None,
        description='first value of a range, SI units or a text like "12 bar"',
        json_schema_extra={"type": list(QUANTITY)},
    )
    stop: float | None = Field(
        default=None,
        description="last value of a range, as start",
        json_schema_extra={"type": list(QUANTITY)},
    )
    num: int | None = Field(
        default=None,
        ge=1,
        le=MOST_LEVELS,
        description="number of values from start to stop, ends included",
    )
    scale: Scale = Field(default="linear", description="spacing of the values from start to stop")
    distribution: DistributionName = Field(
        default="uniform",
        description="for random designs: uniform from start to stop (or in the logarithm), normal "
        "(mean, std), truncated_normal (mean, std, start, stop), lognormal (median, sigma)",
    )
    mean: float | None = Field(
        default=None,
        description="mean of a normal distribution, as start",
        json_schema_extra={"type": list(QUANTITY)},
    )
    std: float | None = Field(
        default=None,
        gt=0,
        description="standard deviation of a normal distribution, as start",
        json_schema_extra={"type": list(QUANTITY)},
    )
    median: float | None = Field(
        default=None,
        gt=0,
        description="median of a lognormal distribution, as start",
        json_schema_extra={"type": list(QUANTITY)},
    )
    sigma: float | None = Field(
        default=None,
        gt=0,
        description="standard deviation of the natural logarithm (lognormal): about the relative "
        "scatter",
    )


DesignType = Literal["grid", "zip", "sobol", "latin_hypercube", "sobol_indices", "boundary"]


def _design_type(name: object) -> object:
    """The name unchanged; an error of its own for the name that SALib uses."""
    if name == "saltelli":
        raise ValueError("the sample of Saltelli et al. is named 'sobol_indices' here")
    return name


class DesignSection(Section):
    """How sweeps are combined to design points."""

    type: Annotated[DesignType, BeforeValidator(_design_type)] = Field(
        default="grid",
        description="grid: all combinations; zip: values side by side; sobol, latin_hypercube: "
        "random points that fill the ranges; sobol_indices: the sample of Sobol indices; boundary: "
        "a grid that is refined where stability changes",
    )
    samples: int | None = Field(
        default=None,
        ge=1,
        le=MOST_POINTS,
        description="number of points (sobol and latin_hypercube); for sobol_indices that of base "
        "points, a power of two: there are samples x (sweeps + 2) design points",
    )
    seed: int = Field(
        default=0,
        ge=0,
        le=LARGEST_SEED,
        description="seed of the random numbers (sobol, latin_hypercube, sobol_indices)",
    )
    levels: int = Field(
        default=3,
        ge=1,
        le=MOST_REFINEMENTS,
        description="how often a cell of a boundary design may be halved: its map is as fine as a "
        "grid of (num - 1) 2^levels + 1 values for each sweep",
    )
    limit: int = Field(
        default=20_000, ge=1, le=10**9, description="more points than this need the option --yes"
    )
