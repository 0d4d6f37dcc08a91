"""Other code paths of this processor: a run that asked for one and does not have it says so."""

from __future__ import annotations

import code_paths
import pytest


def test_a_path_that_is_not_in_effect_is_named(monkeypatch):
    """Also in a run that has some of them."""
    absent = [path for path, holds in code_paths.IN_EFFECT.items() if not holds()]
    monkeypatch.setenv(code_paths.ASKED, ",".join(code_paths.IN_EFFECT))
    assert code_paths.missing() == absent
    monkeypatch.setenv(code_paths.ASKED, "")
    assert code_paths.missing() == []


@pytest.mark.parametrize("path", code_paths.IN_EFFECT)
def test_each_path_is_asked_for_by_one_variable(path):
    ((name, value),) = code_paths.environment(path).items()
    assert name.isupper()
    assert value or path == "baseline"  # a processor may have no feature beyond numpy's baseline
    assert " " not in value  # one argument of `env`
