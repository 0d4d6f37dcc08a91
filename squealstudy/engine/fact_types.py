"""Types of facts in files of results, by which every file is checked."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

MOST_COUNTED = 2**53  # whole numbers up to here are floats exactly
MOST_LETTERS = 20_000  # most letters of a sentence; the verdict on 100 variables has 10,000

Count = Annotated[int, Field(ge=0, le=MOST_COUNTED)]
WholeNumber = Annotated[int, Field(ge=-MOST_COUNTED, le=MOST_COUNTED)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Name = Annotated[str, StringConstraints(max_length=300)]
Text = Annotated[str, StringConstraints(max_length=MOST_LETTERS)]
Range = Annotated[list[Finite], Field(min_length=2, max_length=2)]  # lowest and highest


class FactGroup(BaseModel):
    """Facts that belong together. Unknown ones are allowed, and never read."""

    model_config = ConfigDict(extra="allow", strict=True)
