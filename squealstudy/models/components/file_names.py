"""Checks of the names in a model file that need no mesh: each is unique, and the rotor exists."""

from __future__ import annotations

from collections.abc import Sequence

from squealstudy.models.components.model_file import GROUND, ModelFile
from squealstudy.models.file_table import KeyPath, PlacedError

# tables whose names must differ: columns of energies and paths of parameters are named by them
TOGETHER = (("contact", "tie", "coupling", "layer", "spring"), ("point_mass",), ("load",))


def check_names(file: ModelFile) -> None:
    """Check the names of a model file.

    Raises
    ------
    PlacedError
        Two tables have the same name; the rotor does not exist, or could be either of two
        components; a component slides on itself.
    """
    for kinds in TOGETHER:
        owner: dict[str, str] = {}
        for kind in kinds:
            for i in range(len(file.at((kind,)))):
                name, entry = file.name_of(kind, i), f"{kind}[{i + 1}]"
                if owner.setdefault(name, entry) != entry:
                    text = f"'{name}' is the name of {owner[name]} already: "
                    keys: KeyPath = (kind, i, "name")
                    raise PlacedError(keys, text + "choose another name")
    _check_rotor(file)


def _check_rotor(file: ModelFile) -> None:
    """Raise PlacedError where the rotor is no component, or contacts do not fit it."""
    rotor, component_names = file.rotor, tuple(file.components)
    if rotor is not None and rotor not in component_names:
        text = f"there is no component '{rotor}'; there is {', '.join(component_names)}"
        raise PlacedError(("rotation", "rotor"), text, rotor, component_names)
    masters: dict[str, int] = {}
    sliding = [i for i, table in enumerate(file.contact) if table.kind == "sliding"]
    for i in sliding:
        slave, master = file.sides(i)
        if slave == master:
            text = (
                f"both faces are of {slave}, which cannot slide on itself: expected faces of two "
            )
            raise PlacedError(
                ("contact", i), text + 'components, or kind "stuck" or "frictionless"'
            )
        masters.setdefault(master, i)
    for i in sliding:
        slave, _ = file.sides(i)
        if rotor is None and slave in masters:
            raise PlacedError(
                ("contact", i, "slave"),
                f"{slave} does not turn, as the slave of a sliding contact, and turns, as the "
                f"master of {file.name_of('contact', masters[slave])}: say which component turns, "
                'rotor = "NAME" in [rotation]',
            )


def between(names: Sequence[str], keys: KeyPath) -> tuple[str, str | None]:
    """A set, and the other one or None for ground. PlacedError where both are the same."""
    set_names = [name for name in names if name.casefold() != GROUND]
    if not set_names:
        raise PlacedError((*keys, "between"), "expected COMPONENT.SET, got ground twice")
    if len(set_names) > 1 and set_names[0] == set_names[1]:
        raise PlacedError((*keys, "between"), f"expected two sets, got '{set_names[0]}' twice")
    return set_names[0], set_names[1] if len(set_names) > 1 else None
