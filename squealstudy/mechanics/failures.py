"""What makes a design point a failed one."""

from __future__ import annotations

import numpy as np

from squealstudy.errors import SquealstudyError

# the named errors, and those of the numerical libraries
FAILURES = (SquealstudyError, np.linalg.LinAlgError, FloatingPointError, ValueError)


def reason(error: Exception) -> tuple[str, str]:
    """Status and message of a design point that ended with one of FAILURES."""
    if isinstance(error, SquealstudyError):
        return getattr(error, "status", "failed"), str(error)
    return "failed", f"{type(error).__name__}: {error}"
