"""Squeal of squealstudy and of CalculiX: frequencies and growth rates side by side.

Run:  python studies/benchmarks/squeal_judge.py blocks [coarse]
      python studies/benchmarks/squeal_judge.py brake

`blocks`: a slider on a plate whose meshes do not match, two meshes and two pressures; or the
coarser mesh at the lower one. `brake`: the coarse generated brake, exported, of C3D20 with full
integration on both sides. Both sides have linear unilateral contact, no damping, and friction's
slope across the sliding direction (tests/calculix_squeal.py). Each is told without and with the
stiffness of stresses on our side. A growing mode of ours is also sought at other frictions: by how
much friction it would have to be shifted to grow as CalculiX says.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from calculix import CCX
from calculix_squeal import COARSE, FINE, Case, blocks, judged_modes, own_modes, paired, whole_brake

SHIFT = 0.01  # of friction


def compare(name: str, case: Case, folder: Path, band: tuple[float, float], n_modes: int) -> None:
    """Print modes of both sides, without and with the stiffness of our stresses."""
    judge, said = judged_modes(folder, case, n_modes)
    if not len(judge):
        sys.exit(f"ccx found no modes: {said[-2000:]}")
    for stress in (False, True):
        _tell(f"{name}{', stresses' * stress}", case, judge, band, stress)


def _tell(
    name: str, case: Case, judge: np.ndarray, band: tuple[float, float], stress: bool
) -> None:
    """Print the modes that grow on either side, and how far the others are apart."""
    begun = process_time()
    own = own_modes(case, band, stress=stress)
    seconds = process_time() - begun
    rows = paired(own.modes.lam, judge, band[1])
    apart = np.abs(rows[:, 2] / rows[:, 0] - 1)
    area = own.assembly.contact.area
    print(
        f"{name}: {own.assembly.n_dof} DOF, {case.pressure:g} Pa, closed over "
        f"{100 * area[own.point.tangent > 0].sum() / area.sum():.0f} % of the contact; {len(rows)} "
        f"modes, frequencies apart by {np.median(apart):.1e} (median), {apart.max():.1e} at most; "
        f"ours took {seconds:.0f} s"
    )
    sides = [own_modes(case, band, case.friction + d, stress).modes.lam for d in (-SHIFT, SHIFT)]
    for hz, growth, hz_judge, growth_judge in rows[(rows[:, 1] > 0.1) | (rows[:, 3] > 0.1)]:
        lam = growth + 2j * np.pi * hz
        low, high = (lams[np.abs(lams - lam).argmin()].real for lams in sides)
        shift = 2 * SHIFT * (growth_judge - growth) / (high - low)
        zeta = (growth - growth_judge) / abs(lam)
        print(
            f"  {hz:9.2f} Hz {growth:8.2f} 1/s   ccx {hz_judge:9.2f} Hz {growth_judge:8.2f} 1/s   "
            f"damping ratios apart by {abs(zeta):.1e}, a shift of friction by {shift:+.4f}"
        )


def main() -> None:
    """What the first argument says."""
    if CCX is None:
        sys.exit("there is no program ccx (Debian: calculix-ccx)")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if sys.argv[1:] in (["blocks"], ["blocks", "coarse"]):
            number = 1 if sys.argv[2:] else 2  # of meshes, and of pressures
            for cells in (COARSE, FINE)[:number]:
                sides = " on ".join(f"{c[0]}x{c[1]}" for c in reversed(cells))
                for pressure, slide in ((1e4, 1e-4), (1e6, 1e-3))[:number]:
                    case = blocks(folder / "model", cells, pressure=pressure, slide=slide)
                    compare(sides, case, folder / "ccx", (500.0, 60e3), 12)
        elif sys.argv[1:] == ["brake"]:
            case = whole_brake(folder / "model")
            compare("brake", case, folder / "ccx", (300.0, 4800.0), 40)
        else:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
