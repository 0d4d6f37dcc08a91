"""Integrators, and the catalogue of them.

An integrator is a class whose fields are its options. Studies know it if it is in a folder that the
catalogue reads, or by `register_integrator`. Those that the batched kernel runs
(`KernelIntegrator`) are tables of coefficients: the state at the end of a sub-step is affine in
the forces there,

    (q, v)_1 = P (q, v)_0 + first pull_0 + last pull_1,

where the pull is all forces but those of the free modes q'' + c q' + w2 q.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from squealstudy.errors import ParameterError
from squealstudy.extensions import hash_of, note_registered
from squealstudy.wording import expectation

if TYPE_CHECKING:
    import numpy as np  # commands that compute nothing start without it

# relative imbalance at which a step's contact iteration ends: far below the step's error
CONTACT_ITERATION_TOLERANCE = 1e-2
SLOW_TOLERANCE = 1e-3  # the same for the slow reference integrators
RENAMED_OPTIONS = {"mockup": "tangential_damping"}  # names up to version 0.3, names now
# relative: the level of a coarse brake is 3 % low at a drift of 1.6e-3, right to 0.1 % at 4e-4
DRIFT_LIMIT = 1e-3


class Integrator(BaseModel, ABC):
    """A way to integrate a modal system in time; its fields are its options.

    Attributes
    ----------
    name : str
        Name in study files.
    label, description : str
        Texts for charts and messages.
    order : int or None
        Order of convergence where motion is smooth; None for solvers that choose their steps.
    drift_limit : float
        Imbalance of energy over the energy of the vibration, beyond which levels are doubtful.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    name: ClassVar[str]
    label: ClassVar[str]
    description: ClassVar[str]
    order: ClassVar[int | None] = None
    drift_limit: ClassVar[float] = DRIFT_LIMIT

    @model_validator(mode="before")
    @classmethod
    def _renamed(cls, options: Any) -> Any:
        """Options, with old names replaced by new ones."""
        for old in RENAMED_OPTIONS.keys() & options if isinstance(options, Mapping) else ():
            new = RENAMED_OPTIONS[old]
            text = f"the option {old} of integrators is called {new} now"
            warnings.warn(text, DeprecationWarning, stacklevel=3)
            options = {new if name == old else name: x for name, x in options.items()}
        return options

    @classmethod
    def outside_source(cls) -> str:
        """Hash of the integrator's file if outside the package: part of the identity of results."""
        if cls.__module__.split(".")[0] == __name__.split(".")[0]:
            return ""
        return hash_of(Path(inspect.getfile(cls)))


class KernelIntegrator(Integrator):
    """A one-step method of the batched kernel: a table of coefficients.

    Attributes
    ----------
    tolerance : float
        Relative imbalance of forces at which a study's contact iteration ends by default.
    work_of_changes : float
        How the work of a step is summed. 0: mean force times mean velocity, which balances for
        average acceleration; 1: with the product of their changes, the trapezoidal rule of force
        times velocity.
    """

    tolerance: ClassVar[float] = CONTACT_ITERATION_TOLERANCE
    work_of_changes: ClassVar[float] = 0.0

    extrapolate: bool = Field(
        default=True, description="predict the contact forces from two steps, else from one"
    )
    max_halvings: int = Field(
        default=4, ge=0, le=20, description="times that a step which does not converge is halved"
    )
    corner_halvings: int = Field(
        default=0,
        ge=0,
        le=20,
        description="times that a step is halved where a contact point begins or ceases to stick, "
        "turns or opens, in models of up to 8 points; 0: never",
    )
    single_storage: bool = Field(
        default=False, description="observation matrix in single precision"
    )

    @abstractmethod
    def step(self, w2: np.ndarray, c: np.ndarray, h: float) -> np.ndarray:
        """Coefficients of one sub-step of modes q'' + c q' + w2 q = pull.

        Parameters
        ----------
        w2, c : ndarray (n,)
            Stiffness [1/s2] and damping [1/s].
        h : float
            Length of the sub-step, s.

        Returns
        -------
        ndarray (8, n)
            Rows kernels.newmark_layout.QQ, QV, VQ, VV (propagator of q and v), FIRST_Q, FIRST_V
            and LAST_Q, LAST_V (response to the pull at the start and at the end).
        """

    def steps(
        self, w2: np.ndarray, c: np.ndarray, h: float, levels: int | None = None
    ) -> np.ndarray:
        """Coefficients of steps h, h/2, ... by halving level (levels + 1, 8, n).

        `levels` is `max_halvings` by default.
        """
        import numpy as np

        levels = self.max_halvings if levels is None else levels
        return np.array([self.step(w2, c, h / 2**k) for k in range(levels + 1)])

    def modes(self, w2: np.ndarray, c: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness [1/s2] and damping [1/s] (n,) to integrate in place of w2 and c at a step h."""
        return w2, c


class FixedJacobian(KernelIntegrator):
    """A method of the kernel that corrects forces with a fixed Jacobian, diagonal by default.

    Other kernel integrators compute a new Jacobian at every iteration.
    """

    aitken: bool = Field(default=True, description="relax the contact iteration after Aitken")
    contact_factor: float = Field(
        default=1.0, ge=0, description="factor on the contact stiffness of the Jacobian"
    )
    contact_stiffness: float = Field(
        default=0.0,
        ge=0,
        description="uniform contact stiffness of the Jacobian, Pa/m; 0 for the static tangents",
    )
    tangential_damping: Literal["auto", "always", "never"] = Field(
        default="auto",
        description="tangential damping k_t/2 in the Jacobian: where points stick, everywhere, "
        "nowhere",
    )


KERNEL_METHODS = "squealstudy.motion.integrators"
_folders = [KERNEL_METHODS]
_integrators: dict[str, type[Integrator]] = {}


def register_integrator(integrator: type[Integrator]) -> type[Integrator]:
    """Make an integrator known to studies under its name; also a decorator.

    Parameters
    ----------
    integrator : subclass of Integrator
        For example a subclass of `FixedJacobian`.

    Raises
    ------
    ParameterError
        Another integrator has that name.
    """
    if _integrators.setdefault(integrator.name, integrator) is not integrator:
        raise ParameterError("integrator", f"there is another '{integrator.name}'")
    note_registered(integrator.__module__)
    return integrator


def read_integrators(package: str) -> None:
    """Have the catalogue read the modules of a package for integrators, when it is next asked."""
    _folders.append(package)


def integrators() -> Mapping[str, type[Integrator]]:
    """All integrators of the catalogue, by name."""
    while _folders:
        folder = importlib.import_module(_folders.pop(0))
        for module_info in pkgutil.iter_modules(folder.__path__, folder.__name__ + "."):
            for member in vars(importlib.import_module(module_info.name)).values():
                if _is_method(member) and member.__module__ == module_info.name:
                    register_integrator(member)
    return _integrators


def _is_method(item: object) -> bool:
    return isinstance(item, type) and issubclass(item, Integrator) and hasattr(item, "name")


def integrator(name: str, options: Mapping[str, Any] | None = None) -> Integrator:
    """The integrator with a name and these options; other options have their defaults.

    Raises
    ------
    ParameterError
        An unknown name (key ``integrator``), an unknown option, or a value that it cannot have (the
        key is the option's).
    """
    if name not in integrators():
        raise ParameterError("integrator", f"'{name}' is none of {', '.join(integrators())}")
    method = integrators()[name]
    try:
        return method(**(options or {}))
    except ValidationError as error:
        first = error.errors()[0]
        key = str(first["loc"][0])
        if first["type"] == "extra_forbidden":
            takes = ", ".join(method.model_fields) or "nothing"
            message = f"{method.label} has no such option; it takes {takes}"
        else:
            words = expectation(first["type"], first.get("ctx", {}))
            expected_text = f"expected {words}" if words else first["msg"]
            message = f"{expected_text}, got {first['input']!r}"
        raise ParameterError(key, message) from None
