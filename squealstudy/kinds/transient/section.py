"""The [transient] section of a study file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    Strict,
    model_validator,
)
from pydantic_core import PydanticCustomError

from squealstudy.errors import ParameterError
from squealstudy.mechanics.defaults import TRANSIENT_BASIS
from squealstudy.motion.integrator import (
    CONTACT_ITERATION_TOLERANCE,
    SLOW_TOLERANCE,
    KernelIntegrator,
    integrator,
    integrators,
)
from squealstudy.study.section import Section
from squealstudy.study.sections import StudyDefinition

MOST_STEPS = 1e9  # of a run
PILOT_POINTS = 8  # a pilot run costs little if a meshed model has at least this many points
AUTO = "auto"
WORKING_POINT = "working_point"  # where a run starts by default
STUCK = "stuck"  # at rest relative to what slides there
CYCLE = "cycle:"  # begins a start on a limit cycle
WINDOWS = 20  # parts of a run whose speed or pressure changes


def _modes(values: tuple[int | float, ...]) -> tuple[int | float, ...]:
    if any(v < 1 for v in values) or len(set(values)) < len(values):
        raise ValueError("expected distinct mode numbers from 1")
    return values


def _sensors(values: tuple[int | float, ...]) -> tuple[int | float, ...]:
    """Whole numbers are modes; a number with a point makes it a band."""
    if not values:
        raise ValueError("expected a band [low, high] in Hz or mode numbers, got an empty list")
    if all(isinstance(v, int) for v in values):
        return _modes(values)
    if len(values) != 2 or not 0 <= values[0] < values[1]:
        raise ValueError("expected a band [low, high] in Hz with 0 <= low < high")
    return values


def _method(value: str) -> str:
    """``auto`` or an integrator of the kernel: those of the package, of extensions, in Python."""
    if value == AUTO:
        return value
    methods = [AUTO, *(k for k, v in integrators().items() if issubclass(v, KernelIntegrator))]
    if value not in methods:
        names = ", ".join(f"'{name}'" for name in methods[:-1]) + f" or '{methods[-1]}'"
        raise PydanticCustomError("literal_error", "no integrator", {"expected": names})
    return value


def _points(values: object) -> object:
    """Pairs, or one clear error."""
    pairs = isinstance(values, list | tuple) and all(
        isinstance(point, list | tuple) and len(point) == 2 for point in values
    )
    if not pairs:
        raise ValueError("expected points [[time, value], [time, value]], times in s")
    return values


Point = Annotated[tuple[float, float], Strict(False)]


class ScheduleTable(Section):
    """A parameter over time: straight lines between points, constant behind the last."""

    points: Annotated[tuple[Point, ...], Strict(False), BeforeValidator(_points)] = Field(
        default=(), description="[time s, value], in the order of time"
    )
    file: str | None = Field(
        default=None,
        min_length=1,
        description="text file beside the study with a line of names, 'time' and the parameter's "
        "among them, then a line of numbers a point",
    )
    relative: bool = Field(
        default=False,
        description="values are shares of each design point's own; else in the parameter's unit",
    )

    @model_validator(mode="after")
    def _points_or_file(self) -> Self:
        if (self.file is None) == ("points" not in self.model_fields_set):
            raise ValueError("expected points = [[time, value], ..] or file = '...'")
        return self


Sensors = Annotated[tuple[int | float, ...], Strict(False), AfterValidator(_sensors)]


class TransientSection(Section):
    """How design points are integrated in time, and what is kept of them."""

    duration: float = Field(default=0.1, gt=0, description="simulated time, s")
    step: float = Field(default=1e-6, gt=0, description="time step, s")
    method: Annotated[str, AfterValidator(_method)] = Field(
        default=AUTO,
        description="'exponential': free modes exact, contact forces by the trapezoidal rule with "
        "Newmark's iteration. 'newmark': beta 1/4, gamma 1/2, fixed Jacobian. 'newmark_newton': "
        "the slow reference. One of an extension. 'auto': exponential; newmark in the hybrid "
        "representation and with prewarp",
    )
    representation: Literal["modal", "hybrid"] = Field(
        default="modal",
        description="component-mode coordinates, or contact layers as finite elements: the slow "
        "reference",
    )
    layers: int = Field(
        default=1,
        ge=0,
        le=100,
        description="element layers about the contact that the hybrid representation keeps",
    )
    start: str = Field(
        default=WORKING_POINT,
        min_length=1,
        description="'working_point'. 'stuck': at its displacements, all contact at rest relative "
        "to what slides there. A results directory: its final state goes on, as a deviation from "
        "each design point's steady sliding. 'cycle:DIRECTORY/ID': a cycle of results of limit "
        "cycles",
    )
    start_point: str | None = Field(
        default=None, description="point_id in that directory, where it has more than one"
    )
    start_scale: float = Field(
        default=1.0,
        gt=0,
        le=1e3,
        description="factor on the state that a run starts with: 0.9 and 1.1 of an unstable cycle "
        "are below and above the kick that starts squeal",
    )
    sliding_speed: ScheduleTable | None = Field(
        default=None,
        description="sliding speed over time, m/s, negative the other way: a stop, a pull-away. "
        "Steady sliding, complex modes and friction's slope stay those of [parameters]",
    )
    pressure: ScheduleTable | None = Field(
        default=None, description="brake pressure over time, Pa; likewise"
    )
    windows: int | None = Field(
        default=None,
        ge=1,
        le=1000,
        description="parts of equal length of a run whose speed or pressure changes, each with "
        f"levels, class and line in the table windows; {WINDOWS} by default",
    )
    perturbation: float = Field(
        default=1e-3,
        ge=0,
        description="largest initial velocity at a contact point, m/s; nothing is added to a "
        "continued state unless this is given",
    )
    perturb_modes: Annotated[tuple[int, ...], Strict(False), AfterValidator(_modes)] = Field(
        default=(),
        description="assembly modes (from 1) that carry it; the unstable complex modes by default",
    )
    save_every: int = Field(
        default=10, ge=0, le=10**9, description="steps between kept rows of histories; 0 keeps none"
    )
    sensors: Sensors | None = Field(
        default=None,
        description="band [low, high] in Hz of the modal sensors, or a list of assembly modes "
        "(integers, from 1); the band of [modes] by default",
    )
    friction: Literal["regularised", "smooth"] = Field(
        default="regularised",
        description="friction below the bound: straight (Coulomb with a corner) or tanh",
    )
    tolerance: float | None = Field(
        default=None,
        gt=0,
        le=0.1,
        description="force imbalance at which a step is corrected a last time, relative; friction "
        f"forces may change by ten times this. By default {CONTACT_ITERATION_TOLERANCE:g}, at "
        f"which it is far below the error of the step, and {SLOW_TOLERANCE:g} for the slow "
        "references",
    )
    contact_factor: float = Field(
        default=1.0,
        ge=0,
        le=1000,
        description="factor k_c on the contact stiffness of the fixed Jacobian",
    )
    prewarp: bool = Field(
        default=False,
        description="correct Newmark's period error of free modes; where contact opens levels come "
        "out worse (studies/integrators.toml)",
    )
    storage: Literal["double", "single"] = Field(
        default="double", description="precision in which the observation matrix is stored"
    )
    slope_pilot: Literal["auto", "always", "never"] = Field(
        default="auto",
        description="one design point once more with twice its slope of friction k_t: what the "
        "automatic k_t errs by; auto: of minimal models always, of meshed ones from "
        f"{PILOT_POINTS} design points on",
    )
    stop: Literal["end", "settled"] = Field(
        default="end",
        description="'settled': a run ends before its duration once it is a lasting vibration of "
        "known level with nothing else rising, or has decayed as predicted",
    )
    settle_tolerance: float = Field(
        default=0.01,
        gt=0,
        le=0.1,
        description="how well the torque's RMS must be known where a run may end, relative",
    )
    batch: int = Field(
        default=8, ge=1, le=64, description="design points that advance together in a worker"
    )
    modes_below: float | None = Field(
        default=None,
        gt=0,
        description="assembly modes up to this frequency [Hz] are kept; all by default",
    )
    pod_vectors: int = Field(
        default=0,
        ge=0,
        le=2000,
        description="vectors that repair the truncated basis (with modes_below): of the growing "
        "modes of the training designs, then of their runs",
    )
    pod_duration: float = Field(default=0.03, gt=0, description="length of the training runs, s")
    pod_step: float | None = Field(
        default=None,
        gt=0,
        description="time step of the training run, s; that of the study by default. Runs with "
        "other steps are comparable in one basis only",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        """Raise ValueError for keys that contradict each other."""
        if self.duration < self.step:
            raise ValueError(
                f"duration {self.duration:g} s is shorter than one step of {self.step:g} s"
            )
        if self.duration / self.step > MOST_STEPS:
            raise ValueError(f"{self.duration / self.step:.3g} steps: at most {MOST_STEPS:.0g}")
        if not self.continued and self.start_point is not None:
            raise ValueError("start_point needs a results directory as start")
        if self.start_cycle and self.start_point is not None:
            raise ValueError("start_point is not for a cycle: its id names its design point")
        if self.start == STUCK and self.representation == "hybrid":
            raise ValueError('start = "stuck" is for representation = "modal"')
        if self.start_cycle and self.representation == "hybrid":
            raise ValueError('a cycle as start is for representation = "modal"')
        if not self.continued and self.start_scale != 1.0:
            raise ValueError("start_scale needs a state to start with")
        if self.pod_vectors and self.modes_below is None:
            raise ValueError("pod_vectors repair a truncated basis: give modes_below too")
        if self.representation == "hybrid":
            self._refuse_modal_settings()
        self._refuse_settled_levels()
        try:
            _ = self.method == AUTO or self.integrator
        except ParameterError as error:
            raise ValueError(f'{error.key} is not for method = "{self.method}"') from None
        if self.pod_step is not None and not self.pod_vectors:
            raise ValueError("pod_step is of the training run: give pod_vectors too")
        if self.pod_step is not None and not self.pod_step <= self.pod_duration:
            raise ValueError(f"pod_step {self.pod_step:g} s is longer than pod_duration")
        if self.stop == "end" and "settle_tolerance" in self.model_fields_set:
            raise ValueError('settle_tolerance needs stop = "settled"')
        return self

    def _refuse_settled_levels(self) -> None:
        """ValueError for settings that need levels that settle, where speed or pressure change."""
        if not self.changes:
            if self.windows is not None:
                raise ValueError("windows are of a run whose sliding_speed or pressure changes")
            return
        name = "pressure" if self.sliding_speed is None else "sliding_speed"
        if self.representation == "hybrid":
            raise ValueError(f'{name} over time is for representation = "modal"')
        if self.stop == "settled":
            raise ValueError(f'{name} changes over time: nothing settles, expected stop = "end"')
        if self.pressure is not None and self.modes_below is not None:
            raise ValueError("pressure over time needs all modes, which carry it: no modes_below")
        if self.slope_pilot == "always":
            raise ValueError(f"{name} changes over time: slope_pilot compares levels that settle")

    def _refuse_modal_settings(self) -> None:
        """ValueError for settings that the hybrid kernel does not have."""
        if self.modes_below is not None:
            raise ValueError("modes_below truncates the modal representation, not the hybrid one")
        if self.stop == "settled":
            raise ValueError('stop = "settled" is for the modal representation, not the hybrid one')
        modal = {
            "method": self.method in ("exponential", "newmark_newton"),
            "prewarp": self.prewarp,
            "contact_factor": self.contact_factor != 1.0,
            "storage": self.storage == "single",
        }
        for name, used in modal.items():
            if used:
                setting = getattr(self, name)
                raise ValueError(f'{name} = {setting!r} is not for representation = "hybrid"')

    @property
    def integrator(self) -> KernelIntegrator:
        """The integrator of `method`, ``auto`` resolved, with the options that are given here."""
        needs_newmark = self.prewarp or self.representation == "hybrid"
        name = self.method if self.method != AUTO else "newmark" if needs_newmark else "exponential"
        options: dict[str, Any] = {
            "contact_factor": self.contact_factor,
            "prewarp": self.prewarp,
            "single_storage": self.storage == "single",
        }
        defaults = {"contact_factor": 1.0, "prewarp": False, "single_storage": False}
        made_integrator = integrator(name, {k: v for k, v in options.items() if v != defaults[k]})
        assert isinstance(made_integrator, KernelIntegrator)
        return made_integrator

    @property
    def balance_tolerance(self) -> float:
        """Tolerance of the force balance in each step, the default resolved."""
        if self.tolerance is not None:
            return self.tolerance
        return SLOW_TOLERANCE if self.representation == "hybrid" else self.integrator.tolerance

    @property
    def training(self) -> TransientSection:
        """Settings of the training run: by default method, steady and without other changes."""
        step = self.step if self.pod_step is None else self.pod_step
        changes = {"duration": self.pod_duration, "step": step, "method": AUTO}
        plain = {"prewarp": False, "tolerance": None, "contact_factor": 1.0, "storage": "double"}
        steady = {"sliding_speed": None, "pressure": None, "windows": None}
        return self.model_copy(update=changes | plain | steady)

    @property
    def changes(self) -> bool:
        """Whether speed or pressure change during a run."""
        return self.sliding_speed is not None or self.pressure is not None

    @property
    def n_windows(self) -> int:
        """Windows of a run whose speed or pressure changes."""
        return WINDOWS if self.windows is None else self.windows

    @property
    def continued(self) -> bool:
        """Whether a run starts with the final state of another run, or on a cycle."""
        return self.start not in (WORKING_POINT, STUCK)

    @property
    def start_cycle(self) -> str:
        """Directory and id of the limit cycle that a run begins on; empty without one."""
        return self.start.removeprefix(CYCLE) if self.start.startswith(CYCLE) else ""


class TransientDefinition(StudyDefinition):
    """A whole file of a study in time."""

    other_defaults: ClassVar[Mapping[str, Mapping[str, Any]]] = {"reduction": TRANSIENT_BASIS}

    transient: TransientSection = Field(
        default=TransientSection(), description="time integration (kind = 'transient' only)"
    )


DEFINITION = TransientDefinition
