"""The exceptions that make one design point a failed one, instead of ending a study."""

from __future__ import annotations

import numpy as np

from squealstudy.errors import SquealstudyError

# what makes a design point a failed row: the named errors, and whatever a mistake in the mechanics
# raises; not what the machine refuses (OSError, MemoryError, threads that cannot be started)
FAILURES = (
    *(SquealstudyError, np.linalg.LinAlgError, ArithmeticError, ValueError),
    *(LookupError, TypeError, AttributeError, AssertionError),
)


def reason(error: Exception) -> tuple[str, str]:
    """Status and message of a design point that ended with one of FAILURES."""
    if isinstance(error, SquealstudyError):
        return getattr(error, "status", "failed"), str(error)
    return "failed", f"{type(error).__name__}: {error}"
