"""A model of the Python face: of the catalogue or of a model file, at one design point."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from squealstudy import faults
from squealstudy.errors import ParameterError, SquealstudyError, StudyFileError
from squealstudy.face import Study, resolved_study, run
from squealstudy.models.acting_laws import expect_acting, law_choices, laws_with
from squealstudy.models.catalogue import MODELS, model_names
from squealstudy.models.components.definition import DESCRIPTION as OF_A_FILE
from squealstudy.models.components.definition import NAME as OF_FILE
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.matrices.family import DESCRIPTION as OF_MATRICES
from squealstudy.models.matrices.family import NAME as MATRICES
from squealstudy.models.parameter_names import parse_parameter
from squealstudy.models.units import quantity
from squealstudy.study.design import DesignPoint
from squealstudy.study.source import SourceText
from squealstudy.study.toml_text import toml_text
from squealstudy.wording import did_you_mean

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.models.assembly import Assembly, Component
    from squealstudy.models.parameter import ModelDefinition

MODEL_FILE = ".toml"
LINEAR = 1e-9  # relative: what a stiffness may miss to be linear in its moduli
LEFT_OUT = ("point_id", "track", "track_mac", "track_ambiguous")  # of the modes of one design point


@dataclass(frozen=True)
class Model:
    """A model of the catalogue at one design point.

    Attributes
    ----------
    definition : ModelDefinition
    given : mapping of str -> value
        Parameters and options that are not at their defaults; parameters as numbers, whether they
        came as such or with a unit, "12 bar".
    """

    definition: ModelDefinition
    given: Mapping[str, Any]

    def __repr__(self) -> str:
        """Name, description and what was given, on one line."""
        given = ", ".join(f"{name} = {value}" for name, value in self.given.items())
        return f"<Model {self.definition.name!r}: {given or 'defaults'}>"

    def __post_init__(self) -> None:
        """Check names, bounds, options, and that every parameter acts; ParameterError."""
        options = {option.name: option.choices for option in self.definition.options}
        numbers = {
            name: quantity(value, parse_parameter(name, self.definition))
            for name, value in self.given.items()
            if name not in options
        }
        object.__setattr__(self, "given", {**self.given, **numbers})
        for name, value in self.given.items():
            if name not in options:
                parse_parameter(name, self.definition).check(value)
            elif value not in options[name]:
                choices = ", ".join(map(str, options[name]))
                raise ParameterError(name, f"expected one of {choices}, got {value!r}")
        chosen = {**{name: choices[0] for name, choices in options.items()}, **self.given}
        design = DesignPoint(self.definition, chosen, {})
        for name in self.given.keys() - options.keys():
            expect_acting(parse_parameter(name, self.definition), design)

    def with_(self, **values: Any) -> Model:
        """The model with other values of parameters or options, as of `model`."""
        return replace(self, given={**self.given, **values})

    @property
    def parameters(self) -> pd.DataFrame:
        """Value, default, unit and description of every parameter, a row each, by name.

        A `structural` one changes masses or stiffnesses: each value costs a new reduction. One with
        `laws` acts where one of them is chosen, and is refused otherwise.
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

    def study(self, name: str = "model", band: tuple[float, float] | None = None) -> Study:
        """The complex-mode study of this one design point; `band` [Hz] as of study files.

        Raises
        ------
        ParameterError
            ``band`` where it is none.
        """
        options = {option.name for option in self.definition.options}
        try:
            ends = [] if band is None else list(band)
        except TypeError:
            raise ParameterError("band", f"expected [low, high] in Hz, got {band!r}") from None
        tables = {
            "study": {"name": name, "kind": "complex_modes"},
            "model": self._named() | {k: v for k, v in self.given.items() if k in options},
            "parameters": {k: v for k, v in self.given.items() if k not in options},
            "modes": {"reference_points": 0} | ({} if band is None else {"band": ends}),
        }
        text = toml_text(tables)
        try:
            return resolved_study(SourceText(Path(f"{name}.toml"), text), tables, text)
        except StudyFileError as error:  # there is no such file
            if not error.key.startswith("modes.band"):
                raise
            raise ParameterError("band", error.message) from None

    def _named(self) -> dict[str, str]:
        """How a study names the model."""
        if isinstance(self.definition, FileDefinition):
            return {"file": str(Path(self.definition.path).resolve())}
        return {"name": self.definition.name}

    def modes(self, band: tuple[float, float] | None = None) -> pd.DataFrame:
        """Complex modes of the design point, one row each, with their errors.

        Units are in ``attrs["units"]``; columns as those of the modes table of a study. A meshed
        model is reduced first, once for each structure: the cache keeps it.

        Parameters
        ----------
        band : (float, float) or None
            Lowest and highest frequency [Hz]; by default that of study files.

        Raises
        ------
        ResultsError
            Where the design point has no working point.
        """
        with faults.told(), tempfile.TemporaryDirectory() as folder:
            found = run(self.study(band=band), Path(folder) / "results", jobs=1).modes
        return found.drop(columns=[name for name in LEFT_OUT if name in found])

    def component_modes(self, cutoff_hz: float = 8000.0) -> pd.DataFrame:
        """Free-free modes of the components up to a frequency, as study files number them.

        Columns ``component``, ``n_dof``, ``mode`` (from 1, rigid ones first), ``frequency_hz`` [Hz]
        and ``rigid``. The model is meshed for this.
        """
        import numpy as np
        import pandas as pd

        from squealstudy.linalg.real_modes import real_modes, rigid_modes

        rows = []
        for c in self._assembly({}).components:
            omega, _ = real_modes(c.M, c.K, cutoff_hz)
            rigid = rigid_modes(c.M, c.K, omega)
            rows += [
                (c.name, c.n_dof, j + 1, float(w / (2 * np.pi)), j < rigid)
                for j, w in enumerate(omega)
            ]
        names = ["component", "n_dof", "mode", "frequency_hz", "rigid"]
        table = pd.DataFrame(rows, columns=names)
        table.attrs["units"] = {"n_dof": "", "mode": "", "frequency_hz": "Hz"}
        return table

    def loss_damping(
        self, factors: Mapping[str | tuple[str, ...], float], cutoff_hz: float = 8000.0
    ) -> pd.DataFrame:
        """Damping ratios of component modes that stand for loss factors of materials.

        A mode with the share e_m of its elastic energy in the material m gets
        zeta = sum of eta_m e_m / 2 (THEORY.md eq. (19a)).

        Parameters
        ----------
        factors : mapping of str or tuple of str -> float
            Loss factor eta of a material, by the parameter that is its modulus; of one that has
            several moduli by all of them.
        cutoff_hz : float
            Modes up to here, Hz.

        Returns
        -------
        DataFrame
            A row an elastic mode of a component that has one of the materials: ``parameter``, its
            damping ratio as study files call it, ``component``, ``mode``, ``frequency_hz``,
            ``energy_share`` in these materials, ``damping_ratio``.

        Raises
        ------
        ParameterError
            What is no modulus of a component or not all of a material's, or a negative factor.
        """
        import numpy as np
        import pandas as pd

        from squealstudy.linalg.real_modes import real_modes, rigid_modes

        parts, rows = self._assembly({}).components, []
        told = [name for m in factors for name in ((m,) if isinstance(m, str) else m)]
        if twice := next((name for name in told if told.count(name) > 1), ""):
            raise ParameterError(twice, "expected one loss factor of a material, got two")
        moduli = {(m,) if isinstance(m, str) else tuple(m): eta for m, eta in factors.items()}
        own = {names: self._assembly(dict.fromkeys(names, 2.0)).components for names in moduli}
        for names, eta in moduli.items():
            thrice = self._assembly(dict.fromkeys(names, 3.0)).components
            if not _scale_stiffness(parts, own[names], thrice):
                text = "expected moduli of a component, all of those that a material has"
                raise ParameterError(" and ".join(names), text)
            if not eta >= 0:
                raise ParameterError(" and ".join(names), f"expected a loss factor, got {eta}")
        for k, c in enumerate(parts):
            K = {names: found[k].K - c.K for names, found in own.items()}
            if not any(abs(part).max() > 0 for part in K.values()):
                continue
            omega, phi = real_modes(c.M, c.K, cutoff_hz)
            for j in range(rigid_modes(c.M, c.K, omega), len(omega)):
                u = phi[:, j]
                share = {names: float(u @ (part @ u)) / omega[j] ** 2 for names, part in K.items()}
                zeta = sum(0.5 * moduli[names] * e for names, e in share.items())
                name = f"{c.name}.modes[{j + 1}].damping_ratio"
                hz = float(omega[j] / (2 * np.pi))
                rows.append((name, c.name, j + 1, hz, sum(share.values()), zeta))
        columns = ["parameter", "component", "mode", "frequency_hz"]
        columns += ["energy_share", "damping_ratio"]
        table = pd.DataFrame(rows, columns=columns)
        table.attrs["units"] = dict.fromkeys(columns[2:], "") | {"frequency_hz": "Hz"}
        return table

    def _assembly(self, factors: Mapping[str, float]) -> Assembly:
        """The model as it is assembled, with factors on some of its parameters."""
        defaults = self.definition.defaults()
        options = {str(name): value for name, value in self.options["value"].items()}
        values = defaults | {k: v for k, v in self.given.items() if k in defaults}
        for name, factor in factors.items():
            if name not in values:
                parse_parameter(name, self.definition)
                raise ParameterError(name, "expected moduli of a component")
            values[name] *= factor
        return self.definition.build(options, values)


def _scale_stiffness(
    once: Sequence[Component], twice: Sequence[Component], thrice: Sequence[Component]
) -> bool:
    """Whether components at one, two and three times some values differ in stiffness, linearly."""
    import numpy as np

    most = 0.0
    for a, b, c in zip(once, twice, thrice, strict=True):
        if not np.array_equal(a.coordinates, b.coordinates):
            return False
        change = abs(b.K - a.K).max()
        if abs(c.K - 2 * b.K + a.K).max() > LINEAR * max(change, abs(a.K).max() * LINEAR):
            return False
        most = max(most, change)
    return most > 0


def model(name: str, **values: Any) -> Model:
    """A model of the catalogue: ``model("disc_brake", mesh="coarse", friction=0.4)``.

    Parameters
    ----------
    name : str
        One of `list_models`, or the path of a model file, which ends in ``.toml``.
    **values
        Parameters, SI units or with a unit, ``pressure="12 bar"``, and options; names with dots as
        ``**{"contact.lambda": 1e6}``.

    Raises
    ------
    SquealstudyError
        An unknown model; a parameter that it does not have, or a value that it cannot take.
    """
    if name.endswith(MODEL_FILE):
        from squealstudy.study.components import read_model  # imports scikit-fem

        return Model(read_model(Path(name)), values)
    if name == MATRICES:
        raise SquealstudyError(f"model '{MATRICES}' is made of the files that its study names")
    if name == OF_FILE:
        raise SquealstudyError(f"model '{OF_FILE}' is what a model file describes: give its path")
    if name not in MODELS:
        raise SquealstudyError(
            f"unknown model '{name}', expected {', '.join(model_names())}"
            + did_you_mean(name, model_names())
        )
    return Model(MODELS[name], values)


def list_models() -> dict[str, str]:
    """Descriptions of the models by name."""
    named = {m.name: m.description for m in MODELS.values()}
    return named | {MATRICES: OF_MATRICES, OF_FILE: f"{OF_A_FILE}: its path in place of the name"}
