"""Linear elastic materials as 6 x 6 stiffness in Voigt order xx, yy, zz, yz, xz, xy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.errors import ModelError


@dataclass(frozen=True)
class Isotropic:
    """Isotropic material.

    Parameters
    ----------
    young_modulus : float
        E, Pa, > 0.
    poisson_ratio : float
        nu, -1 < nu < 0.5.
    density : float
        kg/m3, > 0.
    """

    young_modulus: float
    poisson_ratio: float
    density: float

    def stiffness(self) -> np.ndarray:
        """Stiffness matrix (6, 6), Pa, engineering shear strains."""
        E, nu = self.young_modulus, self.poisson_ratio
        return _orthotropic((E, E, E), (nu, nu, nu), (E / (2 * (1 + nu)),) * 3, self.density)


@dataclass(frozen=True)
class TransverselyIsotropic:
    """Material isotropic in the x-y plane, another along z: a brake lining.

    Parameters
    ----------
    young_modulus : float
        In the plane, Pa.
    young_modulus_z : float
        Through the thickness, Pa.
    shear_modulus_z : float
        In the planes that hold z, Pa.
    poisson_ratio : float
        In the plane.
    poisson_ratio_z : float
        Contraction along z under load in the plane, nu_pz.
    density : float
        kg/m3.
    """

    young_modulus: float
    young_modulus_z: float
    shear_modulus_z: float
    poisson_ratio: float
    poisson_ratio_z: float
    density: float

    def stiffness(self) -> np.ndarray:
        """Stiffness matrix (6, 6), Pa, engineering shear strains."""
        E, Ez, Gz = self.young_modulus, self.young_modulus_z, self.shear_modulus_z
        G = E / (2 * (1 + self.poisson_ratio))
        nu = (self.poisson_ratio, self.poisson_ratio_z, self.poisson_ratio_z)
        return _orthotropic((E, E, Ez), nu, (Gz, Gz, G), self.density)


Material = Isotropic | TransverselyIsotropic


def _orthotropic(
    E: tuple[float, float, float],
    nu: tuple[float, float, float],
    G: tuple[float, float, float],
    density: float,
) -> np.ndarray:
    """Invert the compliance; nu = (xy, xz, yz). Raises ModelError where it is not definite."""
    nu_xy, nu_xz, nu_yz = nu
    S = np.zeros((6, 6))
    if min(*E, *G, density) <= 0:
        raise ModelError(f"moduli and density must be positive, got E={E}, G={G}, rho={density}")
    S[0, 0], S[1, 1], S[2, 2] = 1 / E[0], 1 / E[1], 1 / E[2]
    S[0, 1] = S[1, 0] = -nu_xy / E[0]
    S[0, 2] = S[2, 0] = -nu_xz / E[0]
    S[1, 2] = S[2, 1] = -nu_yz / E[1]
    S[3, 3], S[4, 4], S[5, 5] = 1 / G[0], 1 / G[1], 1 / G[2]
    if np.linalg.eigvalsh(S)[0] <= 0:
        raise ModelError(f"elastic constants E={E}, nu={nu} give no positive definite stiffness")
    return np.linalg.inv(S)
