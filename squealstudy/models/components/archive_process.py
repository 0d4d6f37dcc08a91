"""A program that reads an archive of ANSYS by `mapdl_archive` and writes an npz file.

The reader is compiled and can crash on a damaged file. In a process of its own it takes nothing
else with it. The file has the arrays ``nnum``, ``nodes`` and ``node_angles``; ``elem``, one element
after the other, with ``elem_ends``, where each ends; and one for each component,
``node_component:NAME`` or ``element_component:NAME``.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np


def main() -> None:
    """Read the archive of the first argument and write the file of the second."""
    import mapdl_archive

    archive = mapdl_archive.Archive(sys.argv[1], parse_vtk=False)
    elements = [np.asarray(element, dtype=np.int64) for element in archive.elem]
    arrays: dict[str, Any] = {
        "nnum": np.asarray(archive.nnum),
        "nodes": np.asarray(archive.nodes, dtype=float),
        "node_angles": np.asarray(archive.node_angles, dtype=float),
        "elem": np.concatenate([np.zeros(0, dtype=np.int64), *elements]),
        "elem_ends": np.cumsum([len(element) for element in elements], dtype=np.int64),
    }
    arrays |= {f"node_component:{k}": np.asarray(v) for k, v in archive.node_components.items()}
    arrays |= {
        f"element_component:{k}": np.asarray(v) for k, v in archive.element_components.items()
    }
    with open(sys.argv[2], "wb") as file:
        np.savez(file, **arrays)


if __name__ == "__main__":
    main()
