"""The table of a component in a model file, and the tables in it: their keys and allowed values."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from squealstudy.models.components.formulations import MassRule
from squealstudy.models.components.sectors import MAX_SECTORS
from squealstudy.models.file_table import Name, Table, Texts, Vector

Pair2 = Annotated[tuple[float, float], Strict(False)]
Corners = Annotated[tuple[Vector, Vector], Strict(False)]
Moduli = float | Vector
Damping = Annotated[float, Field(ge=0)]


class TurnTable(Table):
    """A rotation of a component, by the right-hand rule."""

    axis: Vector = Field(description="direction of the axis")
    angle: float = Field(description="deg")
    point: Vector = Field(default=(0.0, 0.0, 0.0), description="a point of the axis")


class RepeatTable(Table):
    """A sector of the component, which repeats about an axis."""

    axis: Vector = Field(description="direction of the axis")
    count: int = Field(ge=2, le=MAX_SECTORS, description="sectors of the whole component")
    point: Vector = Field(default=(0.0, 0.0, 0.0), description="a point of the axis")

    @model_validator(mode="after")
    def _direction(self) -> RepeatTable:
        if not any(self.axis):
            raise ValueError("axis: expected a direction, got zeros")
        return self


class MaterialTable(Table):
    """A material: isotropic, or orthotropic with three values of each modulus.

    Keys given here replace values of the mesh's file. For other keys the file's values hold.
    """

    E: Moduli | None = Field(default=None, description="Young's modulus, or [E1, E2, E3]")
    nu: Moduli | None = Field(default=None, description="Poisson's ratio, or [nu12, nu13, nu23]")
    G: Vector | None = Field(default=None, description="[G12, G13, G23] of an orthotropic one")
    rho: float | None = Field(default=None, gt=0, description="density")
    thermal_expansion: float | None = Field(
        default=None, description="strain per kelvin, in all directions; hot components need it"
    )
    elements: str | None = Field(
        default=None,
        description="element set that has it; default: elements with a material of this name in "
        "the mesh, or the element set of this name, or all elements",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> MaterialTable:
        """Raise ValueError unless constants are of an isotropic or an orthotropic material."""
        kinds = {isinstance(v, tuple) for v in (self.E, self.nu, self.G) if v is not None}
        lacks_shear = self.G is None and isinstance(self.E, tuple) and isinstance(self.nu, tuple)
        if len(kinds) > 1 or lacks_shear:
            raise ValueError(
                "expected E, nu and no G (isotropic), or three numbers each of E, nu and G"
            )
        return self

    @property
    def has_all_moduli(self) -> bool:
        """Whether the table states E and nu, and so all moduli."""
        return self.E is not None and self.nu is not None


class HeatTable(Table):
    """Temperatures of a component above that of its mesh. Its expansion changes initial gaps."""

    file: str | None = Field(
        default=None,
        description="file with a line of names, x, y, z, temperature, and a line for each place, "
        "in the unit and the coordinates of the component's file",
    )
    reference: float | None = Field(
        default=None, description="temperature of the mesh, in the scale of the file"
    )
    rise: float = Field(
        default=0.0, description="without a file: temperature above that of the mesh at point, K"
    )
    gradient: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="change of temperature, K per unit of length, in the coordinates of the file",
    )
    point: Vector = Field(default=(0.0, 0.0, 0.0), description="point of the temperature rise")
    scale: float = Field(default=1.0, description="factor on temperatures above the reference")

    @model_validator(mode="after")
    def _one_field(self) -> HeatTable:
        if (self.file is None) != (self.reference is None):
            raise ValueError("expected file and reference, the temperature of the mesh, together")
        if (self.file is not None) == (self.rise != 0.0 or any(self.gradient)):
            raise ValueError("expected file and reference, or rise and gradient")
        return self


class PlaneTable(Table):
    """A plane."""

    point: Vector = Field(description="a point of it")
    normal: Vector = Field(description="direction across it")


class CylinderTable(Table):
    """A cylinder, or the space between two cylinders of one axis."""

    axis: Vector = Field(description="direction of the axis")
    point: Vector = Field(default=(0.0, 0.0, 0.0), description="a point of the axis")
    radius: float | Pair2 = Field(description="radius, or the least and the greatest")


class SetTable(Table):
    """A surface of a mesh: the outer faces that fulfil all given conditions.

    Coordinates are those of the mesh's file, before the component is rotated and shifted.
    """

    box: Corners | None = Field(
        default=None, description="two opposite corners of a box with all nodes of the faces"
    )
    plane: PlaneTable | None = Field(default=None, description="plane of all nodes of the faces")
    cylinder: CylinderTable | None = Field(
        default=None, description="cylinder of all nodes of the faces"
    )
    normal: Vector | None = Field(
        default=None, description="direction in which the faces point, outwards"
    )
    angle: float = Field(
        default=10.0, gt=0, le=180, description="largest angle of a face to normal, deg"
    )
    tolerance: float | None = Field(
        default=None,
        gt=0,
        description="largest distance of nodes from box, plane or cylinder; default: a thousandth "
        "of the longest side",
    )
    elements: str | None = Field(default=None, description="element set that has the faces")

    @model_validator(mode="after")
    def _something(self) -> SetTable:
        if not any(
            getattr(self, key) for key in ("box", "plane", "cylinder", "normal", "elements")
        ):
            raise ValueError("expected box, plane, cylinder, normal or elements")
        return self


class MatrixTable(Table):
    """One of several matrices of a file."""

    file: str = Field(description="file of the matrix")
    name: str = Field(description="which: a variable, or the name of a DMIG matrix")


class ComponentTable(Table):
    """A component: a mesh with materials, or matrices with a mesh that names their nodes."""

    mesh: str | None = Field(default=None, description="file .inp, .msh, .unv, .med, .bdf or .cdb")
    part: str | None = Field(default=None, description="instance or element set of the mesh's file")
    dialect: Literal["abaqus", "calculix"] | None = Field(
        default=None, description="whose C3D8 an .inp means"
    )
    treat_as: dict[str, str] = Field(default={}, description="elements to be read as others")
    pass_over: Texts = Field(default=(), description="keywords of its file to pass over")
    mass: MassRule | None = Field(
        default=None,
        description="full: consistent; as_stiffness: consistent, integrated at the points of the "
        "stiffness; lumped: at the nodes; default: lumped where a deck of Nastran or ANSYS is, "
        "else full",
    )
    temperature: float | None = Field(
        default=None, description="temperature at which to take materials of its file"
    )
    heat: HeatTable | None = Field(
        default=None, description="temperatures by which it expands; default: that of its mesh"
    )
    materials: dict[str, MaterialTable] = Field(default={}, description="by name")
    sets: dict[Name, SetTable] = Field(
        default={}, description="surfaces by position and normal of their faces, by name"
    )
    K: str | MatrixTable | None = Field(default=None, description="file of the stiffness matrix")
    M: str | MatrixTable | None = Field(default=None, description="file of the mass matrix")
    C: str | MatrixTable | None = Field(default=None, description="file of a damping matrix")
    dof: str | None = Field(
        default=None,
        description="file with 'node.direction' or 'modal' for each row of the matrices, or a "
        ".mapping of ANSYS",
    )
    recovery: str | MatrixTable | None = Field(
        default=None,
        description="file of a matrix that gives the displacements of all nodes, three rows each, "
        "from the degrees of freedom of K",
    )
    nodes: str | None = Field(
        default=None, description="mesh with coordinates and faces of the matrices' nodes"
    )
    mass_damping: float = Field(
        default=0.0, ge=0, description="damping proportional to mass, Rayleigh's alpha"
    )
    stiffness_damping: float = Field(
        default=0.0, ge=0, description="damping proportional to stiffness, Rayleigh's beta"
    )
    material_damping: dict[str, Damping] = Field(
        default={}, description="stiffness_damping of single materials, in addition"
    )
    measured: str | None = Field(
        default=None,
        description="CSV file of frequencies and damping ratios measured on the free part, which "
        "its component modes get",
    )
    repeat: RepeatTable | None = Field(
        default=None, description="the mesh is a sector that repeats count times about an axis"
    )
    translate: Vector = Field(default=(0.0, 0.0, 0.0), description="shift, after the rotation")
    rotate: TurnTable | None = Field(default=None, description="rotation")

    @model_validator(mode="after")
    def _one_source(self) -> ComponentTable:
        """Raise ValueError unless there are a mesh or matrices, and keys that go with these."""
        keys = ("K", "M", "C", "dof", "nodes", "recovery")
        matrices = [k for k in keys if getattr(self, k) is not None]
        if self.mesh is not None and matrices:
            raise ValueError(f"expected mesh, or K, M and nodes; got mesh and {matrices[0]}")
        if self.mesh is None and not {"K", "M", "nodes"} <= set(matrices):
            raise ValueError("expected mesh = FILE, or K, M and nodes (a mesh with coordinates)")
        if self.mesh is None and self.repeat is not None:
            raise ValueError("expected no repeat: the matrices are of the whole component")
        if self.mesh is None and self.materials:
            raise ValueError("expected no materials: the matrices hold them")
        if self.mesh is None and self.heat:
            raise ValueError("expected no heat: the matrices have no materials that expand")
        if self.mesh is None and self.material_damping:
            raise ValueError("expected no material_damping: the matrices have no materials")
        return self

    def file_of(self, key: str) -> str | None:
        """The file that a key such as K names; None without the key."""
        entry = getattr(self, key)
        return entry.file if isinstance(entry, MatrixTable) else entry

    def name_of(self, key: str) -> str | None:
        """The name of the matrix in its file; None where the key gives a file alone."""
        entry = getattr(self, key)
        return entry.name if isinstance(entry, MatrixTable) else None
