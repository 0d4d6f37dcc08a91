"""The reduction of a structure: component modes, contact compliances, basis, reduced matrices."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.models.operating import ModeKey, OperatingPoint
from squealstudy.models.parameter_names import FREQUENCY_SCALE
from squealstudy.modes.full_order.finer_model import ReductionRecord, with_finer_model
from squealstudy.reduction.cmt import ComponentBasis, ComponentModes, ReductionSettings
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.prepared import PreparedModel, prepare_with_basis
from squealstudy.reduction.projected import AnyAssembly

SpaceOf = Callable[[Mapping[str, ComponentModes]], ContactSpace]


@dataclass(frozen=True, eq=False)
class Reduction:
    """A structure in component-mode coordinates x, in which the mass is the identity.

    Attributes
    ----------
    assembly : Assembly
        The assembly that was reduced; its degrees of freedom are u = T x.
    prepared : PreparedModel
        Contact space, reduced matrices, nominal working point.
    component_modes : mapping of str -> ComponentModes
        Free-free modes by component: omega (m,) [rad/s], phi (n_component, m), mass-normalised.
    basis : ComponentBasis
        Columns of T, a block for each component, and assembly modes.
    settings : ReductionSettings
        Cutoffs [Hz] of the basis.

    Examples
    --------
    >>> import squealstudy as sq
    >>> reduction = sq.model("hulten").at().reduced()
    >>> reduction.n, reduction.basis_matrix.shape
    (2, (2, 2))
    >>> import numpy as np
    >>> reduction.expand(np.array([1.0, 0.0])).shape
    (2,)
    """

    assembly: AnyAssembly
    prepared: PreparedModel
    component_modes: Mapping[str, ComponentModes]
    basis: ComponentBasis
    settings: ReductionSettings

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return self.prepared.model.n

    @property
    def space(self) -> ContactSpace:
        """Contact compliances, from which steady sliding is solved."""
        return self.prepared.space

    @property
    def basis_matrix(self) -> np.ndarray:
        """The basis T (n_dof, n): columns of displacements, sqrt(kg)^-1."""
        return self.expand(np.eye(self.n))

    def expand(self, x: np.ndarray) -> np.ndarray:
        """Displacements (n_dof, ...) of the assembly.

        Parameters
        ----------
        x : ndarray (n, ...)
            Coordinates of the basis, sqrt(kg) m.

        Raises
        ------
        ValueError
            Where `x` has another number of coordinates.
        """
        return self.basis.expand(x)


def reduced(
    assembly: AnyAssembly,
    nominal: OperatingPoint,
    settings: ReductionSettings,
    training: Sequence[OperatingPoint] = (),
    top_hz: float | None = None,
    scales: Sequence[Mapping[ModeKey, float]] = (),
    enriching: int = 0,
    space: ContactSpace | SpaceOf | None = None,
) -> Reduction:
    """Reduce an assembly, and make its finer model where the reduction's error is asked for.

    Parameters
    ----------
    assembly : Assembly
    nominal : OperatingPoint
        Operating point about whose steady sliding the basis is made.
    settings : ReductionSettings
    training : sequence of OperatingPoint
        Other operating points that the basis is to serve.
    top_hz : float or None
        Top of the band of the finer model [Hz]; None: no finer model.
    scales : sequence of mapping of (component, mode) -> float
        Factors on component frequencies that residual loads are taken with.
    enriching : int
        How often directions that the finer model shows to be lacking join the basis.
    space : ContactSpace, callable or None
        Contact space of the same assembly, or a function that makes it from the component modes;
        None: it is made here.

    Raises
    ------
    ConvergenceError
        Where there is no steady sliding at the nominal operating point.
    ParameterError
        Where the basis does not hold a component mode in `scales`.
    """
    prepared, modes, basis = prepare_with_basis(assembly, nominal, settings, training, space)
    for component, mode in (key for scale in scales for key in scale):
        n_modes = modes[component].phi.shape[1]
        if mode > n_modes:
            text = (
                f"{component} has modes 1 to {n_modes} up to {settings.component_cutoff:g} Hz here"
            )
            raise ParameterError(f"{component}.modes[{mode}].{FREQUENCY_SCALE}", text)
    started, timings = time.perf_counter(), prepared.timings
    if top_hz is not None:
        points = (nominal, *training)
        record = ReductionRecord(assembly, modes, points, top_hz, settings.damped_to, tuple(scales))
        prepared, basis = with_finer_model(prepared, basis, record, enriching)
    timings = {**timings, "finer_model_s": time.perf_counter() - started}
    return Reduction(assembly, replace(prepared, timings=timings), modes, basis, settings)
