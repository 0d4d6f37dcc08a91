"""Elastic materials of components: moduli, each with its matrix in the stiffness, and axes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.fem.solid import VOIGT, Isotropic, orthotropic_stiffness

# entries of the stiffness tensor in the order of Abaqus and CalculiX
ENTRIES = ("1111", "1122", "2222", "1133", "2233", "3333", "1212", "1313", "2323")
ALL_ENTRIES = (
    *("1111", "1122", "2222", "1133", "2233", "3333", "1112", "2212", "3312", "1212", "1113"),
    *("2213", "3313", "1213", "1313", "1123", "2223", "3323", "1223", "1323", "2323"),
)


@dataclass(frozen=True)
class Orthotropic:
    """Material with three planes of symmetry, in the axes of its orientation.

    Attributes
    ----------
    entries : tuple of 9 floats
        D1111, D1122, D2222, D1133, D2233, D3333, D1212, D1313, D2323 of the stiffness tensor.
    density : float

    Raises
    ------
    ModelError
        Numbers are not finite, the density is not positive, or the stiffness is not positive
        definite.
    """

    entries: tuple[float, ...]
    density: float

    NAMES: ClassVar[tuple[str, ...]] = ENTRIES

    def __post_init__(self) -> None:
        if len(self.entries) != len(self.NAMES):
            raise ModelError(f"expected {len(self.NAMES)} moduli, got {len(self.entries)}")
        if not np.isfinite([*self.entries, self.density]).all() or self.density <= 0:
            raise ModelError(f"expected a positive density and finite moduli, got {self}")
        if np.linalg.eigvalsh(self.stiffness())[0] <= 0:
            raise ModelError(f"moduli {self.entries} give no positive definite stiffness")

    @classmethod
    def from_engineering(
        cls,
        young: tuple[float, float, float],
        poisson: tuple[float, float, float],
        shear: tuple[float, float, float],
        density: float,
    ) -> Orthotropic:
        """From E1 E2 E3, nu12 nu13 nu23 and G12 G13 G23, the order of files; nu12 is the
        contraction along 2 under tension along 1.
        """
        G12, G13, G23 = shear
        C = orthotropic_stiffness(young, poisson, (G23, G13, G12), density)
        return cls(tuple(float(C[_row_and_column(entry)]) for entry in ENTRIES), density)

    def stiffness(self) -> np.ndarray:
        """Stiffness matrix (6, 6), engineering shear strains, order 11 22 33 23 13 12."""
        return np.sum([m.value * m.unit for m in moduli(self)], axis=0)


@dataclass(frozen=True)
class Anisotropic(Orthotropic):
    """Material without symmetry: 21 entries of the stiffness tensor, in the order of files."""

    NAMES: ClassVar[tuple[str, ...]] = ALL_ENTRIES

    @classmethod
    def of_stiffness(cls, C: np.ndarray, density: float) -> Anisotropic:
        """Material of a stiffness (6, 6), order 11 22 33 23 13 12, engineering shear strains."""
        return cls(tuple(float(C[_row_and_column(entry)]) for entry in ALL_ENTRIES), density)


Elastic = Isotropic | Orthotropic


@dataclass(frozen=True)
class Unfinished:
    """A material whose file does not state all numbers.

    Attributes
    ----------
    moduli : Isotropic, Orthotropic, Anisotropic or None
        Moduli, as a material with a density of 1; None where they are missing.
    density : float or None
        Density; None where it is missing.
    missing : str
        What is missing, with file and line.
    """

    moduli: Elastic | None
    density: float | None
    missing: str


@dataclass(frozen=True)
class Modulus:
    """A factor in the stiffness: its name, its value, and the matrix (6, 6) that it multiplies."""

    name: str
    value: float
    unit: np.ndarray


def _row_and_column(entry: str) -> tuple[int, int]:
    """Row and column (of 6) of an entry such as 1122."""
    i, j, k, l = (int(c) - 1 for c in entry)  # noqa: E741
    return int(VOIGT[i, j]), int(VOIGT[k, l])


def moduli(material: Elastic) -> tuple[Modulus, ...]:
    """The moduli in which the stiffness of a material is linear.

    Isotropic: ``lambda`` and ``mu`` of Lame; others: ``D1111`` ... ``D2323``.
    """
    if isinstance(material, Isotropic):
        E, nu = material.young_modulus, material.poisson_ratio
        volume = np.zeros((6, 6))
        volume[:3, :3] = 1.0
        return (
            Modulus("lambda", E * nu / ((1 + nu) * (1 - 2 * nu)), volume),
            Modulus("mu", E / (2 * (1 + nu)), np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0])),
        )
    moduli_list = []
    for entry, stiffness in zip(material.NAMES, material.entries, strict=True):
        unit = np.zeros((6, 6))
        unit[_row_and_column(entry)] = unit[_row_and_column(entry)[::-1]] = 1.0
        moduli_list.append(Modulus(f"D{entry}", stiffness, unit))
    return tuple(moduli_list)


@dataclass(frozen=True)
class Orientation:
    """Material axes, as ``*ORIENTATION`` gives them.

    Attributes
    ----------
    system : str
        rectangular: axis 1 towards a, axis 2 in the plane of a and b; cylindrical: a and b on the
        axis, which is 3; 1 is radial, 2 in the circumference.
    a, b, origin : tuple of 3 floats
    turn : tuple (int, float)
        Local axis 1, 2 or 3 and the angle [deg] by which the others then turn about it.

    Raises
    ------
    ModelError
        The points do not define axes.
    """

    system: Literal["rectangular", "cylindrical"]
    a: tuple[float, float, float]
    b: tuple[float, float, float]
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[int, float] = (1, 0.0)

    def __post_init__(self) -> None:
        a, b, o = (np.array(p, dtype=float) for p in (self.a, self.b, self.origin))
        if self.system == "cylindrical":
            if not np.linalg.norm(b - a) > 0:
                raise ModelError("the two points of the axis of an orientation are one")
        elif not np.linalg.norm(np.cross(a - o, b - o)) > (
            1e-10 * np.linalg.norm(a - o) * np.linalg.norm(b - o)
        ):
            raise ModelError("the points of an orientation lie on one line")

    def moved(self, turn: np.ndarray, shift: np.ndarray) -> Orientation:
        """The orientation of a body whose points x are moved to turn x + shift."""
        a, b, o = (_point(turn @ np.array(p) + shift) for p in (self.a, self.b, self.origin))
        return replace(self, a=a, b=b, origin=o)

    def axes(self, points: np.ndarray) -> np.ndarray:
        """Unit vectors of axes 1, 2, 3 as rows (..., 3, 3) at points (..., 3).

        Raises ModelError where a point lies on the axis of a cylindrical system.
        """
        a, b, o = (np.array(p, dtype=float) for p in (self.a, self.b, self.origin))
        if self.system == "rectangular":
            first = _unit(a - o)
            third = _unit(np.cross(first, b - o))
            axes = np.stack([first, np.cross(third, first), third])
            axes = np.broadcast_to(axes, (*points.shape, 3))
        else:
            third = _unit(b - a)
            from_axis = points - a - ((points - a) @ third)[..., None] * third
            if not (np.linalg.norm(from_axis, axis=-1) > 1e-12 * np.abs(points).max()).all():
                raise ModelError("an element lies on the axis of its cylindrical orientation")
            first = _unit(from_axis)
            third = np.broadcast_to(third, first.shape)
            axes = np.stack([first, np.cross(third, first), third], axis=-2)
        about, angle = self.turn
        j, k = about % 3, (about + 1) % 3
        c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        turned = axes.copy()
        turned[..., j, :] = c * axes[..., j, :] + s * axes[..., k, :]
        turned[..., k, :] = c * axes[..., k, :] - s * axes[..., j, :]
        return turned


def _point(x: np.ndarray) -> tuple[float, float, float]:
    return float(x[0]), float(x[1]), float(x[2])


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)
