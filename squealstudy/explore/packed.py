"""Packs columns of numbers for a page, as base64 of 16, 32 or 64 bits."""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

MISSING = 65535  # code of a number that is not known
WHOLE = MISSING - 1  # steps between the least and the largest number

Packed = dict[str, Any]  # a column as the page's script reads it


def packed_numbers(values: np.ndarray) -> Packed:
    """Numbers (n,) in 16 bits, in equal steps from the least to the largest; NaN for missing ones.

    They serve for curves and shares only: a number far below the largest keeps no digit. ``error``
    is the largest difference between a number and what is read again.
    """
    values = np.asarray(values, dtype=float)
    finite = np.isfinite(values)
    low, high = (values[finite].min(), values[finite].max()) if finite.any() else (0.0, 0.0)
    step = float(high - low) / WHOLE
    codes = np.full(len(values), MISSING, dtype="<u2")
    codes[finite] = np.round((values[finite] - low) / step) if step > 0 else 0
    error = step / 2
    return {"bits": 16, "low": float(low), "step": step, "error": error, "text": _text(codes)}


def packed_single(values: np.ndarray) -> Packed:
    """Numbers (n,) in 32 bits: each keeps six digits, however large the others are."""
    return {"bits": 32, "text": _text(np.asarray(values, dtype=float).astype("<f4"))}


def packed_whole(values: np.ndarray) -> Packed:
    """Whole numbers (n,) from 0 to 65534; MISSING stands for one that is not known."""
    values = np.asarray(values)
    if len(values) and (values.min() < 0 or values.max() > MISSING):
        raise ValueError("expected whole numbers of 16 bits")
    codes = values.astype("<u2")
    return {"bits": 16, "low": 0.0, "step": 1.0, "error": 0.0, "text": _text(codes)}


def packed_exact(values: np.ndarray | pd.Series) -> Packed:
    """Numbers (n,) in 64 bits, exactly."""
    return {"bits": 64, "error": 0.0, "text": _text(np.asarray(values, dtype="<f8"))}


def packed_words(words: Sequence[str], order: Sequence[str]) -> Packed:
    """Words (n,) by their index in `order`, which must have all of them."""
    index_of = {word: index for index, word in enumerate(order)}
    return packed_whole(np.array([index_of[word] for word in words], dtype=int))


def unpacked(packed: Packed) -> np.ndarray:
    """The numbers (n,) of a packed column, as the page's script has them."""
    raw = b64decode(packed["text"])
    if packed["bits"] == 64:
        return np.frombuffer(raw, dtype="<f8")
    if packed["bits"] == 32:
        return np.frombuffer(raw, dtype="<f4").astype(float)
    codes = np.frombuffer(raw, dtype="<u2")
    return np.where(codes == MISSING, np.nan, packed["low"] + packed["step"] * codes)


def _text(array: np.ndarray) -> str:
    return b64encode(np.ascontiguousarray(array).tobytes()).decode()
