"""Components from archives of ANSYS (``.cdb``, written by CDWRITE).

`mapdl_archive` (the extra ``ansys``) reads nodes, elements and components. This module reads all
other commands: an unknown one is an error, and one that is left out is listed, unless it only sets
up a solution. Elements have the formulations of this program, not those of ANSYS. Element sets are
named TYPE3 and MAT2, by element type and material, and as the components of the file.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.ansys_archive import ArchiveBlocks, read_blocks
from squealstudy.models.components.ansys_commands import (
    ENDS,
    NON_STRUCTURAL_ELEMENTS,
    PASSED_OVER,
    READ,
    SETTINGS,
    SOLIDS,
)
from squealstudy.models.components.ansys_degenerate import PYRAMID, TETRAHEDRON, WEDGE
from squealstudy.models.components.ansys_materials import materials
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.materials import Orthotropic
from squealstudy.models.components.mesh import ElementBlock, PassedOver, SolidMesh
from squealstudy.models.components.middle_nodes import LACKING, Middles
from squealstudy.models.matrices.text import TextFile

FIELDS = 10  # number of fields of an element before its nodes
MATERIAL, TYPE, AXES, LABEL = 0, 1, 4, 8  # columns among them


@dataclass(frozen=True)
class _Type:
    """An element type of the file: its number in ANSYS's library, and values by KEYOPT number."""

    element: int
    options: Mapping[int, int]

    @property
    def name(self) -> str:
        return f"SOLID{self.element}" if self.element in SOLIDS else f"ELEMENT{self.element}"


def read_cdb(
    path: Path,
    part: str | None = None,
    *,
    treat_as: Mapping[str, str] | None = None,
    pass_over: Collection[str] = (),
) -> SolidMesh:
    """Read a component from an archive of ANSYS, in the units of the file.

    Parameters
    ----------
    path : Path
    part : str or None
        Element set to read: TYPE3, MAT2, or a component of the file. None reads all elements.
    treat_as : dict of str -> str
        Formulation by solid element, such as SOLID185. Bricks with corners in one place stay
        wedges, pyramids or tetrahedra.
    pass_over : collection of str
        Unsupported commands, and elements such as ELEMENT21, to leave out without an error.

    Returns
    -------
    SolidMesh
        `passed_over` lists commands and elements that are left out, except solution settings.

    Raises
    ------
    ModelError
        `mapdl_archive` is not installed; a command is malformed, or names something that the file
        lacks; commands or elements are not supported (one message lists all of them). The message
        names the file, and for a command its line.
    """
    formulation_of = treat_as or {}
    names = [f"SOLID{n}" for n in SOLIDS]
    for name, formulation in formulation_of.items():
        if name not in names or formulation not in FORMULATIONS:
            raise ModelError(
                f"{path}: treat_as {name} = '{formulation}': expected one of {', '.join(names)} "
                f"and a formulation of {', '.join(FORMULATIONS)}"
            )
    mesh = _Deck(path, formulation_of, {name.upper() for name in pass_over}).mesh()
    return mesh if part is None else mesh.part(mesh.find("element_sets", part))


class _Deck:
    """The commands of an archive, and the component that they describe."""

    def __init__(self, path: Path, treat_as: Mapping[str, str], ignored: set[str]) -> None:
        self._path, self._treat_as, self._ignored = path, treat_as, ignored
        self._notes: list[PassedOver] = []
        text = TextFile.read(path)
        self._text = text
        self._commands: dict[str, list[tuple[Line, list[str]]]] = {}
        for line_number, line in enumerate(text.lines):
            words = [w.strip() for w in line.split("!")[0].split(",")]
            if words[0] and (words[0][0].isalpha() or words[0][0] in "/*"):
                same_commands = self._commands.setdefault(words[0].upper(), [])
                same_commands.append((Line(text, line_number), words[1:]))
        self._refuse_unknown()

    def _all(self, *names: str) -> Iterator[tuple[Line, list[str]]]:
        for name in names:
            yield from self._commands.get(name, [])

    def _note(self, command: str, count: int, line: Line | None, why: str) -> None:
        shown = f"{command} ({count})" if count > 1 else command
        self._notes.append(PassedOver(shown, self._path, line.place + 1 if line else 0, why))

    def _refuse_unknown(self) -> None:
        unknown, names = [], []
        for name, cards in self._commands.items():
            if name in ENDS:
                for line, words in cards:
                    if "-1" not in words:
                        raise line.error(
                            f"expected the end of a block, {name},...,-1: write blocks "
                            "(CDWRITE,DB,NAME,CDB)"
                        )
            elif name in PASSED_OVER or name in self._ignored:
                self._note(name, len(cards), cards[0][0], PASSED_OVER.get(name, "as asked for"))
            elif name not in READ and name not in SETTINGS:
                names.append(name)
                text = f"{name} ({len(cards)}, first in line {cards[0][0].place + 1})"
                unknown.append((cards[0][0], text))
        if unknown:
            raise unknown[0][0].error(
                f"commands that are not supported: {', '.join(t for _, t in unknown)}; where "
                f"neither mass nor stiffness depend on them: pass_over = [{_pasted(names)}]"
            )

    def mesh(self) -> SolidMesh:
        """The component."""
        types = self._types()
        archive = self._blocks()
        numbers, order = np.unique(archive.nnum, return_index=True)
        if len(numbers) < len(archive.nnum):
            raise ModelError(f"{self._path}: two nodes have the same number")
        if np.any(archive.node_angles):
            turned = int(np.any(archive.node_angles, axis=1).sum())
            self._note("turned axes of nodes", turned, None, "they are of supports and loads")
        fields = np.array([element[:FIELDS] for element in archive.elem])
        blocks, rows = self._solids(archive.elem, fields, types, numbers)
        fields = fields[rows]
        nodes = np.asarray(archive.nodes, dtype=float)[order]
        all_nodes, labels = self._middles.added(nodes, numbers.astype(np.int64))
        mesh = SolidMesh(self._path, all_nodes, labels, blocks)
        mesh = replace(mesh, element_sets=self._element_sets(archive, fields))
        mesh = self._middles.tied(replace(mesh, node_sets=self._node_sets(archive, numbers)))
        mesh = self._with_materials(mesh, fields[:, AXES])
        if not (used := mesh.used_nodes()).all():
            why = f"{mesh.nodes_named(np.flatnonzero(~used))}: no solid has such a node"
            self._note("NBLOCK", 1, None, why)
            mesh = mesh.part(np.arange(mesh.n_elements))
        lumped = any(words[:1] and words[0].upper() == "ON" for _, words in self._all("LUMPM"))
        if lumped:
            self._note("LUMPM", 1, None, "masses are lumped, as here; mass = 'full' does not")
        return replace(mesh, lumped=lumped, passed_over=(*mesh.passed_over, *self._notes))

    # -- blocks ----------------------------------------------------------------------------------
    def _blocks(self) -> ArchiveBlocks:
        """Blocks as `mapdl_archive` reads them, compared with their headers."""
        for name in ("NBLOCK", "EBLOCK"):
            if name not in self._commands:
                raise ModelError(f"{self._path} has no {name}: expected what CDWRITE writes")
            if len(self._commands[name]) > 1:
                raise self._commands[name][1][0].error(f"expected one {name}")
            line, words = self._commands[name][0]
            if len(words) < 2 or words[1].upper() != "SOLID":
                raise line.error(f"expected {name}, number of fields, SOLID")
        blocks = read_blocks(self._text)
        count = {"NBLOCK": len(blocks.nnum), "EBLOCK": len(blocks.elem)}
        for name, read in count.items():
            line, words = self._commands[name][0]
            stated = line.whole(words[3], "a number") if len(words) > 3 and words[3] else read
            if stated != read or not read:
                raise line.error(f"expected {stated} lines of the block, could read {read}")
        for line, words in self._all("CMBLOCK"):
            if len(words) < 3:
                raise line.error("expected CMBLOCK, name, NODE or ELEM, count")
            is_node = words[1].upper() == "NODE"
            members = blocks.node_components if is_node else blocks.element_components
            stated = line.whole(words[2], "a number")
            read = self._numbers_after(line)
            if words[0] not in members or stated != read:
                raise line.error(f"expected {stated} numbers of component {words[0]}, found {read}")
        return blocks

    def _numbers_after(self, line: Line) -> int:
        """Count the numbers of a block: its first line is the command, its second the format."""
        count = 0
        for text in self._text.lines[line.place + 2 :]:
            if not re.match(r"\s*[-+0-9]", text):
                break
            count += len(text.split())
        return count

    def _types(self) -> dict[int, _Type]:
        """Element types by number."""
        element: dict[int, int] = {}
        options: dict[int, dict[int, int]] = {}
        for line, words in self._all("ET"):
            values = [line.whole(w, "a whole number") for w in words if w]
            if len(values) < 2:
                raise line.error("expected a type and an element, ET,1,186")
            element[values[0]] = values[1]
            options[values[0]] = {k: v for k, v in enumerate(values[2:], 1) if v}
        for line, words in self._all("ETBLOCK"):
            start = line.place + 2
            for _ in range(line.whole("".join(words[:1]), "the number of types")):
                type_line = Line(self._text, start)
                values = [
                    type_line.whole(w, "whole numbers") for w in self._text.line(start).split()
                ]
                if len(values) < 2:
                    raise type_line.error("expected a type and an element")
                element[values[0]] = values[1]
                options[values[0]] = {k: v for k, v in enumerate(values[2:20], 1) if v}
                start += 1
        for line, words in self._all("KEYOP", "KEYOPT"):
            values = [line.whole(w, "a whole number") for w in words if w]
            if len(values) != 3 or values[0] not in element:
                raise line.error("expected the type of an ET above, an option, its value")
            options[values[0]][values[1]] = values[2]
        return {t: _Type(n, options[t]) for t, n in element.items()}

    def _solids(
        self,
        elements: list[np.ndarray],
        fields: np.ndarray,
        types: Mapping[int, _Type],
        numbers: np.ndarray,
    ) -> tuple[tuple[ElementBlock, ...], np.ndarray]:
        """Blocks of solid elements by formulation, and their rows (n,) in `elements`."""
        type_numbers, labels = fields[:, TYPE], fields[:, LABEL]
        self._middles = Middles(len(numbers))
        self._refuse_others(type_numbers, types)
        rows: dict[str, list[tuple[int, np.ndarray]]] = {}
        for number, element_type in types.items():
            if element_type.element not in SOLIDS:
                continue
            count, _, _, _ = SOLIDS[element_type.element]
            of_type = np.flatnonzero(type_numbers == number)
            formulation = self._formulation(number, element_type) if len(of_type) else ""
            for row in of_type:
                nodes = elements[row][FIELDS:]
                name = f"element {labels[row]} ({element_type.name})"
                corners = {20: 8, 10: 4}.get(count, count)
                if not corners <= len(nodes) <= count or (nodes[:corners] <= 0).any():
                    raise ModelError(
                        f"{self._path}: {name}: expected {count} nodes, found "
                        f"{int((nodes > 0).sum())}"
                    )
                nodes = np.append(nodes, np.zeros(count - len(nodes), dtype=nodes.dtype))
                shape, columns = self._shape(name, nodes, formulation)
                own_nodes = nodes[columns]
                if (missing := ~np.isin(own_nodes, numbers) & (own_nodes > 0)).any():
                    raise ModelError(
                        f"{self._path}: {name}: there is no node {own_nodes[missing][0]}"
                    )
                indices = np.where(own_nodes > 0, np.searchsorted(numbers, own_nodes), LACKING)
                indices = self._middles.filled(FORMULATIONS[shape].shape, indices)
                rows.setdefault(shape, []).append((int(row), indices))
        if not rows:
            raise ModelError(f"{self._path} has no solid element: {', '.join(map(str, SOLIDS))}")
        blocks = tuple(
            ElementBlock(
                name,
                np.array([nodes for _, nodes in pairs]),
                labels[[row for row, _ in pairs]],
            )
            for name, pairs in rows.items()
        )
        order = np.array([row for pairs in rows.values() for row, _ in pairs])
        if len(np.unique(labels[order])) < len(order):
            raise ModelError(f"{self._path}: two elements have the same number")
        return blocks, order

    def _refuse_others(self, type_numbers: np.ndarray, types: Mapping[int, _Type]) -> None:
        """Raise ModelError about elements that are neither solids nor to be passed over."""
        refused, names = [], []
        for number in np.unique(type_numbers):
            if number not in types:
                raise ModelError(f"{self._path}: there is no ET of type {number}")
            kind, count = types[number], int((type_numbers == number).sum())
            if kind.element in SOLIDS:
                continue
            if kind.element in NON_STRUCTURAL_ELEMENTS or kind.name in self._ignored:
                why = NON_STRUCTURAL_ELEMENTS.get(kind.element, "as asked for")
                self._note(kind.name, count, None, why)
            else:
                names.append(kind.name)
                refused.append(f"{kind.name} ({count})")
        if refused:
            raise ModelError(
                f"{self._path}: elements that are not supported: {', '.join(refused)}: state "
                "masses, springs and ties in the model file, then name these: pass_over = "
                f"[{_pasted(names)}]"
            )

    def _formulation(self, number: int, element_type: _Type) -> str:
        """Formulation of the elements of a type whose corners are all different."""
        _, option, formulations, plain = SOLIDS[element_type.element]
        if element_type.name in self._treat_as:
            return self._treat_as[element_type.name]
        chosen = element_type.options.get(option, 0)
        wrong = [k for k in plain if element_type.options.get(k, 0)]
        if chosen not in formulations or wrong:
            wrong = wrong or [option]
            raise ModelError(
                f"{self._path}: type {number}, {element_type.name} with KEYOPT({wrong[0]}) = "
                f"{element_type.options[wrong[0]]}, is not supported: choose a formulation by "
                f"treat_as {{{element_type.name} = '...'}}"
            )
        return formulations[chosen]

    def _shape(self, name: str, nodes: np.ndarray, formulation: str) -> tuple[str, np.ndarray]:
        """Formulation of an element, and which of `nodes` are its nodes, in our order."""
        count = FORMULATIONS[formulation].shape.nodes
        every = np.arange(len(nodes))
        if len(nodes) not in (8, 20) or len(np.unique(nodes[:8])) == 8:
            present = nodes[nodes > 0]
            if count == len(nodes) and len(present) == len(np.unique(present)):
                return formulation, every
            if count != len(nodes):
                raise ModelError(f"{self._path}: {name}: {formulation} has {count} nodes")
            raise ModelError(f"{self._path}: {name}: a node is there twice")
        corners = nodes[:8]
        quadratic = len(nodes) == 20
        if corners[2] == corners[3] and len(np.unique(corners[4:])) == 1:
            kind, n_corners = TETRAHEDRON[quadratic], 4
        elif corners[2] == corners[3] and corners[6] == corners[7]:
            kind, n_corners = WEDGE[quadratic], 6
        elif len(np.unique(corners[4:])) == 1:
            kind, n_corners = PYRAMID[quadratic], 5
        else:
            raise ModelError(
                f"{self._path}: {name}: bricks with corners in one place may be wedges (K = L, "
                "O = P), pyramids (M = N = O = P) or tetrahedra (K = L, M = N = O = P)"
            )
        shape, columns = kind
        used = nodes[list(columns)]
        used = used[used > 0]
        if len(np.unique(corners)) != n_corners or len(np.unique(used)) < len(used):
            raise ModelError(f"{self._path}: {name}: a node is there twice")
        return shape, np.array(columns)

    # -- sets and materials ----------------------------------------------------------------------
    def _element_sets(self, archive: Any, fields: np.ndarray) -> dict[str, np.ndarray]:
        sets = {}
        for kind, column in (("TYPE", TYPE), ("MAT", MATERIAL)):
            for number in np.unique(fields[:, column]):
                sets[f"{kind}{number}"] = np.flatnonzero(fields[:, column] == number)
        for name, labels in archive.element_components.items():
            if name in sets:
                raise ModelError(f"{self._path}: a component cannot have the name {name}")
            sets[name] = np.flatnonzero(np.isin(fields[:, LABEL], labels))
        return sets

    def _node_sets(self, archive: Any, numbers: np.ndarray) -> dict[str, np.ndarray]:
        sets = {}
        for name, members in archive.node_components.items():
            if not np.isin(members, numbers).all():
                missing = members[~np.isin(members, numbers)][0]
                raise ModelError(f"{self._path}: component {name}: there is no node {missing}")
            sets[name] = np.flatnonzero(np.isin(numbers, members))
        return sets

    def _with_materials(self, mesh: SolidMesh, axes: np.ndarray) -> SolidMesh:
        by_name, notes = materials(self._all("MP"), self._all("MPDATA"))
        for label, (line, why) in notes.items():
            self._note(label, 1, line, why)
        for name, material in by_name.items():
            if name not in mesh.element_sets:
                continue
            turned = axes[mesh.element_sets[name]] != 0
            if isinstance(material, Orthotropic) and turned.any():
                raise ModelError(
                    f"{self._path}: {name} is orthotropic in the axes of an element coordinate "
                    "system (ESYS), which are not read: only the global ones are"
                )
            mesh = mesh.with_material(name, material, name)
        return mesh


def _pasted(names: list[str]) -> str:
    """Names in quotes, without repetition, as a list of a model file has them."""
    return ", ".join(f'"{name}"' for name in dict.fromkeys(names))
