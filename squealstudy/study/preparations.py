"""Preparations of a model file before its modes or runs, such as heat or wear, in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from squealstudy.laws.own_friction import NOT_IN_TIME, STATES
from squealstudy.models.components.definition import NAME, FileDefinition
from squealstudy.models.components.dimensions import STRESS
from squealstudy.models.components.model_file import HEAT, ROTOR_ANGLE, WEAR, ModelFile, Numbers
from squealstudy.models.file_table import KeyPath
from squealstudy.models.own_law import OF_CONTACT, law_parameter_named
from squealstudy.study.components import build_of
from squealstudy.wording import listed

if TYPE_CHECKING:  # which reads model files by what this is beside
    from squealstudy.study.definition import ResolvedStudy

IN_TIME = ("transient", "limit_cycles")  # kinds of study in which contacts stick and slip


def preparations(study: ResolvedStudy) -> tuple[str, ...]:
    """Texts on stresses, angles, heat, wear and contacts with their own friction.

    Only for a study of a model file with meshes; () for other models.
    """
    if not isinstance(study.model, FileDefinition) or study.model.name != NAME:
        return ()
    build, constant = build_of(study.model), study.constant
    owners = {
        keys: name for name, where in build.places.items() if name not in constant for keys in where
    }
    done = _Preparations(build.brake.file, build.given(study.values), owners)
    in_time = study.definition.study.kind in IN_TIME
    return (
        *done.stresses(),
        *done.angle(),
        *done.heat(),
        *done.wear(),
        *done.contacts(in_time),
    )


class _Preparations:
    """Texts on a model file at a study's values; a number that varies is its parameter's name."""

    def __init__(
        self, file: ModelFile, overrides: Mapping[KeyPath, float], owners: Mapping[KeyPath, str]
    ) -> None:
        self._file, self._owners, self._numbers = file, owners, Numbers(file, overrides)
        self._megapascal = STRESS.factor(file.units) / 1e6

    def _amount(self, *keys: str | int, unit: str = "") -> str:
        """The name of a parameter that varies, or a number with its unit."""
        if keys in self._owners:
            return f"'{self._owners[keys]}'"
        return f"{self._numbers.at(*keys):g} {unit}".rstrip()

    def stresses(self) -> Iterator[str]:
        if (table := self._file.stress_stiffening) is not None:
            conditions = (
                f"{table.pressure * self._megapascal:g} MPa and a friction of {table.friction:g}"
            )
            yield f"stresses of {conditions} stiffen what vibrates"

    def angle(self) -> Iterator[str]:
        if self._file.rotation is None or (by := self._amount(*ROTOR_ANGLE, unit="deg")) == "0 deg":
            return
        yield (
            f"{listed(self._file.turning)} stands turned by {by}: a symmetric part changes nothing "
            "where its mesh repeats, elsewhere as much as its mesh errs"
        )

    def heat(self) -> Iterator[str]:
        """Sentences on components that heat has expanded."""
        for name, component in self._file.components.items():
            if component.heat is None:
                continue
            scale, field = self._amount("components", name, *HEAT), component.heat.file
            if scale == "0":
                yield f"{name} is cold: its heat has a scale of 0"
            else:
                of = field or "a linear field"
                yield f"heat has expanded {name}: {scale} times the temperatures of {of}"

    def contacts(self, in_time: bool) -> Iterator[str]:
        """Yield texts on contacts with their own friction, or that slide or stick off the rotor."""
        for i, table in enumerate(self._file.contact):
            keys: KeyPath = ("contact", i)
            numbers = [("friction", "")] if table.friction is not None else []
            numbers += [(key, law_parameter_named(key).unit) for key in table.friction_law]
            texts = [
                f"{key} {self._amount(*keys, *path, unit=unit)}"
                for key, unit in numbers
                for path in [(key,) if key == "friction" else (OF_CONTACT, key)]
            ]
            if table.state is None and texts:
                yield f"{self._file.name_of('contact', i)} has its own {listed(texts)}"
            elif table.state is not None:
                yield f"{self._file.name_of('contact', i)} {self._state(keys, texts[0], in_time)}"

    def _state(self, keys: KeyPath, friction: str, in_time: bool) -> str:
        """Text on a contact that sticks or slides by its state."""
        if in_time and not self._starts_in_time(keys):
            return f"cannot be run: {NOT_IN_TIME}"
        if in_time:
            return f"sticks and slips by itself, from no friction, with {friction}"
        sliding = f"slides, with {friction} at all speeds"
        stiffness = "nothing"
        if self._file.at((*keys, "tangential")) is not None:
            stiffness = self._amount(*keys, "tangential", unit="N/m3")
        stuck = f"is stuck, by {stiffness} in plane"
        if (*keys, "state") in self._owners:
            return f"{stuck}, where '{self._owners[(*keys, 'state')]}' is 1, and {sliding}, where 0"
        return stuck if self._numbers.at(*keys, "state") == STATES["stuck"] else sliding

    def _starts_in_time(self, keys: KeyPath) -> bool:
        """Whether a contact with a state can be run in time, as far as its constant values tell."""
        state, stiffness = (*keys, "state"), (*keys, "tangential")
        sticks = state in self._owners or self._numbers.at(*state) == STATES["stuck"]
        is_free = self._file.at(stiffness) is None or stiffness in self._owners
        return sticks and (is_free or self._numbers.at(*stiffness) == 0.0)

    def wear(self) -> Iterator[str]:
        """Sentence on the wear of the faces."""
        if (table := self._file.wear) is None:
            return
        distance = self._amount(WEAR, "distance", unit="m")
        if distance == "0 m":
            yield "the faces are new: the distance of [wear] is 0"
            return
        conditions = (
            f"{table.pressure * self._megapascal:g} MPa and a friction of {table.friction:g}"
        )
        rate = self._amount(WEAR, "rate", unit="1/Pa")
        yield f"{distance} of sliding at {conditions} have worn the faces, at a rate of {rate}"
