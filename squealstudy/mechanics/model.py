"""A model with values of its parameters, from which design points are made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.mechanics.basis import Basis
from squealstudy.mechanics.component_tables import component_modes, loss_damping
from squealstudy.mechanics.values import Values, column_of
from squealstudy.models.acting_laws import expect_acting, law_choices, laws_with
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.parameter import ModelDefinition
from squealstudy.models.parameter_names import check_disjoint, parse_parameter
from squealstudy.models.units import quantity
from squealstudy.wording import did_you_mean

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.mechanics.system import System


@dataclass(frozen=True)
class Model:
    """A model at one design point.

    Attributes
    ----------
    definition : ModelDefinition
    given : mapping of str -> value
        Values given for parameters and options; the others are at their defaults. Parameters may
        be given with a unit, "12 bar", and are stored as numbers.
    basis : Basis or None
        Band of the modes and basis of the reduction; None: those that studies have by default.
    family : MatrixFamily or None
        The matrices, where the model is a family of matrices.

    Raises
    ------
    ParameterError
        Where the model does not have a parameter or option, a parameter does nothing with the laws
        chosen, or a value is not allowed.
    """

    definition: ModelDefinition
    given: Mapping[str, Any]
    basis: Basis | None = field(default=None, kw_only=True)
    family: MatrixFamily | None = field(default=None, kw_only=True)

    def __repr__(self) -> str:
        """Name, description and what was given, on one line."""
        given_text = ", ".join(f"{name} = {setting}" for name, setting in self.given.items())
        return f"<Model {self.definition.name!r}: {given_text or 'defaults'}>"

    def __post_init__(self) -> None:
        """Check names, bounds, options, and that every parameter acts; ParameterError."""
        options = {option.name: option.choices for option in self.definition.options}
        parameters = {
            name: parse_parameter(name, self.definition)
            for name in self.given
            if name not in options
        }
        numbers = {name: quantity(self.given[name], p) for name, p in parameters.items()}
        object.__setattr__(self, "given", {**self.given, **numbers})
        for name, setting in self.given.items():
            if name in parameters:
                parameters[name].check(setting)
            elif setting not in options[name]:
                choices = ", ".join(map(str, options[name]))
                hint = did_you_mean(str(setting), map(str, options[name]))
                raise ParameterError(name, f"expected one of {choices}, got {setting!r}{hint}")
        check_disjoint(parameters.values())
        design = ModelPoint(self.definition, self._options, {})
        for parameter in parameters.values():
            expect_acting(parameter, design)

    @property
    def _options(self) -> dict[str, str | int]:
        """A value of every option."""
        return {o.name: self.given.get(o.name, o.choices[0]) for o in self.definition.options}

    @property
    def _values(self) -> dict[str, float]:
        """A value of every parameter, and of each mode parameter that was given."""
        names = self._options
        mode_values = {k: float(v) for k, v in self.given.items() if k not in names}
        return {**self.definition.defaults(), **mode_values}

    def with_(self, **values: Any) -> Self:
        """The model with other values.

        Parameters
        ----------
        **values
            Values of parameters or options by name, as in `squealstudy.model`.

        Raises
        ------
        ParameterError
            For the reasons of `squealstudy.model`.
        """
        return replace(self, given={**self.given, **values})

    def with_basis(self, **changes: Any) -> Self:
        """The model with another basis of its reduction.

        Parameters
        ----------
        **changes
            Fields of `Basis`: ``band_hz=(1e3, 6e3)``, ``component_cutoff_factor=2.0``,
            ``ranges={"pressure": (2e5, 20e5)}``, over which one basis serves.

        Raises
        ------
        ParameterError
            Where ``band_hz`` is no band.
        TypeError
            Where a name is no field of `Basis`.

        Examples
        --------
        >>> import squealstudy as sq
        >>> sq.model("hulten").with_basis(band_hz=(10.0, 80.0)).at(friction=0.1).modes().counts
        1
        """
        basis = self.basis or Basis.of_modes(self.definition)
        return replace(self, basis=replace(basis, **changes))

    def at(self, **values: Any) -> System:
        """The system at values of parameters: one design point, or a batch.

        Bases of meshed models are made at the values of this model, and serve the values of the
        design points.

        Parameters
        ----------
        **values
            Values of parameters: numbers, texts with a unit, or arrays (m,) or (1,), which are
            broadcast. A name with a dot is given as ``**{"contact.lambda": 1e6}``. Options may be
            given too, one value each.

        Raises
        ------
        ParameterError
            Where a name is unknown, a value is out of bounds, a parameter does nothing here, or
            arrays have different lengths.

        Examples
        --------
        >>> import numpy as np, squealstudy as sq
        >>> system = sq.model("hulten").at(friction=np.linspace(0.0, 0.6, 7), damping_ratio=0.01)
        >>> system.modes().growth_rate.max(axis=1).round(1).tolist()
        [-4.7, -4.7, -4.4, 13.5, 66.9, 100.8, 130.3]
        """
        names = {option.name for option in self.definition.options}
        chosen = {k: v for k, v in values.items() if k in names}
        if chosen:
            return self.with_(**chosen).at(**{k: v for k, v in values.items() if k not in names})
        parameters = {name: parse_parameter(name, self.definition) for name in values}
        columns = {name: column_of(p, values[name]) for name, p in parameters.items()}
        common, options = self._values, self._options
        not_parameters = (n for n in self.given if n not in options and n not in parameters)
        others = [parse_parameter(name, self.definition) for name in not_parameters]
        check_disjoint([*parameters.values(), *others])
        nominal = ModelPoint(self.definition, options, self.definition.followed(common))
        for parameter in parameters.values():
            expect_acting(parameter, nominal)
        from squealstudy.mechanics.system import System  # imports numba and scipy.optimize

        return System(
            values=Values.of(self.definition, options, common, columns),
            nominal=nominal,
            basis=self.basis or Basis.of_modes(self.definition),
            chosen=self.basis is not None,
            family=self.family,
        )

    def modes(self, band: tuple[float, float] | None = None) -> pd.DataFrame:
        """Complex modes of the design point, one row each, with their errors.

        ``at().modes(band)`` gives them as arrays, with their vectors. The columns are those of a
        study's modes table; units are in ``attrs["units"]``. A meshed model is reduced first, once
        for each structure; the last reductions stay in memory.

        Parameters
        ----------
        band : (float, float) or None
            Lowest and highest frequency [Hz]; None: as in `System.modes`.

        Raises
        ------
        ConvergenceError
            Where the design point has no steady sliding.

        Examples
        --------
        >>> import squealstudy as sq
        >>> sq.model("hulten", friction=0.5).modes()["unstable"].tolist()
        [False, True]
        """
        return self.at().modes(band).to_pandas()

    def sweep(self, band: tuple[float, float] | None = None, **values: Any) -> pd.DataFrame:
        """Complex modes over values of parameters, all combinations of them, as one table.

        Parameters
        ----------
        band : (float, float) or None
            Lowest and highest frequency [Hz]; None: as in `System.modes`.
        **values
            As in `at`, but arrays may have different lengths; the first array varies fastest.

        Returns
        -------
        DataFrame
            A row for each mode with the columns of `modes`, ``point``, the number of the design
            point from 0, and the values swept, in units of ``attrs["units"]``. Points that failed
            have no rows: ``attrs["failed"]`` has the reasons by number.

        Raises
        ------
        ParameterError
            For the reasons of `at`, apart from the lengths of arrays.

        Examples
        --------
        >>> import numpy as np, squealstudy as sq
        >>> table = sq.model("hulten").sweep(friction=np.linspace(0.0, 0.6, 61))
        >>> float(table.query("unstable")["friction"].min().round(2))
        0.3
        """
        arrays = {k: np.asarray(v) for k, v in values.items() if np.ndim(v) == 1}
        columns, count = {}, math.prod(len(array) for array in arrays.values())
        inner = 1  # points over which a value stays; numpy's grids end at 32 parameters
        for name, array in arrays.items():
            columns[name] = np.resize(np.repeat(array, inner), count)
            inner *= len(array)
        modes = self.at(**{**values, **dict(reversed(columns.items()))}).modes(band)
        table = modes.to_pandas()
        counts_and_messages = zip(
            np.atleast_1d(modes.counts), np.atleast_1d(modes.message), strict=True
        )
        failed = {
            point: str(why) for point, (n, why) in enumerate(counts_and_messages) if not n and why
        }
        table.attrs["failed"] = failed
        swept = (name for name in values if name in table)
        units = {name: parse_parameter(name, self.definition).unit for name in swept}
        table.attrs["units"] = table.attrs["units"] | units
        return table

    @property
    def parameters(self) -> pd.DataFrame:
        """Value, default, unit and description of every parameter, a row each, by name.

        A `structural` parameter changes masses or stiffnesses: each of its values needs a new
        reduction. A parameter with `laws` acts if one of them is chosen, and is refused otherwise.
        """
        import pandas as pd

        rows = {
            p.name: {
                "value": self.given.get(p.name, p.default),
                "default": p.default,
                "unit": p.unit,
                "structural": p.structural,
                "laws": law_choices(laws_with(p.name)),
                "description": p.description,
            }
            for p in self.definition.parameters
        }
        table = pd.DataFrame.from_dict(rows, orient="index")
        table.index.name = "parameter"
        return table

    @property
    def options(self) -> pd.DataFrame:
        """Value, choices (the first is the default) and description of every option, by name."""
        import pandas as pd

        rows = [
            (o.name, self.given.get(o.name, o.choices[0]), o.choices, o.description)
            for o in self.definition.options
        ]
        return pd.DataFrame(rows, columns=["option", "value", "choices", "description"]).set_index(
            "option"
        )

    def component_modes(self, cutoff_hz: float = 8000.0) -> pd.DataFrame:
        """Free-free modes of the components up to a frequency, as study files number them.

        Columns ``component``, ``n_dof``, ``mode`` (from 1, rigid ones first), ``frequency_hz`` [Hz]
        and ``rigid``. The model is meshed for this.

        Parameters
        ----------
        cutoff_hz : float
            Highest frequency, Hz.

        Raises
        ------
        ModelError
            For a family of matrices, or where the geometry cannot be built.
        """
        return component_modes(self.at().point, cutoff_hz)

    def loss_damping(
        self, factors: Mapping[str | tuple[str, ...], float], cutoff_hz: float = 8000.0
    ) -> pd.DataFrame:
        """Damping ratios of component modes that are equivalent to loss factors of materials.

        A mode with the share e_m of its elastic energy in the material m gets
        zeta = sum of eta_m e_m / 2 (THEORY.md eq. (19a)).

        Parameters
        ----------
        factors : mapping of str or tuple of str -> float
            Loss factor eta of each material, by the name of the parameter that is its modulus, or
            by the names of all its moduli.
        cutoff_hz : float
            Highest frequency, Hz.

        Returns
        -------
        DataFrame
            A row for each elastic mode of a component that has one of the materials:
            ``parameter``, the name of its damping ratio in study files, ``component``, ``mode``,
            ``frequency_hz``, ``energy_share`` in these materials, ``damping_ratio``.

        Raises
        ------
        ParameterError
            Where names are not all moduli of one material, or a factor is negative.

        Examples
        --------
        >>> import squealstudy as sq
        >>> brake = sq.model("disc_brake", mesh="coarse")
        >>> brake.loss_damping({"pad.plate_young_modulus": 0.01}, 4e3)  # doctest: +SKIP
        """
        return loss_damping(self.at().point, factors, cutoff_hz)
