"""How far the cells of a method-stability study are as predicted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

WORKS = ("converged", "slow", "recovered")
MARGIN = 0.02  # of the prediction: cells nearer to the boundary are not judged


def agreement(cells: pd.DataFrame) -> dict[str, Any]:
    """Counts of outcomes, the share of judged cells that are as predicted, unflagged wrong ones.

    Parameters
    ----------
    cells : DataFrame
        Columns ``outcome``, ``flagged``, ``predicted`` (works below 1).

    Returns
    -------
    dict
        ``counts`` by outcome; ``agreement`` (None without a judged cell), ``judged``,
        ``unflagged_wrong``, ``unpredicted_failures``: judged cells within the predicted region
        where the method does not work.
    """
    works = cells["outcome"].isin(WORKS).to_numpy()
    predicted = cells["predicted"].to_numpy(float)
    judged = np.isfinite(predicted) & (np.abs(predicted - 1.0) > MARGIN)
    judged |= np.isinf(predicted)
    recovered = (cells["outcome"] == "recovered").to_numpy()  # the plain method failed, as it may
    same = recovered | (works == (predicted < 1.0))
    wrong = (cells["outcome"] == "wrong").to_numpy() & ~cells["flagged"].to_numpy(bool)
    return {
        "counts": {str(k): int(v) for k, v in cells["outcome"].value_counts().items()},
        "agreement": float(same[judged].mean()) if judged.any() else None,
        "judged": int(judged.sum()),
        "unflagged_wrong": int(wrong.sum()),
        "unpredicted_failures": int((judged & (predicted < 1.0) & ~works).sum()),
    }
