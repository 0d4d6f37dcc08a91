"""Inspection of parts without a complete brake: a mesh alone, or an unfinished model file."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import Brake, body_of
from squealstudy.models.components.component_facts import Inspection, component_facts
from squealstudy.models.components.dimensions import LENGTH, UNITS, extent_text
from squealstudy.models.components.faces import facet_groups
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.geometry import Geometry, geometry_of
from squealstudy.models.components.interface_facts import friction_of, tell_interfaces
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.mesh_files import FORMATS, read_mesh
from squealstudy.models.components.model_file import ModelFile, Numbers
from squealstudy.models.file_table import KeyPath
from squealstudy.wording import plural

# tables without which a model file is unfinished; a brake whose parts do not turn needs no rotation
NEEDED = ("contact", "load", "rotation")
MAX_LISTED_SETS = 12
ASSEMBLY_TABLES = ("contact", "tie", "coupling", "layer", "spring", "point_mass", "fixed", "load")


def part_alone(
    path: Path, units: str, part: str | None = None, pass_over: Sequence[str] = ()
) -> Brake:
    """A model of a single component, without contact, from a mesh file.

    Raises
    ------
    ModelError
        The ending of the file name is not that of a known format, or the file does not exist.
    """
    if path.suffix.lower() not in FORMATS:
        endings = ", ".join(FORMATS)
        raise ModelError(f"{path}: expected a model file (.toml) or a mesh: one of {endings}")
    if not path.is_file():
        raise ModelError(f"there is no file {path}")
    name = re.sub(r"\W", "_", path.stem)
    name = name if re.match(r"[A-Za-z_]", name) else f"part_{name}"
    table = {"mesh": path.name, "part": part, "pass_over": list(pass_over)}
    file = ModelFile.model_validate({"units": units, "components": {name: table}})
    content = hashlib.sha256(path.read_bytes()).hexdigest()
    return Brake(path, file, f"{path.resolve()} {content} {file!r}")


def inspect_parts(
    brake: Brake, overrides: Mapping[KeyPath, float]
) -> tuple[Inspection, Geometry | None]:
    """Inspect the components of a model file that is not finished.

    The inspection describes components that can be used, and has a doubt about each other one.

    Returns
    -------
    Inspection
    Geometry or None
        Of the components that can be used; None without any.
    """
    inspection = Inspection()
    usable = []
    for name, table in brake.file.components.items():
        try:
            body_of(brake, name)
            usable.append(name)
        except ModelError as error:
            inspection.doubts.append(f"{name}: {error}")
            if table.mesh is None:
                continue
            try:
                mesh = read_mesh(brake.located(table.mesh), table)
            except ModelError:
                continue  # the doubt says why
            kinds = ", ".join(f"{len(b.labels):,} {b.formulation}" for b in mesh.blocks)
            inspection.tell(name, f"{mesh.origin.name}: {len(mesh.nodes):,} nodes, {kinds}")
            unit = UNITS[brake.file.units][0]
            inspection.tell("", extent_text(mesh.nodes, unit))
            _sets(inspection, mesh, unit, 1.0)
    geometry = _geometry(brake, usable)
    if geometry is not None:
        size, numbers = LENGTH.factor(brake.file.units), Numbers(geometry.file, overrides)
        for body in geometry.bodies.values():
            component_facts(inspection, geometry, body, overrides)
            _sets(inspection, body.mesh, UNITS[brake.file.units][0], size)
        for number, pair in enumerate(geometry.contacts):
            contact = brake.file.contact[number]
            inspection.tell(
                brake.file.name_of("contact", number),
                f"{contact.kind}: {contact.slave} on {contact.master}, "
                f"{plural(len(pair.gap0), 'point')}, {100 * pair.in_reach:.1f} % of the slave"
                f"{friction_of(geometry, numbers, number)}",
            )
        tell_interfaces(inspection, numbers)
    lacking = [key for key in NEEDED if not brake.file.at((key,))]
    if lacking:
        inspection.tell("not yet", ", ".join(lacking))
    return inspection, geometry


def _geometry(brake: Brake, usable: Sequence[str]) -> Geometry | None:
    """Geometry of the whole file, or of the usable components alone where some are not usable."""
    if not usable:
        return None
    if len(usable) == len(brake.file.components):
        return geometry_of(brake)
    components = {name: brake.file.components[name] for name in usable}
    empty: dict[str, object] = dict.fromkeys(ASSEMBLY_TABLES, ())
    file = brake.file.model_copy(update={**empty, "components": components, "rotation": None})
    return geometry_of(replace(brake, file=file, identity=f"{brake.identity} {usable}"))


def _sets(inspection: Inspection, mesh: SolidMesh, unit: str, size: float) -> None:
    """Tell the sets of a mesh. `size` is one `unit` of length in coordinates of the mesh."""
    surfaces = []
    for name, faces in mesh.surfaces.items():
        groups = tuple(group.nodes for group in facet_groups(mesh, faces))
        area = Facets(mesh.nodes, groups, name).gauss_points(2)[0].area.sum()
        count = plural(len(faces), "facet")
        surfaces.append(f"{name} ({count}, {area / size**2:.4g} {unit}2)")
    names_by_kind = [
        ("surfaces", surfaces),
        ("node sets", [f"{n} ({len(s):,})" for n, s in mesh.node_sets.items()]),
        ("element sets", [f"{n} ({len(s):,})" for n, s in mesh.element_sets.items()]),
    ]
    for heading, names in names_by_kind:
        unlisted = (
            [f"and {len(names) - MAX_LISTED_SETS} more"] if len(names) > MAX_LISTED_SETS else []
        )
        if names:
            inspection.tell("", f"{heading}: {', '.join([*names[:MAX_LISTED_SETS], *unlisted])}")
    if not mesh.surfaces and not mesh.node_sets:
        inspection.tell(
            "", "no surfaces and no node sets: [components.NAME.sets] names faces by place"
        )
