"""Tasks of tests of clusters, in a file that workers can import."""

from __future__ import annotations

import os
import time

from squealstudy.errors import ParameterError


def process(seconds: float) -> int:
    """Number of the process that takes so long."""
    time.sleep(seconds)
    return os.getpid()


def refused(name: str) -> None:
    """An error that cannot be made of its text."""
    raise ParameterError(name, "too large")


def die(told: str) -> None:
    """Write a line to a file, then end the process as a kill does."""
    with open(told, "a", encoding="utf-8") as file:
        file.write("died\n")
    os._exit(9)
