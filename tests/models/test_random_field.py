"""Friction over a contact face as a normal random field."""

from __future__ import annotations

import numpy as np
import pytest
from own_blocks import write_blocks
from scipy.spatial.distance import cdist

import squealstudy as sq
from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.components.random_field import MOST_POINTS, random_field
from squealstudy.study.components import read_model

FIELD = "friction_factor = { std = 0.1, length = 2.0 }\nfriction_seed = 3\n"
PARAMETER = '[parameters.seed]\npath = "contact.pads.friction_seed"\n'


def blocks(folder, more=FIELD):
    write_blocks(folder, ("search = 0.1\n", f'name = "pads"\nsearch = 0.1\n{more}'))
    model = folder / "blocks.toml"
    model.write_text(model.read_text() + PARAMETER * ("friction_seed" in more))
    return model


def test_the_covariance_over_many_seeds_is_that_of_the_distance():
    """Means, variances and covariances of 6000 seeds, to five standard errors; areas differ."""
    rng, length, seeds = np.random.default_rng(1), 20e-3, 6000
    points = np.column_stack([*rng.uniform(0, 60e-3, (2, 30)), np.zeros(30)])
    area = rng.uniform(1e-6, 9e-6, 30)
    fields = np.array([random_field(points, area, length, seed) for seed in range(seeds)])
    expected = np.exp(-((cdist(points, points) / length) ** 2))
    error = np.sqrt((1 + expected**2) / seeds)
    assert (np.abs(fields.mean(axis=0)) < 5 / np.sqrt(seeds)).all()
    assert (np.abs(fields.T @ fields / seeds - expected) < 5 * error).all()


def test_a_field_is_that_of_its_seed_whatever_the_eigenvectors(monkeypatch):
    """Signs, and turns within an eigenvalue, which machines choose, change nothing."""
    x = np.array([[1.0, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])  # two alike, by symmetry
    field = random_field(x, np.ones(4), 1.5, 7)
    import scipy.linalg as la

    eigh = la.eigh

    def other(A):
        lam, vectors = eigh(A)
        c, s = np.cos(0.7), np.sin(0.7)
        assert lam[1] == pytest.approx(lam[2], rel=1e-12)
        turned = vectors[:, 1:3] @ np.array([[c, -s], [s, c]])
        return lam, np.column_stack([-vectors[:, 0], turned, vectors[:, 3]])

    monkeypatch.setattr(la, "eigh", other)
    assert random_field(x, np.ones(4), 1.5, 7) == pytest.approx(field, rel=1e-9)
    assert random_field(x, np.ones(4), 1.5, 8) != pytest.approx(field, rel=1e-2)


def test_factors_are_one_and_the_field(tmp_path):
    """Lengths are in the unit of the file; the seed is a parameter that is swept."""
    model = sq.model(str(blocks(tmp_path)))
    for seed in (3, 4):
        contact = model.at(seed=seed).assembly.contact
        field = random_field(contact.points, contact.area, 2e-3, (seed, 0))
        assert contact.frictional == pytest.approx(1 + 0.1 * field, rel=1e-7)


def test_contacts_of_one_seed_differ(tmp_path):
    """Two pads of one mesh are not worn in alike: one seed is one brake."""
    path = blocks(tmp_path)
    head, rest = path.read_text().split("[[contact]]")
    table, tail = rest.split("[[layer]]")
    twice = table.replace('"pads"', '"others"')
    path.write_text(f"{head}[[contact]]{table}[[contact]]{twice}[[layer]]{tail}")
    factors = sq.model(str(path)).at().assembly.contact.frictional.reshape(2, -1)
    assert np.abs(factors[0] - factors[1]).max() > 0.01


def test_a_spread_scales_what_deviates_from_the_mean_over_the_face(tmp_path):
    plain = sq.model(str(blocks(tmp_path / "plain"))).at().assembly.contact
    model = blocks(tmp_path / "spread", FIELD + "friction_spread = 0.5\n")
    mean = np.average(plain.frictional, weights=plain.area)
    expected = mean + 0.5 * (plain.frictional - mean)
    assert sq.model(str(model)).at().assembly.contact.frictional == pytest.approx(expected)


def test_the_largest_factor_of_each_seed_is_doubted(tmp_path):
    path = blocks(tmp_path)
    model = sq.model(str(path))
    friction, *_ = read_model(path).assumptions
    seeds = np.array([5.0, 3.0, 5.0])
    most = [0.4 * model.at(seed=s).assembly.contact.frictional.max() for s in seeds]
    values = read_model(path).defaults() | {"friction": 0.4}
    assert friction.values(values | {"seed": seeds}, 3) == pytest.approx(most)
    assert friction.values(values | {"seed": 3.0}, 3) == pytest.approx([most[1]] * 3)


BAD = [
    ("friction_factor = { std = 0.1, length = 2.0 }\n", "friction_seed with a random"),
    ("friction_factor = 0.8\nfriction_seed = 3\n", "friction_seed with a random"),
    (FIELD.replace("0.1", "0.0"), "expected a number above 0 for std, got 0"),
    (FIELD.replace("2.0", '"2 mm"'), "expected a number above 0 for length, got '2 mm'"),
    (FIELD.replace("3", "-1"), "expected at least 0, got -1"),
    (FIELD.replace("length", "lenght"), "{ std = 0.1, length = 20 }, got"),
    (FIELD.replace("0.1", "3.0"), "this random field of factors falls to -"),
]


@pytest.mark.parametrize(("more", "words"), BAD)
def test_a_bad_field_is_one_sentence(tmp_path, more, words):
    with pytest.raises(StudyFileError) as told:
        sq.model(str(blocks(tmp_path, more))).at().assembly  # noqa: B018
    assert words in str(told.value)
    assert "blocks.toml, line" in str(told.value)


def test_a_seed_that_is_no_whole_number_and_too_many_points(tmp_path):
    model = sq.model(str(blocks(tmp_path)))
    with pytest.raises(ModelError, match=r"seed = 2.5 .*expected a whole friction_seed"):
        model.at(seed=2.5).assembly  # noqa: B018
    many = np.zeros((MOST_POINTS + 1, 3))
    with pytest.raises(ModelError, match="expected at most 4000 contact points of a random field"):
        random_field(many, np.ones(len(many)), 1.0, 0)
