"""Public names say what a user must know, and their examples run.

Public is what docs/reference/python.md says: the names of the package, the steps of the mechanics,
and what extensions register or derive from.
"""

import dataclasses
import doctest
import importlib
import importlib.util
import inspect
import re
from functools import cached_property
from pathlib import Path

import pytest

import squealstudy
from squealstudy.engine import pictures

DOCS = Path(__file__).parents[2] / "docs"
ENTRY = re.compile(
    r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: : .*)?$\n((?:^ .*\n?|^\n(?= ))*)", re.MULTILINE
)
SECTION = re.compile(r"^(\w+)\n-+\n(.*?)(?=^\w+\n-+$|\Z)", re.MULTILINE | re.DOTALL)
SHAPE = re.compile(r"\((?:\w[^()]*)?,[^()]*\)|\(m\)")
UNIT = re.compile(
    r"\[[^\]]+\]|\b(?:N s/m|N/m|Pa/m|rad/s|1/s|m/s|Hz|Pa|N|J|kg|m2|m|s)\b|sqrt\(kg\)"
    r"|without unit|relative|times|[Ss]hares?\b|ratio|factor|number|count|[Ww]hether|of bool"
    r"|backward error"
)
NEVER_FAIL = {"list_examples", "list_models"}


def generate():
    """The module that makes pages; it knows which names are public."""
    spec = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PAGES = generate()


def public_names():
    """Functions and classes by the name they are shown under."""
    names = {n: getattr(squealstudy, n) for n in squealstudy.__all__ if not n.startswith("_")}
    names |= {n: getattr(importlib.import_module(m), n) for m, n in PAGES.MECHANICS}
    for module, name in PAGES.extension_names():
        if name.startswith("register") or name in PAGES.TO_DEFINE:
            names[name] = getattr(importlib.import_module(module), name)
    return names


def members(name, cls):
    """Methods and properties of a class that its page shows, without those of its base library."""
    if name == "Results":
        shown = PAGES.public_of_results()
    elif name in PAGES.TO_DEFINE:
        return  # what a file of the user's gives: shown by the examples of extensions
    else:
        shown = [n for n in dir(cls) if not n.startswith("_")]
    for member in shown:
        attribute = inspect.getattr_static(cls, member)
        if isinstance(attribute, cached_property):
            attribute = attribute.func
        elif isinstance(attribute, property):
            attribute = attribute.fget
        elif isinstance(attribute, classmethod | staticmethod):
            attribute = attribute.__func__
        if inspect.isfunction(attribute):
            yield f"{name}.{member}", attribute


NAMES = public_names()
CALLABLES = {n: f for n, f in NAMES.items() if inspect.isfunction(f)}
CLASSES = {n: c for n, c in NAMES.items() if inspect.isclass(c)}
MEMBERS = {n: f for name, cls in CLASSES.items() for n, f in members(name, cls)}


def arguments(function):
    names = [n for n in inspect.signature(function).parameters if n not in ("self", "cls")]
    return [n for n in names if not n.startswith("_")]


WITH_ARGUMENTS = {n: f for n, f in MEMBERS.items() if arguments(f)}


def sections(item):
    return dict(SECTION.findall(inspect.getdoc(item) or ""))


def entries(text):
    """What a section says of each name."""
    return {
        name.strip("* "): head + said
        for names, head, said in (
            (m[1], m[0].split("\n")[0] + "\n", m[2]) for m in ENTRY.finditer(text)
        )
        for name in names.split(",")
    }


@pytest.mark.parametrize("name", CALLABLES | WITH_ARGUMENTS)
def test_every_argument_and_error_is_told(name):
    function = (CALLABLES | WITH_ARGUMENTS)[name]
    told = sections(function)
    lacking = set(arguments(function)) - set(entries(told.get("Parameters", "")))
    assert not lacking, f"no word of {lacking}"
    assert "Raises" in told or name in NEVER_FAIL


@pytest.mark.parametrize("name", CALLABLES | CLASSES | WITH_ARGUMENTS)
def test_every_name_has_an_example(name):
    """Of what extensions register or derive from it is a file of tests/extension."""
    if name.startswith("register") or name in PAGES.TO_DEFINE:
        assert any(n == name for _, n in PAGES.extension_names())
        return
    said = sections((CALLABLES | CLASSES | WITH_ARGUMENTS)[name]).get("Examples", "")
    whole, _, method = name.partition(".")
    if method and ">>> " not in said:  # that of its class shows it
        said = sections(CLASSES[whole]).get("Examples", "")
        assert f".{method}(" in said, "no example, nor in that of its class"
    assert ">>> " in said


def numbers(name, cls):
    """Arrays and real numbers of a class, and what is said of each."""
    said = {}
    for base in reversed(inspect.getmro(cls)):
        if base.__module__.startswith("squealstudy"):
            told = sections(base)
            said |= entries(told.get("Attributes") or told.get("Parameters", ""))
    for field in dataclasses.fields(cls) if dataclasses.is_dataclass(cls) else ():
        if not field.name.startswith("_"):
            yield field.name, field.type, said.get(field.name)
    for member, function in members(name, cls):
        if not arguments(function):
            yield member, function.__annotations__.get("return", ""), inspect.getdoc(function)


@pytest.mark.parametrize("name", CLASSES)
def test_every_array_has_a_shape_and_every_number_a_unit(name):
    for member, annotation, said in numbers(name, CLASSES[name]):
        assert said, f"no word of {member}"
        types = set(annotation.split(" | "))
        if "np.ndarray" in types and types <= {"np.ndarray", "float", "int"}:
            assert SHAPE.search(said), f"no shape of {member}: {said}"
        if types & {"np.ndarray", "float"} and types <= {"np.ndarray", "float"}:
            assert UNIT.search(said), f"no unit of {member}: {said}"


MODULES = sorted(
    {item.__module__ for item in NAMES.values()}
    | {"squealstudy.engine.result_rankings", "squealstudy.engine.result_tables"}
)


# whose studies run in time, follow cycles, or measure methods
LONG_PLOTS = {"levels", "growth_comparison", "modal_energies", "spectrogram", "torque_history"}
LONG_PLOTS |= {"cycle_levels", "cycle_growth", "cycle_spectrum", "verdict_map"}
LONG_PLOTS |= {"design_history", "operating_matrix", "work_precision"}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.full_size] if name in LONG_PLOTS else [])
        for name, plot in pictures.plots().items()
        if plot.draw.__module__.startswith("squealstudy.")
    ],
)
def test_the_example_of_a_plot_draws_it(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    draw = pictures.plots()[name].draw
    (example,) = doctest.DocTestFinder(recurse=False).find(draw, name, globs={})
    assert f".plot.{name}(" in example.docstring
    assert doctest.DocTestRunner().run(example).failed == 0
    assert list(tmp_path.glob("*.png"))


@pytest.mark.parametrize("module", MODULES)
def test_examples_run(module, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pictures, "_REGISTERED", dict(pictures.plots()))  # those of examples end
    done = doctest.testmod(importlib.import_module(module))
    assert done.failed == 0
