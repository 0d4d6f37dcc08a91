"""Checks of the counts that headers in a mesh of gmsh state: meshio does not check them.

For text files of formats 2.2 and 4.1. Reading a binary file with wrong counts fails by itself.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from squealstudy.errors import ModelError
from squealstudy.files import expect_room, read_whole

FORMAT = re.compile(rb"\$MeshFormat\s+(\S+)\s+(\d+)")
SECTION = r"^[ \t]*\${0}[ \t]*\r?\n(.*?)^[ \t]*\$End{0}"
WORD_BYTES = 100  # memory of a word in a list of words
MOST_SHOWN = 5  # numbers in a message
Number = int | tuple[int, ...]  # of a node or element; dimension and number of a name or entity


def check_counts(path: Path) -> None:
    """Raise ModelError where a section has more or fewer lines than its header states.

    Also where two nodes, elements, names or entities have the same number.
    """
    content = _content(path)
    header = FORMAT.search(content)
    if header is None or header[2] != b"0":
        return  # meshio says what is wrong, or it is binary
    blocks = header[1].startswith(b"4")
    if blocks and not header[1].startswith(b"4.1"):
        return  # meshio refuses 4.0 in its own words
    readers: dict[tuple[str, str], Callable[[Sequence[list[bytes]], str], Sequence[Number]]] = {
        ("Nodes", "node"): _in_blocks if blocks else _in_a_list,
        ("Elements", "element"): _in_blocks if blocks else _in_a_list,
        ("PhysicalNames", "name"): _names,
        ("Entities", "entity"): _entities,
    }
    for (name, word), numbers_of in readers.items():
        section = re.search(SECTION.format(name).encode(), content, re.M | re.S)
        if section is None:
            continue  # meshio says so
        lines = [line.split() for line in section[1].splitlines() if line.strip()]
        try:
            numbers = numbers_of(lines, word)
        except ValueError as error:
            raise ModelError(f"{path}: section ${name}: {error}") from None
        _expect_unique(numbers, path, word)


def _content(path: Path) -> bytes:
    """The bytes of a file; ModelError where there is no room for its words."""
    try:
        content = read_whole(path)
        words = sum(map(content.count, (b" ", b"\n", b"\t", b"\r")))
        expect_room(2 * len(content) + WORD_BYTES * words)
    except OSError as error:
        raise ModelError(f"{path} cannot be read: {error}") from error
    return content


def _in_a_list(lines: Sequence[list[bytes]], word: str) -> list[int]:
    """Numbers of nodes or elements of format 2.2; ValueError where the header's count is wrong."""
    rows = _stated(lines, word)
    return [_whole_numbers(rows, k, 1)[0] for k in range(len(rows))]


def _names(lines: Sequence[list[bytes]], word: str) -> list[Number]:
    """Dimensions and numbers of physical names; ValueError where the header's count is wrong."""
    rows = _stated(lines, word)
    return [tuple(_whole_numbers(rows, k, 2)) for k in range(len(rows))]


def _stated(lines: Sequence[list[bytes]], word: str) -> Sequence[list[bytes]]:
    """The lines below a header; ValueError where it states another number of them."""
    stated, rows = _whole_numbers(lines, 0, 1)[0], lines[1:]
    if stated != len(rows):
        raise ValueError(f"its header states {stated} {word}s, there are {len(rows)}")
    return rows


def _entities(lines: Sequence[list[bytes]], _: str) -> list[Number]:
    """Dimensions and numbers of points to volumes; ValueError where the header's count is wrong."""
    stated, rows = _whole_numbers(lines, 0, 4), lines[1:]
    if sum(stated) != len(rows):
        raise ValueError(f"its header states {sum(stated)} entities, there are {len(rows)}")
    dimensions = [dimension for dimension, count in enumerate(stated) for _ in range(count)]
    return [(dimension, *_whole_numbers(rows, k, 1)) for k, dimension in enumerate(dimensions)]


def _in_blocks(lines: Sequence[list[bytes]], word: str) -> list[int]:
    """Numbers of nodes or elements of format 4.1; ValueError where a header's count is wrong."""
    n_blocks, stated = _whole_numbers(lines, 0, 2)
    numbers: list[int] = []
    line_number = 1
    for block in range(1, n_blocks + 1):
        count = _whole_numbers(lines, line_number, 4)[3]
        line_number += 1
        rows = range(line_number, line_number + count)
        of_block = [_whole_numbers(lines, k, 1)[0] for k in rows]
        if word == "node":  # their coordinates follow
            if any(len(lines[k]) != 1 for k in rows):
                raise ValueError(f"block {block} states {count} nodes and has others")
            line_number += count
        elif len({len(lines[k]) for k in rows}) > 1:
            raise ValueError(f"block {block} states {count} elements of one type and has others")
        numbers += of_block
        line_number += count
    if len(numbers) != stated:
        raise ValueError(f"its header states {stated} {word}s, its blocks {len(numbers)}")
    if line_number != len(lines):
        many_or_few = "many" if len(lines) > line_number else "few"
        raise ValueError(f"{abs(len(lines) - line_number)} lines too {many_or_few}")
    return numbers


def _whole_numbers(lines: Sequence[list[bytes]], line_number: int, count: int) -> list[int]:
    """The first `count` words of a line as whole numbers from 0; ValueError where they are not."""
    if line_number >= len(lines):
        raise ValueError("it has fewer lines than its header states")
    words = lines[line_number][:count]
    if len(words) < count or not all(word.isdigit() for word in words):
        line_text = b" ".join(lines[line_number])[:40].decode(errors="replace")
        raise ValueError(f"expected whole numbers, found '{line_text}'")
    return [int(word) for word in words]


def _expect_unique(numbers: Sequence[Number], path: Path, word: str) -> None:
    twice = [number for number, count in Counter(numbers).items() if count > 1]
    if twice:
        shown = ", ".join(map(str, twice[:MOST_SHOWN]))
        many = "entities" if word == "entity" else f"{word}s"
        raise ModelError(f"{path}: {many} {shown} are there twice")
