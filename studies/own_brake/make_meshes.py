"""Made the meshes of this folder with gmsh 4.15 (``pip install gmsh``), which nothing else needs.

Millimetres, each part a file of gmsh 4.1 with 10-node tetrahedra (the disc 20-node hexahedra) and
named surfaces. The axis of the disc is z, its inner friction face lies at z = 0. The meshes do not
match.

    python make_meshes.py
"""

from pathlib import Path

import gmsh
import numpy as np

HERE = Path(__file__).parent
DISC = 10.0  # thickness of the friction band
BAND = (62.0, 110.0)  # its radii
HAT, HUB, BORE = 58.0, 42.0, 28.0  # radii of the hat, of what is bolted, of the bore
CELL = 13.0  # of the disc
HEIGHT, WALL, TOP = 22.0, 5.0, 6.0  # of the hat
PAD = (72.0, 108.0, 27.0)  # radii, half angle in deg
LINING, PLATE = 9.0, 5.0
REAR = LINING + PLATE  # height of a back plate's outer face over the disc
PISTON = 14.0  # radius
CENTRE = 90.0  # of the piston


def sector(inner: float, outer: float, half: float, z: float, height: float) -> int:
    """A part of a ring, half an angle [deg] to each side of +x; its volume."""
    occ, a = gmsh.model.occ, np.radians(half)
    ends = [(r * np.cos(s * a), r * np.sin(s * a)) for r in (inner, outer) for s in (-1, 1)]
    p, q, s, t = (occ.addPoint(x, y, z) for x, y in ends)
    centre = occ.addPoint(0, 0, z)
    lines = [
        occ.addLine(p, s),
        occ.addCircleArc(s, centre, t),
        occ.addLine(t, q),
        occ.addCircleArc(q, centre, p),
    ]
    face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    return next(tag for dim, tag in occ.extrude([(2, face)], 0, 0, height) if dim == 3)


def named(volumes: dict[str, list[int]], faces: dict[str, list[int]]) -> None:
    """Name volumes and surfaces."""
    for number, (name, tags) in enumerate(volumes.items(), 1):
        gmsh.model.addPhysicalGroup(3, tags, number, name)
    for number, (name, tags) in enumerate(faces.items(), 11):
        assert tags, name
        gmsh.model.addPhysicalGroup(2, tags, number, name)


def surfaces(where) -> list[int]:
    """Surfaces of whose centre and box (low, high) something holds."""
    found = []
    for _, tag in gmsh.model.getEntities(2):
        box = np.array(gmsh.model.getBoundingBox(2, tag)).reshape(2, 3)
        if where(np.array(gmsh.model.occ.getCenterOfMass(2, tag)), *box):
            found.append(tag)
    return found


def at(z: float):
    """Surfaces in a plane."""
    return lambda c, low, high: abs(low[2] - z) + abs(high[2] - z) < 1e-3


def write(name: str, size: float) -> None:
    """Mesh with elements of the second order and write."""
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.write(str(HERE / f"{name}.msh"))
    gmsh.clear()


def disc() -> None:
    """Hexahedra, turned about z: the band, and the hat towards -z."""
    occ = gmsh.model.occ
    r, z = [BORE, HUB, HAT - WALL, HAT, BAND[1]], [-HEIGHT - TOP, -HEIGHT, 0.0, DISC]
    cells = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (3, 2)]  # of the section
    faces = [occ.addRectangle(r[i], z[k], 0, r[i + 1] - r[i], z[k + 1] - z[k]) for i, k in cells]
    occ.rotate([(2, f) for f in faces], 0, 0, 0, 1, 0, 0, np.pi / 2)
    parts, _ = occ.fragment([(2, faces[0])], [(2, f) for f in faces[1:]])
    occ.synchronize()
    start = parts
    for quarter in range(4):  # of a turn, 8 cells each
        occ.revolve(start, 0, 0, 0, 0, 0, 1, np.pi / 2, [8], recombine=True)
        start = _ends(quarter + 1)
    occ.removeAllDuplicates()
    occ.synchronize()
    for turns in range(4):
        for _, face in _ends(turns):
            for _, line in gmsh.model.getBoundary([(2, face)], oriented=False):
                cells = max(1, round(gmsh.model.occ.getMass(1, line) / CELL))
                gmsh.model.mesh.setTransfiniteCurve(line, cells + 1)
            gmsh.model.mesh.setTransfiniteSurface(face)
            gmsh.model.mesh.setRecombine(2, face)
    band = surfaces(
        lambda c, lo, hi: at(0.0)(c, lo, hi) and abs(np.array([lo, hi])).max() > HAT + 1
    )
    named(
        {"IRON": [t for _, t in gmsh.model.getEntities(3)]},
        {
            "INNER": band,
            "OUTER": surfaces(at(DISC)),
            "HUB": surfaces(
                lambda c, lo, hi: (
                    at(-HEIGHT - TOP)(c, lo, hi)
                    and abs(np.array([lo, hi])[:, :2]).max() < HUB + 1e-3
                )
            ),
        },
    )
    write("disc", 100.0)


def _ends(turns: int) -> list[tuple[int, int]]:
    """Faces of the section after some quarters of a turn."""
    gmsh.model.occ.synchronize()
    x, y = np.round((np.cos(turns * np.pi / 2), np.sin(turns * np.pi / 2)))
    normal = np.array([-y, x, 0])
    found = []
    for dim, tag in gmsh.model.getEntities(2):
        box = np.array(gmsh.model.getBoundingBox(dim, tag)).reshape(2, 3)
        middle = box.mean(axis=0)
        if np.abs(box @ normal).max() < 1e-3 and middle[:2] @ (x, y) > 0:
            found.append((dim, tag))
    return found


def pad(name: str, side: int) -> None:
    """Tetrahedra: lining and back plate with ears; the inner pad (-1) also has a piston's face."""
    occ = gmsh.model.occ
    face = DISC if side > 0 else 0.0
    low = {1: (face, face + LINING), -1: (face - LINING, face - REAR)}[side]
    lining = sector(*PAD, low[0], LINING)
    plate = sector(PAD[0] + 3, PAD[1] - 3, PAD[2] + 5, low[1], PLATE)
    tools = [(3, plate)]
    rear = face + side * REAR
    if side < 0:
        tools.append((2, occ.addDisk(CENTRE, 0, rear, PISTON, PISTON)))
    parts, _ = occ.fragment([(3, lining)], tools)
    occ.synchronize()
    mids = {t: occ.getCenterOfMass(3, t)[2] for d, t in parts if d == 3}
    split = face + side * LINING
    own = [t for t, z in mids.items() if (z < split) == (side > 0)]
    ends = surfaces(
        lambda c, lo, hi: abs(abs(np.degrees(np.arctan2(c[1], c[0]))) - PAD[2] - 5) < 0.5
    )
    faces = {"FRICTION": surfaces(at(face)), "EARS": ends, "BACK": surfaces(at(rear))}
    if side < 0:
        round_ = surfaces(lambda c, lo, hi: at(rear)(c, lo, hi) and np.ptp([lo, hi], 0)[1] < 40)
        faces["PISTON"] = round_
    named({"LINING": own, "PLATE": [t for t in mids if t not in own]}, faces)
    write(name, 9.0)


def caliper() -> None:
    """Tetrahedra: a cylinder's housing, a bridge with a window, one broad finger with a slot."""
    occ = gmsh.model.occ
    housing = occ.addCylinder(CENTRE, 0, -REAR - 34, 0, 0, 34, PISTON + 9)
    shoulder = occ.addBox(CENTRE - 10, -46, -REAR - 24, 34, 92, 20)
    bridge = sector(114, 128, 26, -REAR - 24, 2 * REAR + DISC + 24 + 14)
    finger = sector(80, 128, 22, DISC + REAR, 14)
    body, _ = occ.fuse([(3, housing)], [(3, shoulder), (3, bridge), (3, finger)])
    window = occ.addBox(110, -14, -6, 30, 28, DISC + 12)
    slot = occ.addBox(70, -9, DISC + REAR - 1, 34, 18, 20)
    bore = occ.addCylinder(CENTRE, 0, -REAR - 20, 0, 0, 30, PISTON)
    body, _ = occ.cut(body, [(3, window), (3, slot), (3, bore)])
    occ.synchronize()
    named(
        {"IRON": [t for _, t in body]},
        {
            "CYLINDER": surfaces(at(-REAR - 20)),
            "FINGER": surfaces(at(DISC + REAR)),
            "GUIDES": surfaces(
                lambda c, lo, hi: np.ptp([lo[1], hi[1]]) < 1e-3 and abs(abs(c[1]) - 46) < 1e-3
            ),
        },
    )
    write("caliper", 11.0)


def main() -> None:
    """Write all meshes."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    disc()
    pad("inner_pad", -1)
    pad("outer_pad", 1)
    caliper()
    gmsh.finalize()


if __name__ == "__main__":
    main()
