"""Numbers of design points of a study that break assumptions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

BETWEEN = "; "  # reasons of a point, each "rule: value"
MIN_CLOSED_SHARE = 0.5  # closed share of the contact area in steady sliding
OPEN_RULE = f"the contact is closed over {MIN_CLOSED_SHARE:.0%} of its area or more, open share"
ALL_OPEN = f"{OPEN_RULE}: 1"
CLOSED_RULE = "a bilateral contact stays pressed, share of its area that lifts off"
# as results made before have it
OLD_CLOSED_RULE = (
    "a bilateral contact presses everywhere, share of it below 1 % of the mean pressure"
)


def validity_counts(points: pd.DataFrame) -> tuple[int, int, list[tuple[str, int]]]:
    """Points outside validity, points with results, and how many break each rule.

    Parameters
    ----------
    points : DataFrame
        A points table; one without the column ``valid`` has no such points.
    """
    if "valid" not in points:
        return 0, 0, []
    valid = points["valid"].astype("boolean")
    outside = points.loc[(~valid).fillna(False).to_numpy(bool), "invalid_reason"]
    return len(outside), int(valid.notna().sum()), rule_counts(outside)


def rule_counts(reasons: Iterable[str]) -> list[tuple[str, int]]:
    """Number of points with these reasons that break each rule, the most frequent first."""
    rules: dict[str, int] = {}
    for text in reasons:
        for rule in dict.fromkeys(part.partition(": ")[0] for part in str(text).split(BETWEEN)):
            rules[rule] = rules.get(rule, 0) + 1
    return sorted(rules.items(), key=lambda item: -item[1])


def broken_rules(rules: Iterable[tuple[str, int]]) -> str:
    """Rules that design points break, and how many do."""
    return "; ".join(f"{n} break{'s' * (n == 1)} '{rule}'" for rule, n in rules)


def outside_validity(points: pd.DataFrame, head: str = "") -> str:
    """How many design points break an assumption of the model or the method, and which."""
    outside, solved, rules = validity_counts(points)
    if not outside:
        return ""
    are = "is" if outside == 1 else "are"
    text = f"{head}{outside} of {solved} solved design point{'s' * (solved != 1)} {are} outside "
    text += "validity"
    return f"{text}: {broken_rules(rules)}"


def untouched_contact(points: pd.DataFrame) -> str:
    """At how many design points nothing is in contact, as a sentence; empty where none is so.

    Parameters
    ----------
    points : DataFrame
        A points table: of its reasons the open share of steady sliding is read.
    """
    outside, solved, _ = validity_counts(points)
    if not outside:
        return ""
    untouched = sum(ALL_OPEN in str(text).split(BETWEEN) for text in points["invalid_reason"])
    if not untouched:
        return ""
    return (
        f"In steady sliding the contact touches nowhere at {_where(untouched, solved, 'any of')}: "
        "no friction acts there. Look at gaps, at loads and at their directions."
    )


def pulling_rows(points: pd.DataFrame) -> np.ndarray:
    """Positions (m,) of the design points at which steady sliding pulls at a contact.

    Reasons of runs in time use the same words for a motion that pulls: there steady sliding pulls,
    too, if the words occur twice.
    """
    least = 2 if "class" in points else 1
    if "invalid_reason" not in points:
        return np.zeros(0, dtype=int)
    texts = points["invalid_reason"].astype(str)
    counts = [text.count(CLOSED_RULE) + text.count(OLD_CLOSED_RULE) for text in texts]
    return np.flatnonzero(np.array(counts, dtype=int) >= least)


def pulling_contact(points: pd.DataFrame, contacts: Sequence[str] = ()) -> str:
    """At how many design points steady sliding pulls at a contact, as a sentence; else empty.

    A law that pulls hides a gap, or a load that lifts: its contact rubs where there is none.

    Parameters
    ----------
    points : DataFrame
        A points table.
    contacts : sequence of str
        Contacts that pull at the first of these points, if the model has several.
    """
    outside, solved, _ = validity_counts(points)
    n_pulling = len(pulling_rows(points)) if outside else 0
    if not n_pulling:
        return ""
    which = f" ({', '.join(contacts)}{' at the first of them' * (n_pulling > 1)})"
    which *= bool(contacts)
    return (
        f"In steady sliding {'a' if contacts else 'the'} contact pulls at "
        f"{_where(n_pulling, solved, 'all')}{which}, where a real "
        "one is open: a gap, or a load that lifts. Its friction there is none of a brake; "
        'contact_law = "unilateral" in [model] lets it open.'
    )


def said_first(points: pd.DataFrame, contacts: Sequence[str] = ()) -> str:
    """Sentences on what makes all other answers doubtful; empty where nothing does.

    `contacts` are those of `pulling_contact`.
    """
    return " ".join(filter(None, (untouched_contact(points), pulling_contact(points, contacts))))


def _where(count: int, solved: int, whole: str) -> str:
    """`3 of 5 design points`, or of all of them."""
    if count < solved:
        return f"{count} of {solved} design points"
    return f"{whole} {solved} design points" if solved > 1 else "the design point"
