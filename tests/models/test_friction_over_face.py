"""Friction that varies over a contact face: factors of a file or at random, how far they spread."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as la
from own_blocks import write_blocks
from study_runs import command, solved

import squealstudy as sq
from squealstudy.errors import ModelError, StudyFileError
from squealstudy.motion.point import automatic_slope
from squealstudy.study.components import read_model

MAP = 'friction_factor = { file = "mu.csv" }\n'
SPREAD = "friction_spread = 1.0\n"
PARAMETER = '[parameters."lining.spread"]\npath = "contact.pads.friction_spread"\n'
BAND = (500.0, 60000.0)  # Hz
FRICTION = 0.4


def plane(x, y):
    """Factors over mm of the slider's own file."""
    return 0.9 + 0.2 * x - 0.15 * y


def halves(x, y):
    """0.6 and 1.4, on either side of the first facet's edge."""
    return 0.6 if x < 5 / 3 else 1.4


def write_map(folder, factor):
    rows = ["x, y, factor"]
    for x in (0.0, 0.8, 1.66, 1.67, 3.0, 5.0):
        rows += [f"{x!r}, {y!r}, {factor(x, y)!r}" for y in (0.0, 0.7, 1.4, 2.1)]
    (folder / "mu.csv").write_text("\n".join(rows) + "\n")


def blocks(folder, more=MAP, parameters="", factor=plane):
    """The model file of two blocks with a map of factors beside it."""
    write_blocks(folder, ("search = 0.1\n", f'name = "pads"\nsearch = 0.1\n{more}'))
    model = folder / "blocks.toml"
    model.write_text(model.read_text() + parameters)
    write_map(folder, factor)
    return model


def spread_blocks(folder):
    return blocks(folder, MAP + SPREAD, PARAMETER)


def at_friction(model, **values):
    return sq.model(str(model), contact_law="bilateral").with_basis(band_hz=BAND).at(**values)


def contact_of(model, **values):
    return at_friction(model, **values).assembly.contact


def factors_by_hand(contact, spread):
    """Those of the plane at the points, mean over the area and deviations from it."""
    own = 1e3 * contact.points - [1.5, 0.5, 2.0]  # mm; the slider's translation
    factor = plane(own[:, 0], own[:, 1])
    mean = (factor * contact.area).sum() / contact.area.sum()
    return mean + spread * (factor - mean)


def matrices(system, spread):
    """M, C, K of all freedoms and pressures, from N, T and the factors; contact is linear."""
    assembly, at = system.point.assembly(), system.point.operating_point()
    c, (stiffness, *_) = assembly.contact, at.law.parameters
    mu = FRICTION * factors_by_hand(c, spread)
    N, T, across = (A.toarray() for A in (c.N, c.T, c.T_perp))
    normal = c.area * stiffness
    K = (assembly.K_el + assembly.K_springs()).toarray()
    K += N.T @ (normal[:, None] * N) - T.T @ ((mu * normal)[:, None] * N)
    pressure = -stiffness * (N @ la.solve(K, assembly.load * at.brake_pressure))
    drag = mu * c.area * pressure / (at.sliding_speed * c.speed_factor)
    C = across.T @ (drag[:, None] * across)
    return assembly.M.toarray(), C, K, pressure


def roots(M, C, K):
    zero = np.zeros_like(K)
    lam = la.eigvals(np.block([[zero, np.eye(len(K))], [-la.solve(M, K), -la.solve(M, C)]]))
    return lam[lam.imag > 1.0]


def nearest(lam, others):
    return np.array([others[np.abs(others - x).argmin()] for x in lam])


@pytest.fixture(scope="module")
def spread_model(tmp_path_factory):
    return spread_blocks(tmp_path_factory.mktemp("spread"))


def test_contact_points_have_the_factors_of_the_file(tmp_path):
    """Of a plane exactly; places are those of the slave's own file, before it was moved."""
    contact = contact_of(blocks(tmp_path))
    assert np.ptp(contact.frictional) > 0.5
    assert contact.frictional == pytest.approx(factors_by_hand(contact, 1.0), rel=1e-12)


@pytest.mark.parametrize("spread", [1.3, 0.0])
def test_roots_are_those_of_matrices_put_together_by_hand(spread_model, spread):
    system = at_friction(spread_model, friction=FRICTION, **{"lining.spread": spread})
    M, C, K, pressure = matrices(system, spread)
    assert system.steady.pressure == pytest.approx(pressure, rel=1e-9)
    basis = system.reduced().basis_matrix
    lam = system.modes().lam
    assert len(lam) > 5
    expected = nearest(lam, roots(*(basis.T @ A @ basis for A in (M, C, K))))
    assert np.abs(lam - expected).max() < 1e-9 * np.abs(lam).max()


def test_derivatives_by_the_spread_are_those_of_matrices_by_hand(spread_model):
    """Steady sliding moves with it, too."""
    system, h = at_friction(spread_model, friction=FRICTION), 1e-4
    found = system.sensitivities("lining.spread", modes=3, band=BAND)
    basis = system.reduced().basis_matrix

    def moved(spread):
        by_hand = matrices(system, spread)[:3]
        return nearest(found.lam, roots(*(basis.T @ A @ basis for A in by_hand)))

    expected = (moved(1 + h) - moved(1 - h)) / (2 * h)
    assert np.abs(expected).min() > 10.0
    np.testing.assert_allclose(found.derivative[:, 0], expected, rtol=2e-3)


def test_a_map_of_ones_is_no_map(tmp_path):
    """To the last bit, whatever its spread."""
    plain = blocks(tmp_path / "plain", more="")
    lam = at_friction(plain).modes().lam
    for name, more in (("map", MAP), ("spread", MAP + "friction_spread = 2.7\n")):
        model = blocks(tmp_path / name, more, factor=lambda x, y: 1.0)
        assert (contact_of(model).frictional == 1.0).all()
        assert np.array_equal(at_friction(model).modes().lam, lam)


def split(model):
    """Two contacts with a factor each, of the facets on either side, instead of a map."""
    box = "box = [[{}, -1.0, -1.0], [{}, 9.0, 0.1]], normal = [0, 0, -1]"
    sets = "".join(
        f"[components.slider.sets.{name}]\n" + box.format(low, high).replace("], n", "]\nn") + "\n"
        for name, low, high in (("LOW", -1.0, 1.67), ("HIGH", 1.66, 6.0))
    )
    text = model.read_text()
    head, rest = text.split("[[contact]]")
    table, tail = rest.split("[[layer]]")
    tables = ""
    for name, factor in (("LOW", 0.6), ("HIGH", 1.4)):
        one = table.replace("slider.BOTTOM", f"slider.{name}").replace('"pads"', f'"{name}"')
        tables += "[[contact]]" + one.replace('{ file = "mu.csv" }', str(factor))
    model.write_text(head + sets + tables + "[[layer]]" + tail)
    return model


@pytest.fixture(scope="module")
def both_ways(tmp_path_factory):
    """A face with a map that jumps, and two faces with a factor each."""
    folder, more = tmp_path_factory.mktemp("both"), MAP + 'quadrature = "gauss"\n'
    whole = blocks(folder / "whole", more, factor=halves)
    return whole, split(blocks(folder / "split", more, factor=halves))


def test_a_map_that_jumps_is_two_contacts(both_ways):
    lam = [at_friction(model, friction=0.5).modes().lam for model in both_ways]
    assert lam[0] == pytest.approx(lam[1], rel=1e-9)


def test_a_map_that_jumps_is_two_contacts_in_time(both_ways):
    run = {"duration": 2e-4, "step": 2e-7, "perturbation": 1e-7}
    runs = [at_friction(model, friction=0.5).simulate(**run) for model in both_ways]
    torque = [x.history("torque") for x in runs]
    moved = np.ptp(torque[0])
    assert moved > 0
    np.testing.assert_allclose(torque[0], torque[1], rtol=0, atol=1e-5 * moved)
    whole, parts = (x.summary().iloc[0] for x in runs)
    assert whole["torque_rms"] == pytest.approx(parts["torque_rms"], rel=1e-6)


def test_a_map_that_jumps_is_two_contacts_of_limit_cycles(both_ways):
    """The damping that a motion of each size needs to go on."""
    curves = []
    for path in both_ways:
        model = sq.model(str(path), contact_law="cubic").with_basis(
            band_hz=(500.0, 35000.0), component_cutoff_factor=1.1
        )
        ((_, family),) = model.at(friction=0.5).limit_cycles().families
        curves.append([(s["contact_velocity"], s["added_damping"]) for s in family.curve])
    assert len(curves[0]) > 3
    np.testing.assert_allclose(*curves, rtol=1e-5)


def test_the_largest_factor_is_doubted(spread_model):
    """A friction of 0.5 times the factor of the point with most; the spread is swept."""
    model, factors = read_model(spread_model), contact_of(spread_model).frictional
    friction, *_ = model.assumptions
    values = model.defaults() | {"friction": 0.5}
    assert friction.values(values, 1) == pytest.approx([0.5 * factors.max()])
    swept = values | {"lining.spread": np.array([0.0, 1.2])}
    most = [0.5 * factors_by_hand(contact_of(spread_model), s).max() for s in (0.0, 1.2)]
    assert friction.values(swept, 2) == pytest.approx(most)


def test_the_automatic_slope_is_that_of_the_point_with_most_friction(spread_model):
    system = at_friction(spread_model, friction=FRICTION)
    pressure, contact = system.steady.pressure, system.point.assembly().contact
    state = SimpleNamespace(operating=system.point.operating_point())
    slope = automatic_slope(contact, state, SimpleNamespace(contact_pressure=pressure), 1e-3)
    most = (FRICTION * factors_by_hand(contact, 1.0) * pressure).max()
    assert slope == pytest.approx(most / 1e-3, rel=1e-9)


def test_a_study_sweeps_the_spread(tmp_path):
    """Each point is what it is alone; one whose factors would be negative says so."""
    model = spread_blocks(tmp_path)
    text = (tmp_path / "study.toml").read_text().replace('"friction"', '"lining.spread"')
    text = text.replace("[0.3, 0.6]", "[0.5, 40.0]")
    text = text.replace('"blocks.toml"', f'"{model}"\ncontact_law = "bilateral"')
    results = solved(text, tmp_path / "results")
    good, bad = results.points.sort_values("lining.spread").to_dict("records")
    assert good["status"] == "ok"
    assert bad["status"] != "ok"
    assert "expected a friction_spread of at most" in bad["message"]
    found = results.modes[results.modes["point_id"] == good["point_id"]]
    system = at_friction(model, **{"lining.spread": 0.5})
    frequency = np.sort(system.modes(BAND).frequency_hz)
    assert np.sort(found["frequency_hz"]) == pytest.approx(frequency, rel=1e-6)


BAD = [
    ("x, y, gap\n1, 2, 1\n", "line 1: expected names x, y, factor, got x, y, gap"),
    ("x, y, factor\n0, 0, 1\n\n5, 0, -0.1\n0, 2, 1\n", "line 4: expected a factor of at least 0"),
    ("x, y, factor\n0, 0, 1\n5, 0, nan\n", "line 3: expected finite numbers, got '5, 0, nan'"),
    ("x, y, factor\n0, 0, 1\n5, 0\n", "line 3: expected 3 numbers, got 2"),
    ("x, y, factor\n0, 0, 1\n0, 0, 2\n1, 0, 1\n0, 1, 1\n", "the place 0, 0 has 2 factors"),
    ("x, y, factor\n90, 0, 1\n91, 0, 2\n90, 1, 1\n", "100 % of the contact points lie off"),
]


@pytest.mark.parametrize(("text", "words"), BAD)
def test_a_bad_map_is_one_sentence_with_its_key(tmp_path, capsys, text, words):
    """When the model is built, and when a study is checked."""
    model = blocks(tmp_path)
    (tmp_path / "mu.csv").write_text(text)
    with pytest.raises(StudyFileError) as told:
        sq.model(str(model)).at().assembly  # noqa: B018
    assert "mu.csv" in str(told.value)
    assert words in str(told.value)
    assert "contact[1].friction_factor.file" in str(told.value)
    assert command("check", str(tmp_path / "study.toml")) != 0
    assert words in " ".join(capsys.readouterr().err.split())


BAD_KEYS = [
    (SPREAD, "friction_spread: expected only with a friction_factor over the face"),
    ("friction_factor = 0.8\n" + SPREAD, "expected only with a friction_factor over the face"),
    (MAP + "friction_spread = -1.0\n", "friction_spread': expected at least 0, got -1"),
    ("friction_factor = -0.8\n", "friction_factor': expected at least 0, got -0.8"),
    ('friction_factor = { file = "other.csv" }\n', "there is no file other.csv"),
    ('friction_factor = { fil = "mu.csv" }\n', "{ std = 0.1, length = 20 }, got a table of fil"),
    ('initial_gap = { fil = "film.csv" }\n', '{ file = "film.csv" }, got a table of fil'),
    ('initial_gap = "none"\n', """{ file = "film.csv" }, got 'none'"""),
    ('friction_factor = "high"\n', """{ std = 0.1, length = 20 }, got 'high'"""),
    ("friction_factor = nan\n", "{ std = 0.1, length = 20 }, got nan"),
]


@pytest.mark.parametrize(("more", "words"), BAD_KEYS)
def test_a_bad_key_is_one_sentence(tmp_path, more, words):
    with pytest.raises(StudyFileError) as told:
        sq.model(str(blocks(tmp_path, more)))
    assert words in str(told.value)


def test_a_map_is_no_number_that_a_parameter_can_be(tmp_path):
    model = blocks(tmp_path, parameters='[parameters.mu]\npath = "contact.pads.friction_factor"\n')
    with pytest.raises(StudyFileError, match="is no number in the file"):
        sq.model(str(model))


def test_a_spread_that_makes_friction_negative_is_refused(tmp_path):
    """In the file, as a parameter's default, and as a value."""
    words = "expected a friction_spread of at most"
    with pytest.raises(StudyFileError, match=rf"contact\[1\].friction_spread.*{words}"):
        sq.model(str(blocks(tmp_path, MAP + "friction_spread = 40.0\n"))).at().assembly  # noqa: B018
    model = sq.model(str(spread_blocks(tmp_path)))
    factors = model.at().assembly.contact.frictional
    with pytest.raises(ModelError, match=rf"lining.spread = 40 \(SI\): {words}") as told:
        model.at(**{"lining.spread": 40.0}).assembly  # noqa: B018
    most = float(str(told.value).split("at most ")[1].split(",")[0])
    least = model.at(**{"lining.spread": 0.999 * most}).assembly.contact.frictional.min()
    assert 0 < least < 0.01 * factors.max()


def test_another_map_is_another_model(tmp_path):
    """Results name the model by the content of its files."""
    before = contact_of(blocks(tmp_path)).frictional
    write_map(tmp_path, lambda x, y: 2 * plane(x, y))
    again = contact_of(tmp_path / "blocks.toml").frictional
    assert again == pytest.approx(2 * before, rel=1e-9)


def test_factors_of_an_unfinished_model_are_told(tmp_path, capsys):
    model = blocks(tmp_path)
    head, load = model.read_text().split("[[load]]")
    model.write_text(head + load[load.index("[parameters]") :])
    command("inspect", str(model))
    facts = " ".join(capsys.readouterr().out.split())
    assert "of mu.csv (mean " in facts
    assert "not yet load" in facts


def test_factors_are_told_and_those_of_nothing_do_not_wear(tmp_path, capsys):
    wear = "[wear]\npressure = 1.0\nfriction = 0.4\ndistance = 1e3\nrate = 1e-9\n"
    model = blocks(tmp_path, parameters=wear, factor=lambda x, y: max(0.0, x - 1.6))
    assert command("inspect", str(model)) in (0, 1)
    facts = " ".join(capsys.readouterr().out.split())
    assert "friction_factor 0 to 3." in facts
    assert "of mu.csv (mean " in facts
    assert "wore off pads" in facts


def test_factors_turn_with_their_part(tmp_path):
    """They are found where the slave's file has its face, however that stands turned."""
    model = blocks(tmp_path)
    turned = 'axis = [0, 0, 1]\nrotor = "slider"\nangle = 0.3'
    model.write_text(model.read_text().replace("axis = [0, 0, 1]", turned))
    contact = contact_of(model)
    back, point = np.radians(-0.3), np.array([4.0, -100.0])
    turn = np.array([[np.cos(back), -np.sin(back)], [np.sin(back), np.cos(back)]])
    own = (1e3 * contact.points[:, :2] - point) @ turn.T + point - [1.5, 0.5]
    assert contact.frictional == pytest.approx(plane(*own.T), rel=1e-9)
    assert np.abs(own - 1e3 * contact.points[:, :2] + [1.5, 0.5]).max() > 0.1
