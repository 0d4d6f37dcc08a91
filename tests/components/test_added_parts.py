"""Masses and springs that a design study adds: as in the model file, and what they do to modes."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from own_blocks import write_blocks

import squealstudy as sq
from squealstudy.engine.cache import NewGaps
from squealstudy.engine.export import export_model
from squealstudy.engine.structures import build_structure, build_task
from squealstudy.engine.workers import Workers
from squealstudy.errors import ParameterError, StudyFileError
from squealstudy.kinds.design.kind import request
from squealstudy.kinds.design.rows import design_row
from squealstudy.models.catalogue import MODELS
from squealstudy.models.catalogue.disc_brake.assemble import brake_faces
from squealstudy.models.catalogue.disc_brake.solids import COARSE, BrakeMesher
from squealstudy.wording import error_percent

pytestmark = pytest.mark.usefixtures("tiny_brake", "assembled_once")
MASS, STIFF = 1.5e-6, 4e6  # kg, N/m

STUDY = """\
[study]
name = "blocks"
kind = "design"
[model]
file = "blocks.toml"
[[sweep]]
parameter = "friction"
values = [0.4, 0.6]
[modes]
band = [500.0, 60000.0]
[goal]
margin = {damping_ratio = 0.0}
scan = 0
cycles = 0
in_time = 0
full_order = 1
"""
PARTS = """\
[[variable]]
added_mass = {on = "slider.TOP", max = "2 mg"}
[[variable]]
stiffener = {between = ["slider.TOP", "plate.ENDS"], max = "5 kN/mm", directions = [1, 3]}
[[variable]]
stiffener = {between = ["slider.ENDS", "ground"], max = 5e6, axes = "cylindrical"}
"""
IN_FILE = """\
[[point_mass]]
name = "there"
on = "slider.TOP"
mass = 1.5e-9

[[spring]]
name = "brace"
between = ["slider.TOP", "plate.ENDS"]
stiffness = [4e3, 0.0, 4e3]

[[spring]]
name = "to_ground"
between = ["slider.ENDS", "ground"]
axes = "cylindrical"
stiffness = [2e3, 2e3, 2e3]

[parameters]
"""
NAMES = (
    "added_mass.slider.TOP",
    "stiffener.slider.TOP.plate.ENDS",
    "stiffener.slider.ENDS.ground",
)
VALUES = dict(zip(NAMES, (MASS, STIFF, 2e6), strict=True))


def read(folder, text=STUDY + PARTS, *changes):
    return sq.read_study(write_blocks(folder, *changes, study=text)).resolved


def _plan(study):
    return study.kind.plan(study)


def test_they_are_what_stands_in_a_model_file(tmp_path):
    added = read(tmp_path / "added")
    there = read(tmp_path / "there", STUDY, ("[parameters]\n", IN_FILE))
    assert [v.name for v in added.variables] == list(NAMES)
    assert added.variables[0].high == pytest.approx(2e-6)
    assert added.variables[1].high == pytest.approx(5e6)
    assert not added.nominal.any()
    one = _plan(added).design({**added.values, **VALUES}).assembly()
    other = _plan(there).design(there.values).assembly()
    for a, b in ((one.M, other.M), (one.K_springs(), other.K_springs()), (one.K_el, other.K_el)):
        assert abs(a - b).max() <= 1e-14 * abs(b).max()
    bare = _plan(added).design(added.values).assembly()
    plain = read(tmp_path / "plain", STUDY)
    own = _plan(plain).design(plain.values).assembly()
    assert abs(bare.M - own.M).max() == 0.0
    assert abs(bare.K_springs() - own.K_springs()).max() == 0.0
    assert added.model.files != plain.model.files


def test_their_roots_are_those_of_the_model_file(tmp_path):
    """Roots of the reduced model and of full order to 1e-8, and slopes beside differences."""
    found, stages = [], ("modes", "full_order")
    texts = (STUDY + PARTS, STUDY)
    for text, changes in zip(texts, ((), (("[parameters]\n", IN_FILE),)), strict=True):
        study = read(tmp_path / str(len(found)), text, *changes)
        given = VALUES if study.variables else {}
        plan = study.kind.plan(study)
        values = {**study.values, **given, "friction": 0.6}
        point = plan.design(values)
        found.append(_solved(plan, point, *stages))
    for stage in stages:
        mine, theirs = (f[stage] for f in found)
        assert mine["status"] == theirs["status"] == "ok"
        for key in ("max_growth_rate", "min_damping_ratio"):
            assert mine[key] == pytest.approx(
                theirs[key], abs=1e-8 * 2 * np.pi * mine["frequency_hz"]
            )
        assert mine["frequency_hz"] == pytest.approx(theirs["frequency_hz"], rel=1e-8)


def _solved(plan, point, *stages):
    key = plan.structure_key(point)
    point = replace(point, structure=key, point_id="x")
    assert build_structure(build_task(plan, point, 1)) == (key, "")
    return {s: design_row(point, s, request(plan), NewGaps()) for s in stages}


@pytest.mark.full_size  # roots by default: above
def test_slopes_at_none_are_those_of_small_ones(tmp_path):
    """Damping to 3e-3 of the complex derivative: both structures are reduced for themselves."""
    study = read(tmp_path)
    plan = study.kind.plan(study)
    given = {**study.values, "friction": 1.2, "damping_ratio": 0.01}
    today = _solved(plan, plan.design(given), "modes")["modes"]
    for variable in study.variables:
        step = 2e-3 * variable.high
        point = plan.design({**given, variable.name: step})
        changed = _solved(plan, point, "modes")["modes"]["modes"]
        slopes = [
            next(s for s in mode["slopes"] if s["parameter"] == variable.name)
            for mode in today["modes"]
        ]
        most = max(abs(s["d_frequency_hz"]) for s in slopes)
        for mode, by in zip(today["modes"], slopes, strict=True):
            hz = mode["frequency_hz"]
            near = min(changed, key=lambda m, hz=hz: abs(m["frequency_hz"] - hz))
            df, dz = ((near[k] - mode[k]) / step for k in ("frequency_hz", "damping_ratio"))
            assert by["d_frequency_hz"] == pytest.approx(df, rel=0.05, abs=0.01 * most)
            noise = 3e-3 * np.hypot(df / hz, dz)
            assert by["d_damping_ratio"] == pytest.approx(dz, rel=0.05, abs=noise)


@pytest.mark.full_size  # one basis by default: test_shared_basis.py
def test_structures_of_a_search_have_one_basis(tmp_path):
    """Few reductions; the design is held against full order at a place that is in none of them."""
    text = STUDY.replace(
        "damping_ratio = 0.0}", "damping_ratio = 0.0096}\ndesigns = 12\nstarts = 1"
    )
    text = text.replace("[0.4, 0.6]", "[0.8, 1.2]")
    text = text.replace("[[sweep]]", "[parameters]\ndamping_ratio = 0.01\n[[sweep]]")
    part = PARTS.split("[[variable]]")[2]
    text += f'[[variable]]{part}[[variable]]\nparameter = "lining.E3"\nbounds = [-5e8, 2e9]\n'
    results = sq.run(write_blocks(tmp_path, study=text), tmp_path / "results", jobs=1)
    facts, shared = results.manifest["design_study"], results.manifest["shared_basis"]
    assert shared["used"]
    assert facts["n_reductions"] == shared["reductions"] <= 4 + 3 * 2
    assert facts["outcome"] == "met_linear"
    assert facts["n_structures"] > 2
    assert results.solved == len(results.points)  # none twice, though structures join
    chosen = results.points[(results.points["design"] == facts["chosen"]).to_numpy(bool)]
    full = chosen[(chosen["analysis"] == "full_order").to_numpy(bool)]
    assert len(full)
    told = dict(results.screen.facts(results))["error"]
    own = chosen[(chosen["analysis"] == "modes").to_numpy(bool)].set_index("friction")
    for row in full.itertuples():
        there = own.loc[row.friction]
        assert row.min_damping_ratio == pytest.approx(there["min_damping_ratio"], abs=1e-4)
        assert row.frequency_hz == pytest.approx(there["frequency_hz"], rel=1e-4)
        difference = abs(row.min_damping_ratio - there["min_damping_ratio"])
        assert f"the reduction by {error_percent(difference)}, against full order at 1" in told
    _slopes_are_those_of_all_degrees_of_freedom(read(tmp_path, text))


def _slopes_are_those_of_all_degrees_of_freedom(study):
    """Derivatives on the basis against those of the unreduced assembly."""
    plan = study.kind.plan(study)
    asked = request(plan)
    assert asked.basis
    point = plan.design({**study.values, "friction": 1.2})
    point = replace(point, structure=plan.structure_key(point), point_id="x")
    build_structure(build_task(plan, point, 1))
    rows = [
        design_row(point, "modes", r, NewGaps())["modes"] for r in (asked, replace(asked, basis=""))
    ]
    by, full = (
        {
            (name, column): [mode["slopes"][k][column] for mode in modes]
            for k, name in enumerate(s["parameter"] for s in modes[0]["slopes"])
            for column in ("d_frequency_hz", "d_growth_rate", "d_damping_ratio")
        }
        for modes in rows
    )
    assert by != full
    for key, own in by.items():
        size = np.abs(full[key]).max()
        np.testing.assert_allclose(own, full[key], rtol=0, atol=1e-3 * size, err_msg=str(key))


@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ('"2 mg"', '"2 mm"', "variable[1].added_mass.max", "is in kg"),
        ('"2 mg"', "0.0", "variable[1].added_mass.max", "more than 0"),
        (
            'max = "2 mg"',
            'max = "2 mg", at = [1.0]',
            "variable[1].added_mass.at",
            "expected 3 values, got 1",
        ),
        (
            '"slider.TOP", "plate.ENDS"',
            '"slider.TOP"',
            "variable[2].stiffener.between",
            "expected 2 values, got 1",
        ),
        ('on = "slider.TOP", max', "max", "variable[1].added_mass.on", "missing"),
        (
            ', max = "2 mg"}',
            ', max = "2 mg"}\nbounds = [0, 1]',
            "variable[1]",
            "expected bounds of a",
        ),
        (
            "added_mass =",
            'parameter = "bed.normal"\nadded_mass =',
            "variable[1]",
            "got parameter and",
        ),
        ("directions = [1, 3]", "directions = [4]", "variable[2].stiffener.directions[1]", "1"),
        (
            '["slider.ENDS", "ground"]',
            '["slider.TOP", "plate.ENDS"]',
            "variable[3].stiffener",
            "there is a parameter 'stiffener.slider.TOP.plate.ENDS' already",
        ),
    ],
)
def test_what_a_file_may_not_say(tmp_path, old, new, key, message):
    text = STUDY + PARTS
    assert text.count(old) == 1
    with pytest.raises(StudyFileError) as caught:
        read(tmp_path, text.replace(old, new))
    assert message in str(caught.value)
    assert caught.value.key == key


def test_what_is_added_has_no_value_before(tmp_path):
    """Else there could be more of it than max."""
    value = f'[parameters]\n"{NAMES[0]}" = 1e-6\n[[sweep]]'
    with pytest.raises(StudyFileError, match="starting from 0: expected no value") as caught:
        read(tmp_path, STUDY.replace("[[sweep]]", value) + PARTS)
    assert caught.value.key == f"parameters.{NAMES[0]}"
    variant = f'[[variant]]\nname = "a"\nparameters = {{"{NAMES[0]}" = 1e-6}}\n'
    with pytest.raises(StudyFileError, match=r"variant 'a': .* expected no value"):
        read(tmp_path, STUDY + PARTS + variant)


def test_it_is_said_where_masses_can_be_added():
    """In Python there is none; a study of any kind has them, not a design alone."""
    with pytest.raises(ParameterError, match=r"by a study, in its \[parameters\], a \[\[sweep\]\]"):
        sq.model("disc_brake", **{"added_mass.caliper.BRIDGE": "50 g"})
    with pytest.raises(ParameterError, match=r"by a study, in a \[\[variable\]\] of a design"):
        sq.model("disc_brake", **{"stiffener.caliper.BRIDGE": 1.0})


def test_springs_of_a_set_to_itself_are_refused(tmp_path):
    study = read(tmp_path, STUDY + PARTS.replace("plate.ENDS", "slider.TOP"))
    with pytest.raises(StudyFileError, match=r"got 'slider\.TOP' twice") as caught:
        study.kind.make_missing_models(study.kind.plan(study), Workers())
    assert caught.value.key == "variable[2].stiffener"


def test_a_frequency_may_be_scaled_that_nothing_varies(tmp_path):
    scaled = '[parameters]\n"slider.modes[1].frequency_scale" = 1.1\n[[sweep]]'
    study = read(tmp_path, STUDY.replace("[[sweep]]", scaled))
    plan = _plan(study)
    assert plan.trained_scales == ({("slider", 1): 1.1},)
    point = plan.design({**study.values, "friction": 0.6})
    assert _solved(plan, point, "modes")["modes"]["status"] == "ok"


def test_a_set_that_is_not_there_is_said_with_its_place_in_the_study(tmp_path):
    study = read(tmp_path, STUDY + PARTS.replace("slider.TOP", "slider.TOPP", 1))
    plan = study.kind.plan(study)
    with pytest.raises(StudyFileError, match="did you mean 'TOP'") as caught:
        study.kind.make_missing_models(plan, Workers())
    assert caught.value.path == tmp_path / "study.toml"
    assert caught.value.key == "variable[1].added_mass"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("hoffmann", "model 'hoffmann' has no named sets: disc_brake and model files have"),
        ("disc_brake", "model 'disc_brake' has no set 'slider.TOP'; it has disc.HUB, "),
    ],
)
def test_sets_that_a_model_does_not_have(tmp_path, name, said):
    path = tmp_path / "study.toml"
    model = f'[model]\nname = "{name}"\n'
    path.write_text((STUDY + PARTS).replace('[model]\nfile = "blocks.toml"\n', model))
    with pytest.raises(StudyFileError, match=said) as caught:
        sq.read_study(path)
    assert caught.value.key == "variable[1].added_mass"


# -- on the sets of the generated brake -----------------------------------------------------------
GENERATED = STUDY.replace(
    'file = "blocks.toml"', 'name = "disc_brake"\nmesh = "coarse"\ncontact_points = 2'
)
ON_BRAKE = """\
[[variable]]
added_mass = {on = "caliper.BRIDGE", max = "80 g"}
[[variable]]
added_mass = {on = "outer_pad.EARS", max = "20 g", at = [0.12, 0.01, 0.02]}
[[variable]]
[variable.stiffener]
between = ["caliper.BRIDGE", "ground"]
max = "2 kN/mm"
axes = "cylindrical"
directions = [3]
[[variable]]
[variable.stiffener]
between = ["caliper.BODY", "inner_pad.PISTON"]
max = "5 kN/mm"
directions = [1, 3]
"""
SIZES = (0.05, 0.02, 1.5e6, 4e6)


def of_brake(folder, text):
    folder.mkdir(exist_ok=True)
    path = folder / "study.toml"
    path.write_text(text)
    return sq.read_study(path).resolved


def assembly_of(study, sizes):
    values = dict(zip((v.name for v in study.variables), sizes, strict=True))
    return study.model.build(study.options, {**study.values, **values})


@pytest.mark.full_size  # of blocks: by default
def test_on_the_generated_brake_they_are_what_they_are_on_its_export(tmp_path):
    generated = of_brake(tmp_path, GENERATED + ON_BRAKE)
    export_model(generated, tmp_path)
    exported = of_brake(tmp_path, STUDY.replace("blocks.toml", "brake.toml") + ON_BRAKE)
    mine, theirs = (assembly_of(study, SIZES) for study in (generated, exported))
    bare = assembly_of(generated, (0.0,) * 4)
    assert mine.M.sum() - bare.M.sum() == pytest.approx(3 * sum(SIZES[:2]), rel=1e-9)
    added = mine.M - bare.M, mine.K_springs() - bare.K_springs()
    without = assembly_of(exported, (0.0,) * 4)
    for one, other in zip(
        added, (theirs.M - without.M, theirs.K_springs() - without.K_springs()), strict=True
    ):
        assert abs(other).max() > 0
        assert abs(one - other).max() <= 1e-9 * abs(other).max()


def test_the_generated_brake_has_the_sets_that_it_names():
    model = MODELS["disc_brake"]
    options = {o.name: o.choices[0] for o in model.options} | {"mesh": "coarse"}
    built = model.build(options, model.defaults())
    found = [f"{c.name}.{name}" for c in built.components for name in c.sets]
    assert sorted(found) == sorted(model.sets)
    faces = brake_faces(BrakeMesher(model.defaults(), COARSE))
    assert {name: set(own) for name, own in faces.items()} == {
        c.name: set(c.sets) for c in built.components
    }
    for component in built.components:
        for points in component.sets.values():
            assert points().shape.shape[1] == len(component.coordinates)


ON_BRIDGE = "added_mass.caliper.BRIDGE"
NAMED = f"""\
[study]
name = "named"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2
[[sweep]]
parameter = "{ON_BRIDGE}"
values = [0.0, "50 g"]
"""


def test_any_study_adds_a_mass_by_its_name(tmp_path):
    """As the variable of a design study does; swept, or one for all design points."""
    swept = of_brake(tmp_path, NAMED)
    assert (swept.sweeps[0].low, swept.sweeps[0].high) == (0.0, 0.05)
    variable = '[[variable]]\nadded_mass = {on = "caliper.BRIDGE", max = "80 g"}\n'
    design = of_brake(tmp_path, GENERATED + variable)
    bare, mine = (
        swept.model.build(swept.options, {**swept.values, ON_BRIDGE: m}) for m in (0, 0.05)
    )
    theirs = assembly_of(design, (0.05,))
    assert mine.M.sum() - bare.M.sum() == pytest.approx(3 * 0.05, rel=1e-9)
    assert abs(mine.M - theirs.M).max() == 0
    fixed = of_brake(
        tmp_path, NAMED.split("[[sweep]]")[0] + f"[parameters]\n{ON_BRIDGE} = '80 g'\n"
    )
    assert fixed.values[ON_BRIDGE] == 0.08


def test_a_mass_is_added_to_a_model_file_by_its_name(tmp_path):
    """The frequencies of one that the file has itself."""
    study = STUDY.split("[goal]")[0].replace('"design"', '"complex_modes"')
    by_name = f'[parameters]\n"{NAMES[0]}" = "1.5e-6 kg"\n[[sweep]]'
    named = read(tmp_path / "named", study.replace("[[sweep]]", by_name, 1))
    written = read(
        tmp_path / "written",
        study,
        ("[parameters]\n", IN_FILE.split("[[spring]]")[0] + "[parameters]\n"),
    )
    one, other = (s.model.build(s.options, s.values).M for s in (named, written))
    assert abs(one - other).max() <= 1e-12 * abs(other).max()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (ON_BRIDGE, ON_BRIDGE + "S", "no set 'caliper.BRIDGES'; did you mean 'caliper.BRIDGE'"),
        (ON_BRIDGE, "added_mass.caliper", "no set 'caliper'"),
        ('"50 g"', '"50 mm"', "is in kg: got '50 mm'"),
        ('"50 g"', "-0.1", "at least 0"),
        ('"disc_brake"\nmesh = "coarse"\ncontact_points = 2', '"hulten"', "no named sets"),
    ],
)
def test_masses_that_cannot_be_added_by_name(tmp_path, old, new, said):
    assert old in NAMED
    with pytest.raises(StudyFileError, match=re.escape(said)) as caught:
        of_brake(tmp_path, NAMED.replace(old, new))
    assert caught.value.key.startswith("sweep[1]")


def test_a_set_too_large_for_a_mass_elsewhere_is_told_before_the_search(tmp_path, monkeypatch):
    """Of today's design, in which nothing is added yet."""
    monkeypatch.setattr("squealstudy.models.components.attached.MOST_NODES", 8)
    study = of_brake(tmp_path, GENERATED + ON_BRAKE)
    with pytest.raises(StudyFileError, match="couples all of them") as caught:
        assembly_of(study, (0.0,) * 4)
    assert caught.value.key == "variable[2].added_mass"


def test_where_a_mass_is_decides_the_reduction(tmp_path):
    """Names of parameters do not tell it: keys must."""
    keys = set()
    for place in ("0.02]", "0.03]"):
        study = of_brake(tmp_path / place[:-1], GENERATED + ON_BRAKE.replace("0.02]", place))
        plan = study.kind.plan(study)
        keys.add(plan.structure_key(plan.design(study.values)))
    assert len(keys) == 2
