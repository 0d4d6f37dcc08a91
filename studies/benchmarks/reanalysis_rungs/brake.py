"""The generated brake, made ready, and the boxes of design points it is measured over."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import squealstudy
from squealstudy.laws import contact_law
from squealstudy.models.catalogue import MODELS
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes.reanalysis.brake_problem import BrakeProblem
from squealstudy.paths import cache_directory
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import PreparedModel, prepare

NOMINAL = OperatingPoint(0.5, 12e5, 0.5, contact_law())
ENDS = (2e5, 30e5)  # Pa
SPEEDS = (0.1, 3.0)  # m/s
MODE = ("caliper", 8)
BOTTOM_HZ = 500.0
SOURCES = ("reduction", "models")  # a change there is another brake


def prepared(mesh: str, top: float) -> PreparedModel:
    """The brake of a mesh density up to `top` Hz, from the cache where it was made before."""
    path = cache_directory() / "benchmark" / f"{mesh}_{top:.0f}_{_digest()}.pkl"
    if path.is_file():
        return pickle.loads(path.read_bytes())  # own cache, not a foreign file
    definition = MODELS["disc_brake"]
    options = {o.name: o.choices[0] for o in definition.options} | {"mesh": mesh}
    settings = ReductionSettings(1.5 * top, 1.5 * top, 1.125 * top, 3e-5)
    others = [replace(NOMINAL, brake_pressure=p) for p in ENDS]
    made = prepare(definition.build(options, definition.defaults()), NOMINAL, settings, others)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(made))
    return made


def _digest() -> str:
    root = Path(squealstudy.__file__).parent
    files = sorted(p for s in SOURCES for p in (root / s).rglob("*.py"))
    return hashlib.sha256(b"".join(p.read_bytes() for p in files)).hexdigest()[:12]


def _friction(t: np.ndarray) -> DesignState:
    return DesignState(replace(NOMINAL, friction=0.35 + 0.35 * float(t[0])))


def _scale(t: np.ndarray) -> DesignState:
    """Frequency of one component mode by 0.5 to 1.5, even in its square."""
    return DesignState(NOMINAL, {MODE: float(np.sqrt(1.25 + t[0]))})


def _damping(t: np.ndarray) -> DesignState:
    return DesignState(NOMINAL, {}, {MODE: 0.05 + 0.05 * float(t[0])})


def _map(t: np.ndarray) -> DesignState:
    """Friction, logarithm of the pressure."""
    pressure = ENDS[0] * (ENDS[1] / ENDS[0]) ** ((float(t[1]) + 1) / 2)
    return DesignState(
        replace(NOMINAL, friction=0.35 + 0.35 * float(t[0]), brake_pressure=pressure)
    )


def _box(t: np.ndarray) -> DesignState:
    """Friction, logarithm of the pressure, inverse of the speed."""
    friction = 0.35 + 0.35 * float(t[0])
    pressure = ENDS[0] * (ENDS[1] / ENDS[0]) ** ((float(t[1]) + 1) / 2)
    slow, fast = (1 / v for v in SPEEDS)
    speed = 1 / (fast + (slow - fast) * (float(t[2]) + 1) / 2)
    return DesignState(
        replace(NOMINAL, friction=friction, brake_pressure=pressure, sliding_speed=speed)
    )


BOXES: dict[str, tuple[int, Callable[[np.ndarray], DesignState]]] = {
    "mu": (1, _friction),
    "scale": (1, _scale),
    "damping": (1, _damping),
    "map": (2, _map),
    "box": (3, _box),
}


def brake_problem(mesh: str, top: float, box: str) -> BrakeProblem:
    """The brake over one of the boxes."""
    dimension, state_at = BOXES[box]
    return BrakeProblem(prepared(mesh, top), dimension, state_at, (BOTTOM_HZ, top))
