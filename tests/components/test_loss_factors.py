"""Loss factors of materials as viscous damping of component modes, against complex stiffness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from conftest import NOMINAL

import squealstudy as sq
from squealstudy.errors import ParameterError
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import linearised_point
from squealstudy.system.linearise import component_frequencies

LINING = tuple(f"pad.lining_{m}" for m in ("young_modulus", "young_modulus_z", "shear_modulus_z"))
pytestmark = pytest.mark.usefixtures("assembled_once")
SCALE = "pad.lining_stiffness_scale"
LOSS = {"disc": 0.002, "inner_pad": 0.02, "outer_pad": 0.02, "caliper": 0.004}


@pytest.fixture(scope="module")
def brake_model(tiny_brake, assembled_once):
    return sq.model("disc_brake", mesh="coarse", contact_points=2)


def test_energy_of_a_mode_is_shared_by_its_materials(brake_model):
    """Plate and lining alike are the whole pad; of one of them it is a part."""
    moduli = {LINING: 0.04, "pad.plate_young_modulus": 0.04}
    both = brake_model.loss_damping(moduli, 3000.0)
    assert set(both["component"]) == {"inner_pad", "outer_pad"}
    assert both["energy_share"].to_numpy() == pytest.approx(1.0, abs=1e-6)
    assert both["damping_ratio"].to_numpy() == pytest.approx(0.02, abs=1e-8)
    lining = brake_model.loss_damping({LINING: 0.04}, 3000.0)
    plate = brake_model.loss_damping({"pad.plate_young_modulus": 0.04}, 3000.0)
    assert (lining["damping_ratio"] > 0).all()
    parts = lining["damping_ratio"] + plate["damping_ratio"]
    assert parts.to_numpy() == pytest.approx(both["damping_ratio"].to_numpy(), abs=1e-8)
    names = ["component", "mode", "frequency_hz"]
    modes = brake_model.component_modes(3000.0).query("not rigid")[names]
    assert lining[names].merge(modes).equals(lining[names])
    study = brake_model.with_(**dict(zip(both["parameter"], both["damping_ratio"], strict=True)))
    assert "inner_pad.modes[7].damping_ratio" in study.given


@pytest.mark.parametrize(
    ("factors", "told"),
    [
        *(
            pytest.param({name: 0.1}, "expected moduli of a component", marks=pytest.mark.full_size)
            for name in ("disc.density", "disc.thickness")
        ),
        ({"pad.lining_poisson_ratio": 0.1}, "expected moduli of a component"),
        ({"pad.lining_young_modulus": 0.1}, "all of those that a material has"),
        ({"disc.young": 0.1}, "no parameter 'disc.young'"),
        ({"disc.young_modulus": -0.1}, "expected a loss factor, got -0.1"),
        ({LINING: 0.04, LINING[::-1]: 0.04}, "one loss factor of a material, got two"),
        ({LINING: 0.04, SCALE: 0.04}, "one loss factor of a material, got two"),
    ],
)
def test_what_has_no_loss_factor(brake_model, factors, told):
    with pytest.raises(ParameterError, match=told):
        brake_model.loss_damping(factors, 500.0)


def test_viscous_damping_of_component_modes_beside_complex_stiffness(prepared):
    """Dampers of component modes leave out static responses: about half of K (1 + i eta)."""
    model, omega = prepared.model, component_frequencies(prepared.model)
    bare = DesignState(NOMINAL)
    viscous = replace(bare, mode_damping={key: 0.5 * LOSS[key[0]] for key, w in omega.items() if w})
    _, system = linearised_point(prepared, viscous)
    _, free = linearised_point(prepared, bare)
    eta = np.repeat([LOSS[c] for c in model.components], np.diff(model.offsets))
    eye, none = np.eye(model.n), np.zeros((model.n, model.n))

    def roots(C, K):
        lam = la.eigvals(np.block([[none, eye], [-K, -C]]))
        lam = lam[(lam.imag > 2 * np.pi * 500) & (lam.imag < 2 * np.pi * 6000)]
        return lam[np.argsort(lam.imag)]

    ratios = []
    for C, K in (
        (free.C, free.K),
        (system.C, system.K),
        (free.C, free.K + 1j * np.diag(eta * free.weights.elastic)),
    ):
        lam = roots(C, K)
        ratios.append(-lam.real / np.abs(lam))
    bare_, viscous_, complex_ = ratios
    assert len(bare_) == len(viscous_) == len(complex_) == 38
    added = viscous_ - bare_, complex_ - bare_
    assert np.median(added[0] / added[1]) == pytest.approx(0.592, abs=5e-3)
    assert [int((zeta < 0).sum()) for zeta in ratios] == [4, 3, 3]
