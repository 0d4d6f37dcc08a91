"""One parameter that scales all moduli of the generated brake's linings."""

import numpy as np
from test_loss_factors import LINING, SCALE

import squealstudy as sq


def test_a_scale_of_the_lining_is_a_factor_on_all_of_its_moduli(tiny_brake, assembled_once):
    """Matrices and loss factors are those of the three moduli."""
    brake = sq.model("disc_brake", mesh="coarse", contact_points=2)
    defaults = brake.definition.defaults()
    softer = brake.with_(**{SCALE: 0.8}).at().assembly
    own = brake.with_(**{name: 0.8 * defaults[name] for name in LINING}).at().assembly
    stiff = brake.at().assembly
    assert abs(softer.K - own.K).max() <= 1e-12 * abs(own.K).max()
    assert abs(softer.K - stiff.K).max() > 1e-6 * abs(own.K).max()
    assert abs(softer.M - stiff.M).max() == 0
    by_scale, by_moduli = (
        brake.loss_damping({names: 0.04}, 3000.0)["damping_ratio"] for names in (SCALE, LINING)
    )
    np.testing.assert_allclose(by_scale, by_moduli, rtol=1e-9)
