"""What is done to the model of a file before anything vibrates, in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from squealstudy.models.components.definition import NAME, FileDefinition
from squealstudy.models.components.dimensions import STRESS
from squealstudy.models.components.model_file import HEAT, ROTOR_ANGLE, WEAR, ModelFile, Numbers
from squealstudy.models.file_table import KeyPath
from squealstudy.study.components import build_of
from squealstudy.wording import listed

if TYPE_CHECKING:  # which reads model files by what this is beside
    from squealstudy.study.definition import ResolvedStudy


def preparations(study: ResolvedStudy) -> tuple[str, ...]:
    """Stresses, angles, heat and wear of a model file with meshes, a text each; else ()."""
    if not isinstance(study.model, FileDefinition) or study.model.name != NAME:
        return ()
    build, constant = build_of(study.model), study.constant
    owners = {
        keys: name for name, where in build.places.items() if name not in constant for keys in where
    }
    done = _Preparations(build.brake.file, build.given(study.values), owners)
    return (*done.stresses(), *done.angle(), *done.heat(), *done.wear())


class _Preparations:
    """Texts of a model file at numbers of a study; what varies is told by its parameter's name."""

    def __init__(
        self, file: ModelFile, given: Mapping[KeyPath, float], owners: Mapping[KeyPath, str]
    ) -> None:
        self._file, self._owners, self._numbers = file, owners, Numbers(file, given)
        self._megapascal = STRESS.factor(file.units) / 1e6

    def _amount(self, *keys: str | int, unit: str = "") -> str:
        """The name of a parameter that varies, or a number with its unit."""
        if keys in self._owners:
            return f"'{self._owners[keys]}'"
        return f"{self._numbers.at(*keys):g} {unit}".rstrip()

    def stresses(self) -> Iterator[str]:
        if (table := self._file.stress_stiffening) is not None:
            at = f"{table.pressure * self._megapascal:g} MPa and a friction of {table.friction:g}"
            yield f"stresses of {at} stiffen what vibrates"

    def angle(self) -> Iterator[str]:
        if self._file.rotation is None or (by := self._amount(*ROTOR_ANGLE, unit="deg")) == "0 deg":
            return
        yield (
            f"{listed(self._file.turning)} stands turned by {by}: a symmetric part changes nothing "
            "where its mesh repeats, elsewhere as much as its mesh errs"
        )

    def heat(self) -> Iterator[str]:
        for name, component in self._file.components.items():
            if component.heat is None:
                continue
            scale, field = self._amount("components", name, *HEAT), component.heat.file
            if scale == "0":
                yield f"{name} is cold: its heat has a scale of 0"
            else:
                of = field or "a linear field"
                yield f"heat has expanded {name}: {scale} times the temperatures of {of}"

    def wear(self) -> Iterator[str]:
        if (table := self._file.wear) is None:
            return
        distance = self._amount(WEAR, "distance", unit="m")
        if distance == "0 m":
            yield "the faces are new: the distance of [wear] is 0"
            return
        at = f"{table.pressure * self._megapascal:g} MPa and a friction of {table.friction:g}"
        rate = self._amount(WEAR, "rate", unit="1/Pa")
        yield f"{distance} of sliding at {at} have worn the faces, at a rate of {rate}"
