"""Run as a program of its own: what `mapdl_archive` reads of an archive of ANSYS, as an npz file.

Its reader is compiled and can crash on a damaged file, which then ends this process alone. The
arrays: ``nnum``, ``nodes``, ``node_angles``; ``elem`` end to end with ``elem_ends``; and each
component by its name, ``node_component:NAME`` or ``element_component:NAME``.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np


def main() -> None:
    """Read the archive that the first argument names into the file that the second names."""
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
