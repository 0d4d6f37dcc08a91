"""Common parts of integrators of fixed step to compare with: kernel arrays of one design point."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from squealstudy.kernels import newmark_layout as layout
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.motion import Motion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import KernelRun, OneByOne
from squealstudy.motion.system import ModalSystem, MotionPoint


class OwnKernel(OneByOne):
    """An integrator with its own kernel, on the arrays of the kernels that studies use."""

    @abstractmethod
    def advance(self, case: KernelRun) -> None:
        """Integrate design 0 of the case to its end or failure."""

    def iteration(self) -> Newmark:
        """Newmark's method with the options that this one shares with it."""
        return Newmark(max_halvings=0, tangential_damping="never")

    def run(self, system: ModalSystem, design: MotionPoint, settings: MotionSettings) -> Motion:
        """Integrate a design point; a failure is an outcome."""
        case = own_arrays(system, design, replace(settings, integrator=self.iteration()))
        self.advance(case)
        return case.motion(0)


class Iterated(OwnKernel):
    """An integrator that finds contact forces by Newmark's iteration."""

    aitken: bool = Field(default=True, description="relax the contact iteration after Aitken")
    extrapolate: bool = Field(
        default=True, description="predict the contact forces from two steps, else from one"
    )
    max_halvings: int = Field(
        default=4, ge=0, le=20, description="how often a step that does not converge is halved"
    )
    tangential_damping: Literal["auto", "never"] = Field(
        default="auto", description="solve for points that stick within the iteration"
    )

    def iteration(self) -> Newmark:
        """Newmark's iteration with the options of this integrator."""
        return Newmark(
            aitken=self.aitken,
            extrapolate=self.extrapolate,
            max_halvings=self.max_halvings,
            tangential_damping=self.tangential_damping,
        )


def own_arrays(system: ModalSystem, design: MotionPoint, settings: MotionSettings) -> KernelRun:
    """Arrays of one design point, with additional rows that these kernels need.

    Raises
    ------
    ModelError
        Where the design does not fit the system, or the initial state is not finite.
    """
    case = KernelRun.of(system, [design], settings)
    work = case.work._replace(
        point=np.zeros((1, layout.N_POINT_GAP, case.work.point.shape[2])),
        real=np.concatenate([case.work.real, np.zeros((1, 1))], axis=1),
    )
    return replace(case, work=work)
