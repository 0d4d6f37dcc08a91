"""Tables of results as data frames whose errors propose columns with similar names."""

from __future__ import annotations

from typing import Any

import pandas as pd

from squealstudy.errors import UnknownColumnError
from squealstudy.wording import did_you_mean


class ResultFrame(pd.DataFrame):
    """A DataFrame with its own error for unknown columns. Frames made from it are plain ones."""

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
