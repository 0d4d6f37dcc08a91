"""The laws that the kernels of this process know: those registered when kernels are first imported.

A law that is registered later has no code: `code_of` raises, and no other law is computed for it.
"""

from __future__ import annotations

from collections.abc import Sequence

from squealstudy.errors import ModelError
from squealstudy.laws import CONTACT_LAWS, FRICTION_CURVES, REGULARISATIONS
from squealstudy.laws.registry import LawDefinition

CONTACT = tuple(CONTACT_LAWS)
CURVES = tuple(FRICTION_CURVES)
SLOPES = tuple(REGULARISATIONS)
SOURCES = tuple((law.name, law.source) for law in (*CONTACT, *CURVES, *SLOPES))


def code_of(law: LawDefinition, known: Sequence[LawDefinition]) -> int:
    """Place of a law among those that were compiled.

    Raises
    ------
    ModelError
        A law that was registered, or changed, after the kernels were imported.
    """
    for code, other in enumerate(known):
        if (other.name, other.source) == (law.name, law.source):
            return code
    raise ModelError(
        f"'{law.name}' was registered after the kernels of this process were made: start Python "
        "anew, and name its file in the study's 'extensions' or register it before the first run"
    )
