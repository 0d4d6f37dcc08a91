"""Laws from outside in kernels: copies of the package's laws under other names do the same."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import HERE
from shared_kernels import by_integrator

from squealstudy import extensions, laws
from squealstudy.extensions import load_extension
from squealstudy.kernels.law_set import SOURCES
from squealstudy.kernels.laws import friction_tangent, law_row, law_rows, mu_at
from squealstudy.kernels.newmark_layout import LAW_CURVE, OUTSIDE
from squealstudy.laws import (
    CONTACT_LAWS,
    FRICTION_CURVES,
    REGULARISATIONS,
    FrictionLaw,
    contact_law,
    friction_curve,
)
from squealstudy.laws.registry import Registry
from squealstudy.motion.integrator import integrator, integrators
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem, MotionPoint

PACKAGE = Path(laws.__file__).parent
FILES = {"contact": "exponential", "friction": "exponential_fall", "regularisation": "smooth"}
CUBE, CURVE = "my_contact_law.py", "my_friction_curve.py"


@pytest.fixture(autouse=True, scope="module")
def _registers():
    """What the tests register in this process ends with them."""
    registers = (CONTACT_LAWS._known, FRICTION_CURVES._known, REGULARISATIONS._known)
    known = [*registers, Registry.shared, extensions._read]
    before = [dict(found) for found in known]
    modules = set(sys.modules)
    yield
    for found, content in zip(known, before, strict=True):
        found.clear()
        found.update(content)
    for name in set(sys.modules) - modules:
        if name.startswith("squealstudy_extension_"):
            del sys.modules[name]


@pytest.fixture(scope="module")
def copies(tmp_path_factory):
    """A contact law, a curve and a regularisation of the package as files outside it."""
    folder = tmp_path_factory.mktemp("laws")
    for sort, name in FILES.items():
        text = (PACKAGE / sort / f"{name}.py").read_text()
        assert f'name="{name}"' in text
        path = folder / f"copied_{name}.py"
        path.write_text(text.replace(f'name="{name}"', f'name="copied_{name}"'))
        load_extension(path)


@pytest.mark.parametrize("name", ["map", "table"])
def test_long_curves_of_the_package_are_called_by_address_and_a_change_of_them_is_seen(name):
    curve = FRICTION_CURVES[name]
    row = law_row(contact_law("exponential"), FrictionLaw(0.4, 1e8, friction_curve(curve.name)))
    assert row[LAW_CURVE] == OUTSIDE
    assert (curve.name, curve.source) in SOURCES  # of which the folder of kernels has its name


def scene():
    """Two modes under three sliding points that nearly stick, one of them nearly open."""
    rng = np.random.default_rng(4)
    N, T1, T2 = rng.standard_normal((3, 3, 2))
    one = np.ones(3)
    system = ModalSystem(
        omega2=np.array([4e6, 9e6]),
        N=N,
        T1=T1,
        T2=T2,
        area=1e-4 * one,
        frictional=one,
        radius=one,
        gap=np.array([-2e-6, -1e-6, 4e-6]),
        k_ref=np.zeros(3),
        force=np.zeros((3, 3)),
        sensed=np.array([1]),
    )
    curve = friction_curve(static_ratio=1.6, decay_speed=0.05)
    friction = FrictionLaw(0.4, 2e7, curve, "smooth")
    law = contact_law("exponential", p0=2e5, lam=4e5)
    return system, MotionPoint(contact=law, friction=friction, speed=0.01, c=np.array([40.0, 60.0]))


def copied(design, sorts):
    """The design with laws from outside of some sorts."""
    friction, law = design.friction, design.contact
    if "contact" in sorts:
        law = replace(law, kind="copied_exponential")
    if "friction" in sorts:
        friction = replace(friction, curve=replace(friction.curve, kind="copied_exponential_fall"))
    if "regularisation" in sorts:
        friction = replace(friction, regularisation="copied_smooth")
    return replace(design, contact=law, friction=friction)


def end(system, designs, name):
    settings = MotionSettings(1e-3, 1e-6, 10, tolerance=1e-12, integrator=integrator(name))
    results = simulate(system, designs, settings)
    assert all(r.outcome == "ok" for r in results)
    return np.array([np.concatenate([r.q, r.v]) for r in results])


@pytest.mark.parametrize("sorts", [(name,) for name in FILES] + [tuple(FILES)], ids=str)
def test_a_run_is_that_of_the_package_law(copies, sorts):
    system, design = scene()
    found = end(system, [copied(design, sorts)], "newmark")
    np.testing.assert_allclose(found, end(system, [design], "newmark"), rtol=1e-9)


def test_points_stick_as_by_the_package_law(copies):
    system, design = scene()
    slow = replace(design, speed=0.003)
    settings = MotionSettings(1e-3, 1e-6, 10, tolerance=1e-12, integrator=integrator("newmark"))
    runs = [simulate(system, [d], settings)[0] for d in (slow, copied(slow, ("friction",)))]
    package, outside = (r.history for r in runs)
    assert package["stick"].max() > 0.1
    assert package["creep"].max() > 0
    for name in ("stick", "slip", "open", "creep", "torque"):
        np.testing.assert_allclose(outside[name], package[name], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", by_integrator(sorted(set(integrators()) - {"newmark"})))
def test_every_integrator_computes_laws_from_outside(copies, name):
    system, design = scene()
    found = end(system, [copied(design, tuple(FILES))], name)
    np.testing.assert_allclose(found, end(system, [design], name), rtol=1e-7)


def test_designs_of_one_batch_have_laws_of_their_own(copies):
    load_extension(HERE / CUBE)
    load_extension(HERE / CURVE)
    system, design = scene()
    cube = replace(design, contact=contact_law("cube", cube=1e22))
    fading = replace(cube, friction=FrictionLaw(0.4, 2e7, friction_curve("fading", fade=1e5)))
    designs = [design, cube, copied(design, ("contact",)), fading, design]
    rows = law_rows((d.contact, d.friction) for d in designs)
    for row, d in zip(rows, designs, strict=True):
        alone = law_row(d.contact, d.friction)
        np.testing.assert_array_equal(row[: len(alone)], alone)
        assert not row[len(alone) :].any()
    together = end(system, designs, "newmark")
    for found, d in zip(together, designs, strict=True):
        np.testing.assert_allclose(found, end(system, [d], "newmark")[0], rtol=1e-9)
    assert np.abs(together[0] / together[1] - 1).max() > 0.1  # laws matter here
    assert np.abs(together[1] / together[3] - 1).max() > 0.01


def test_values_at_a_point_are_those_of_the_file():
    load_extension(HERE / CURVE)
    curve = friction_curve("fading", fade=3e5)
    law = law_row(contact_law(), FrictionLaw(0.7, 1e6, curve))
    s, p = 0.3, 4e5
    assert mu_at(law, s, p) == pytest.approx(curve.definition.mu(s, p, 0.7, 3e5), rel=1e-15)
    *_, by_p, _ = friction_tangent(law, 1.0, p, s, 0.0)
    assert by_p == pytest.approx(-0.7 / (1 + 4 / 3) ** 2, rel=1e-12)  # mu + p dmu/dp


def test_no_kernel_is_compiled_for_a_law_from_outside(copies):
    """In a process that has the kernels of the package on disk."""
    code = f"""
from squealstudy.extensions import load_extension
from squealstudy.kernels.newmark_batch import newmark_batch
from squealstudy.laws import contact_law
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.warmup import smallest_system
from dataclasses import replace
load_extension({str(HERE / CUBE)!r})
system, design = smallest_system()
simulate(system, [replace(design, contact=contact_law("cube"))], MotionSettings(2e-6, 1e-6, 1))
print(sum(newmark_batch.stats.cache_misses.values()))
"""
    system, design = scene()
    end(system, [design], "newmark")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "0"


def test_a_program_imports_a_law_that_a_study_has_executed(tmp_path):
    """What was compiled for the study names its module; the program's has another name."""
    text = (HERE / CURVE).read_text().replace('name="fading"', 'name="imported"')
    (tmp_path / "imported_law.py").write_text(text)
    load_extension(tmp_path / "imported_law.py")
    law_row(contact_law(), FrictionLaw(0.7, 1e6, friction_curve("imported")))
    code = f"""
import sys
sys.path.insert(0, {str(tmp_path)!r})
import imported_law
from squealstudy.kernels.laws import law_row, mu_at
from squealstudy.laws import FrictionLaw, contact_law, friction_curve
print(mu_at(law_row(contact_law(), FrictionLaw(0.7, 1e6, friction_curve("imported"))), 0.3, 1e6)[0])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout) == pytest.approx(0.35)
