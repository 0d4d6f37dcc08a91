"""Made the meshes of this folder with gmsh 4.15 (``pip install gmsh``), which nothing else needs.

A quarter of a ring of steel with a lining on it: two volumes that share their nodes, named
surfaces. Tetrahedra with 10 nodes in format 4.1; hexahedra with 20 nodes and wedges with 15 in 2.2
and as `.inp` of gmsh.
"""

from pathlib import Path

import gmsh

HERE = Path(__file__).parent
INNER, OUTER, BACK, LINING = 20.0, 40.0, 5.0, 8.0  # mm


def quarter(structured: bool) -> None:
    """The two volumes; structured ones are swept along z from quadrangles and triangles."""
    gmsh.clear()
    gmsh.model.add("pad")
    occ = gmsh.model.occ
    if structured:
        outline = occ.addPoint(INNER, 0, 0), occ.addPoint(OUTER, 0, 0)
        line = occ.addLine(*outline)
        turned = occ.revolve([(1, line)], 0, 0, 0, 0, 0, 1, 0.8, [2], recombine=True)
        face = next(tag for dim, tag in turned if dim == 2)
        end = next(tag for dim, tag in turned if dim == 1)
        more = occ.revolve([(1, end)], 0, 0, 0, 0, 0, 1, 0.7, [2])
        corner = next(tag for dim, tag in more if dim == 2)
        base = [(2, face), (2, corner)]
        back = occ.extrude(base, 0, 0, BACK, [1], recombine=True)
        top = [e for e in back if e[0] == 2 and abs(occ.getCenterOfMass(*e)[2] - BACK) < 1e-6]
        lining = occ.extrude(top, 0, 0, LINING, [1], recombine=True)
        volumes = [[t for d, t in found if d == 3] for found in (back, lining)]
    else:
        cylinder = occ.addCylinder(0, 0, 0, 0, 0, BACK + LINING, OUTER, angle=1.5)
        hole = occ.addCylinder(0, 0, 0, 0, 0, BACK + LINING, INNER, angle=1.5)
        ring, _ = occ.cut([(3, cylinder)], [(3, hole)])
        lower = occ.addBox(-50, -50, -1, 100, 100, 1 + BACK)
        parts, _ = occ.fragment(ring, [(3, lower)])
        occ.synchronize()
        mids = {t: occ.getCenterOfMass(3, t) for d, t in parts if d == 3}
        inside = {t: m for t, m in mids.items() if occ.getMass(3, t) < 20000}
        volumes = [[t for t, m in inside.items() if m[2] < BACK]]
        volumes += [[t for t, m in inside.items() if m[2] > BACK]]
        occ.remove([(3, t) for t in mids if t not in inside], recursive=True)
    occ.synchronize()
    for number, (name, tags) in enumerate(zip(("BACK", "LINING"), volumes, strict=True), 1):
        gmsh.model.addPhysicalGroup(3, tags, number, name)
    outer = {"PISTON": 0.0, "FRICTION": BACK + LINING}
    if not structured:
        outer["BETWEEN"] = BACK
    for number, (name, z) in enumerate(outer.items(), 11):
        flat = gmsh.model.getEntitiesInBoundingBox(-50, -50, z - 1e-3, 50, 50, z + 1e-3, 2)
        gmsh.model.addPhysicalGroup(2, [t for _, t in flat], number, name)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 9)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 14)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)


def main() -> None:
    """Write all files."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    quarter(structured=False)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.write(str(HERE / "pad_tet10.msh"))
    quarter(structured=True)
    gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
    gmsh.write(str(HERE / "pad_hex20.msh"))
    gmsh.write(str(HERE / "pad_hex20.inp"))
    gmsh.finalize()


if __name__ == "__main__":
    main()
