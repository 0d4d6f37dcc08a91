"""Change of gaps by a hot disc and hot pads, as in model files (THEORY.md eq. (118))."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from squealstudy.models.assembly import Assembly
from squealstudy.models.catalogue.disc_brake.solid_meshes import mesh_of_grid
from squealstudy.models.catalogue.disc_brake.solids import BrakeMesher
from squealstudy.models.components.heat import Statics, thermal_forces
from squealstudy.models.fem.solid import Solid


def hot_gaps(mesher: BrakeMesher, solids: Mapping[str, Solid], cold: Assembly) -> np.ndarray:
    """Change of the gaps (nc,) [m] of the cold assembly by heat."""
    load = np.zeros(cold.n_dof)
    for name, solid in solids.items():
        rise = temperature_rise(mesher, name, solid.coordinates[:, 2])
        if not rise.any():
            continue
        mesh = mesh_of_grid(name, solid.grid, mesher.materials(name), "C3D20R")
        alpha = mesher.v(f"{'disc' if name == 'disc' else 'pad'}.thermal_expansion")
        forces = thermal_forces(mesh, rise, dict.fromkeys(mesh.materials, alpha))
        load[cold.slices[name]] = forces
    K = (cold.K_el + cold.K_springs(static=True)).tocsr()
    gaps: np.ndarray = cold.contact.N @ Statics(K, cold.M)(load)
    return gaps


def temperature_rise(mesher: BrakeMesher, name: str, z: np.ndarray) -> np.ndarray:
    """Temperature rise (n,) [K] of a component at heights z (n,) [m] along the axis of the disc."""
    v, disc_thickness = mesher.v, mesher.v("disc.thickness")
    if name == "caliper":
        return np.zeros_like(z)
    if name == "disc":
        across = np.clip(z / disc_thickness, 0.0, 1.0) - 0.5
        return v("disc.temperature_rise") + v("disc.temperature_difference") * across
    depth = z - disc_thickness if name == "outer_pad" else -z
    thickness = v("pad.lining_thickness") + v("pad.plate_thickness")
    return v("pad.temperature_difference") * (1.0 - depth / thickness)
