"""CalculiX as the outside judge of squeal: complex modes of sliding blocks that do not match.

A whole brake takes minutes: `python studies/benchmarks/squeal_judge.py brake`.
"""

from __future__ import annotations

import numpy as np
import pytest
from calculix import CCX
from calculix_squeal import COARSE, blocks, judged_modes, own_modes, paired

pytestmark = pytest.mark.skipif(
    CCX is None,
    reason="SQUEAL IS NOT CHECKED BY CALCULIX: there is no program ccx (Debian: calculix-ccx)",
)
TOP = 60e3  # Hz


@pytest.mark.full_size  # by default frequencies: test_stress_stiffness.py
def test_squeal_of_blocks_whose_meshes_do_not_match(tmp_path):
    """Five modes, one of them grows; a friction of .01 less would be seen."""
    case = blocks(tmp_path / "model", COARSE)
    judge, said = judged_modes(tmp_path / "ccx", case, 12)
    assert len(judge) == 12, said[-2000:]
    own = own_modes(case, (500.0, TOP))
    assert own.point.tangent.min() > 0  # closed everywhere
    rows = paired(own.modes.lam, judge, TOP)
    assert len(rows) == 5
    np.testing.assert_allclose(rows[:, 0], rows[:, 2], rtol=1e-4)
    growing = rows[rows[:, 1] > 1.0]
    assert len(growing) == 1
    assert growing[0, 0] == pytest.approx(28.1e3, rel=1e-2)
    assert growing[0, 1] == pytest.approx(growing[0, 3], rel=1e-3)
    less = paired(own_modes(case, (500.0, TOP), 0.39).modes.lam, judge, TOP)
    assert abs(less[:, 1].max() / growing[0, 3] - 1) > 0.03


@pytest.mark.full_size  # frequencies by default: test_stress_stiffness.py
def test_stresses_stiffen_blocks_under_one_megapascal(tmp_path):
    """Without their stiffness one frequency is 2.1e-3 off and the growth 2.8 %."""
    case = blocks(tmp_path / "model", COARSE, pressure=1e6, slide=1e-3)
    judge, said = judged_modes(tmp_path / "ccx", case, 12)
    assert len(judge) == 12, said[-2000:]
    off = {}
    for stress in (False, True):
        rows = paired(own_modes(case, (500.0, TOP), stress=stress).modes.lam, judge, TOP)
        assert len(rows) == 5
        growing = rows[rows[:, 1] > 1.0]
        assert len(growing) == 1
        off[stress] = np.abs(rows[:, 0] / rows[:, 2] - 1).max(), growing[0, 1] / growing[0, 3] - 1
    assert off[False][0] > 2e-3
    assert off[False][1] > 0.025
    assert off[True][0] < 1e-4
    assert 0 < off[True][1] < 0.016
