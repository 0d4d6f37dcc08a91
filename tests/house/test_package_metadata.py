"""What package indices are told: classifiers, and the conda recipe beside pyproject.toml."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import yaml

import squealstudy

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
RECIPE = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text("utf-8"))
OTHER_NAMES = {"matplotlib-base": "matplotlib"}  # of conda's packages without a desktop's windows


def test_the_conda_recipe_needs_what_the_package_needs():
    run = {}
    for line in RECIPE["requirements"]["run"]:
        name, _, least = line.partition(" ")
        run[OTHER_NAMES.get(name, name)] = least
    assert run.pop("python") == PROJECT["requires-python"]
    assert run == {
        name: line.removeprefix(name)
        for line in PROJECT["dependencies"]
        for name in re.findall(r"^[\w-]+", line)
    }
    build = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["build-system"]
    host = [line.replace(" ", "") for line in RECIPE["requirements"]["host"]]
    assert set(build["requires"]) < set(host)


def test_the_conda_recipe_is_of_this_version_and_has_its_command():
    assert RECIPE["context"]["version"] == squealstudy.__version__
    entries = [f"{name} = {target}" for name, target in PROJECT["scripts"].items()]
    assert RECIPE["build"]["python"]["entry_points"] == entries
    assert RECIPE["about"]["summary"] == PROJECT["description"]
    assert (ROOT / RECIPE["about"]["license_file"]).is_file()


def test_classifiers_are_in_order_and_of_the_least_python():
    classifiers = PROJECT["classifiers"]
    assert classifiers == sorted(classifiers)
    assert "Programming Language :: Python :: " + PROJECT["requires-python"][2:] in classifiers
    assert ("Typing :: Typed" in classifiers) == (ROOT / "squealstudy" / "py.typed").is_file()
