"""Texts of study files, from the parts that many tests have in common."""

from __future__ import annotations


def study_text(name: str, kind: str, model: str) -> str:
    """The sections [study] and, so far, [model]."""
    return f'\n[study]\nname = "{name}"\nkind = "{kind}"\n[model]\nname = "{model}"\n'


def sweep_text(parameter: str, start: float | str, stop: float | str, num: int | str) -> str:
    """A range of a parameter; texts such as "{num}" are filled in later."""
    head = f'[[sweep]]\nparameter = "{parameter}"\n'
    return f"{head}start = {start}\nstop = {stop}\nnum = {num}\n"
