"""Tables of results as frames that name the columns nearest to one that they do not have."""

from __future__ import annotations

from typing import Any

import pandas as pd

from squealstudy.errors import UnknownColumnError
from squealstudy.wording import did_you_mean


class ResultFrame(pd.DataFrame):
    """A DataFrame, but for what it says of an unknown column; what is made of it is plain."""

    @property
    def _constructor(self) -> type[pd.DataFrame]:
        return pd.DataFrame

    def __getitem__(self, key: Any) -> Any:
        """Column of a DataFrame; UnknownColumnError, a KeyError, for an unknown name."""
        try:
            return super().__getitem__(key)
        except KeyError:
            names = [key] if isinstance(key, str) else key if isinstance(key, list) else []
            unknown = [name for name in names if isinstance(name, str) and name not in self.columns]
            if not unknown:
                raise
            columns = [str(column) for column in self.columns]
            hint = did_you_mean(unknown[0], columns) or f"; it has {', '.join(columns)}"
            raise UnknownColumnError(f"this table has no column '{unknown[0]}'{hint}") from None
