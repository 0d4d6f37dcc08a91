"""Brake M0 (TU Berlin): the full-order solver finds the published roots, and no others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import reference
import scipy.io
import scipy.sparse as sp

import squealstudy
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.errors import StudyFileError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.linalg.sparse_qep import LowRankSum, smallest_roots
from squealstudy.study.definition import load_study, parse_study

STUDY = Path(__file__).resolve().parents[2] / "studies" / "outside_data" / "m0_speed.toml"
FILES = {
    "M": "BMLL00",
    "D1": "BDLL00",
    "DG": "BYLL00",
    "DR": "BDIWLL00",
    "D4": "BHLL00",
    "K1": "BKLL00",
    "KR": "BKQLL00",
    "KGeo": "BWLL00",
}
# printed roots: value and unit of the last digit of its real and imaginary part
AT_4PI = [
    (119.2 + 26258j, 0.1, 1),
    (74.83 + 17399.6j, 0.01, 0.1),
    (5.474 + 4932.24j, 1e-3, 0.01),
    (0.5738 + 36380.5j, 1e-4, 0.1),
    (9.587e-5 + 5130.6j, 1e-8, 0.1),
    (-0.0433 + 10094.7j, 1e-4, 0.1),
    (-1.122 + 1409.16j, 1e-3, 0.01),
    (-1.433 + 3521.47j, 1e-3, 0.01),
    (-1.834 + 3336.67j, 1e-3, 0.01),
    (-1.913 + 16339.2j, 1e-3, 0.1),
    (-2.367 + 4038.35j, 1e-3, 0.01),
    (-3.983 + 39192.3j, 1e-3, 0.1),
    (-6.571 + 22889.6j, 1e-3, 0.1),
]
AT_2PI_WITHOUT_D4 = [(-8.834e-4 + 5131j, 1e-7, 1), (-2.462 + 3338j, 1e-3, 1)]


@pytest.fixture(scope="module")
def m0(m0_files):
    matrices = {}
    for name, stem in FILES.items():
        content = scipy.io.loadmat(m0_files / f"{stem}.mat")
        (value,) = (v for k, v in content.items() if not k.startswith("__"))
        matrices[name] = sp.csr_matrix(value, dtype=float)
    assert matrices["M"].shape == (4669, 4669)
    return matrices


def assert_printed(lam, published):
    for value, unit_real, unit_imag in published:
        root = lam[np.abs(lam - value).argmin()]
        assert abs(root.real - value.real) <= 0.501 * unit_real, (value, root)
        assert abs(root.imag - value.imag) <= 0.501 * unit_imag, (value, root)


def test_published_roots(m0):
    omega = 4 * np.pi
    C = m0["D1"] + omega * m0["DG"] + (1 / omega - 1) * m0["DR"] + m0["D4"] / (2 * np.pi * 1600)
    K = m0["K1"] + m0["KR"] + (omega**2 - 1) * m0["KGeo"]
    # 100 roots reach |lambda| = 4.2e4, beyond the published region
    lam, psi = smallest_roots(m0["M"], LowRankSum(C), LowRankSum(K), 100, 2e4)
    assert np.abs(lam).max() > 4e4
    assert reference.residuals(m0["M"], C, K, lam, psi).max() < 1e-8
    assert_printed(lam, AT_4PI)
    region = (lam.real > -7) & (np.abs(lam) < 4e4)
    assert region.sum() == len(AT_4PI)  # all roots of their region, none besides


def test_published_roots_of_the_second_convention(m0):
    omega = 2 * np.pi
    C = m0["D1"] + omega * m0["DG"] + m0["DR"] / omega
    K = m0["K1"] + m0["KR"] + omega**2 * m0["KGeo"]
    lam, psi = smallest_roots(m0["M"], LowRankSum(C), LowRankSum(K), 30, 5e3)
    assert reference.residuals(m0["M"], C, K, lam, psi).max() < 1e-8
    assert_printed(lam, AT_2PI_WITHOUT_D4)


@pytest.mark.parametrize(
    "reach",
    [
        pytest.param(5.5e3, marks=pytest.mark.full_size),
        pytest.param(4e4, marks=pytest.mark.full_size),
    ],
)
def test_published_roots_come_out_of_the_study_file(reach, m0_files, tmp_path, monkeypatch):
    """The shipped study at one speed, 4 pi, the default of its parameter; up to a size in rad/s."""
    monkeypatch.setenv("SQUEALSTUDY_DATA", str(m0_files.parent))
    text = STUDY.read_text()
    head, modes = text.partition("[[sweep]]")[0], text[text.index("[modes]") :]
    assert modes.count("6400.0") == 1
    modes = modes.replace("6400.0", str(min(1.02 * reach / (2 * np.pi), 6400.0)))
    study = parse_study(head + modes + "reference_points = 0\n", STUDY)
    assert study.values == {"omega": 4 * np.pi}
    run_study(Plan(study), tmp_path / "r", jobs=1)
    found = squealstudy.open_results(tmp_path / "r").modes
    size, growth = 2 * np.pi * found["frequency_hz"], found["growth_rate"]
    lam = (growth + 1j * np.sqrt(size**2 - growth**2)).to_numpy()
    published = [p for p in AT_4PI if abs(p[0]) < reach]
    assert_printed(lam, published)
    region = (lam.real > -7) & (np.abs(lam) < reach)
    assert region.sum() == len(published)
    assert (found["residual"] < 1e-8).all()


def test_the_shipped_study_covers_the_published_speeds_and_region():
    study = load_study(STUDY)
    (sweep,) = study.sweeps
    assert (sweep.low, sweep.high) == (2 * np.pi, 40 * np.pi)
    assert np.abs(np.array(sweep.values) - 4 * np.pi).min() < 1e-8
    low, high = study.definition.modes.band
    size = np.abs([value for value, _, _ in AT_4PI])
    assert 2 * np.pi * low < size.min()
    assert size.max() < 4e4 < 2 * np.pi * high


def test_without_the_data_the_folder_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("SQUEALSTUDY_DATA", str(tmp_path / "nothing"))
    with pytest.raises(StudyFileError, match=r"there is no folder .*nothing.m0; .*folder = ") as e:
        run_study(Plan(load_study(STUDY)), tmp_path / "r", jobs=1)
    assert e.value.key == "model.term[1].file"


def test_its_disc_turns_as_ours(m0):
    """Its gyroscopic matrix couples doublets by nearly twice their diameters, 2 to 5: (3a).

    Pads and what moves with them take a part of it.
    """
    K = m0["K1"] - m0["KGeo"]
    omega, phi = real_modes(m0["M"], (K + K.T) / 2, 4300.0)
    coupling = np.abs(np.diag(phi.T @ (m0["DG"] @ phi), 1))
    doublets = (np.diff(omega) < 0.02 * omega[1:]) & (coupling > 3.0)
    assert coupling[doublets] == pytest.approx([4.0, 6.0, 8.0, 10.0], rel=0.15)
    assert (coupling[doublets] < [4.0, 6.0, 8.0, 10.0]).all()
