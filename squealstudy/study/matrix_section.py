"""The terms of a family of matrices in a study file."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from squealstudy.study.section import Section
from squealstudy.study.source import shown


def _as_text(value: Any) -> str:
    """A coefficient as the text of an expression, whether given as one or as a number."""
    if isinstance(value, str):
        return value
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value):
        raise ValueError(f"expected a number or an expression in quotes, got {shown(value)}")
    return repr(value)


Coefficient = Annotated[str, BeforeValidator(_as_text)]


class TermSection(Section):
    """One summand of the mass, damping or stiffness: a matrix times its coefficient."""

    matrix: Literal["M", "C", "K"] = Field(description="mass, damping or stiffness")
    file: str = Field(
        min_length=1,
        description="Matrix Market, MATLAB, Harwell-Boeing or SciPy npz file, in the model's "
        "folder or absolute",
    )
    variable: str | None = Field(
        default=None, description="which matrix, where the file holds several"
    )
    coefficient: Coefficient = Field(
        default="1.0",
        description="number, or expression of parameters: + - * / ** brackets pi e sin cos tan "
        "asin acos atan sqrt exp log log10 abs min max",
        json_schema_extra={"type": ["string", "number"]},
    )
