"""Where squealstudy keeps what it can make again."""

from __future__ import annotations

import os
from pathlib import Path

ENVIRONMENT = "SQUEALSTUDY_CACHE"


def cache_directory() -> Path:
    """$SQUEALSTUDY_CACHE, else the user's cache directory; not necessarily there yet."""
    if os.environ.get(ENVIRONMENT):
        return Path(os.environ[ENVIRONMENT])
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "squealstudy"
