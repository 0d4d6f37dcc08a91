"""Texts on modes that grow outside a study's band, for screens and reports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from squealstudy.root_pairs import RIGID_SHARE
from squealstudy.wording import amount, in_digits, plural


def outside_text(manifest: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """One line on what grows outside the band, and where that was sought; empty for old results."""
    facts = manifest.get("outside_band")
    if not facts:
        return ""
    low, high = manifest["band_hz"]
    if not facts["looked"]:
        below = f"below {low:g} or " if low > 0 else ""
        return f"no modes were sought {below}above {high:g} Hz"
    parts = _growing(facts, manifest, units)
    where = f"{plural(facts['looked'], 'design point')} of {manifest.get('n_points', 0):,}"
    reach = facts["reach_hz"]
    beyond = f"; none were sought above {reach:g} Hz" if reach else ""
    if parts:
        return f"{'; '.join(parts)} (looked for at {where}){beyond}"
    least = RIGID_SHARE * high  # slower motion counts as that of a free body
    below = f"from {least:.2g} to {low:g} Hz or " if low > least else ""
    slower = "" if low > 0 else f"; no motion was sought below {least:.2g} Hz"
    return f"nothing grows {below}{_above(facts, high)} at {where}{beyond}{slower}"


def grows_outside(manifest: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """A sentence on what grows outside the band; empty where nothing is known to."""
    facts = manifest.get("outside_band")
    parts = _growing(facts, manifest, units) if facts else []
    text = f" Outside the band {'; '.join(parts)}." if parts else ""
    return text + (_divergence(facts, units) if facts else "")


def _divergence(facts: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """A sentence on where real roots grow, whatever the band; empty if it holds all of them."""
    diverging = facts.get("diverging")
    if not diverging:
        return ""
    ranges = ", ".join(
        f"{name} {amount(low, units.get(name, ''))}"
        + (f" to {amount(high, units.get(name, ''))}" if high > low else "")
        for name, (low, high) in diverging["ranges"].items()
    )
    where = f", within {ranges}" if ranges else ""
    return (
        f" In or outside the band it diverges, without oscillation, at {diverging['points']:,} of "
        f"{plural(facts['looked'], 'design point')} looked at{where}."
    )


def _growing(
    facts: Mapping[str, Any], manifest: Mapping[str, Any], units: Mapping[str, str]
) -> list[str]:
    """Texts on modes that grow below and above the band."""
    low, high = manifest["band_hz"]
    every = facts["looked"] == manifest.get("n_points")
    of = "" if every else " of the points looked at"
    sides = [
        ("below", f"below {low:g} Hz"),
        ("above", _above(facts, high)),
    ]
    return [_side(text, facts[side], units, of) for side, text in sides if facts[side]]


def _above(facts: Mapping[str, Any], high: float) -> str:
    """The range above the band, in words."""
    reach = facts["reach_hz"]
    return f"from {high:g} to {reach:g} Hz" if reach else f"above {high:g} Hz"


def _side(text: str, worst: Mapping[str, Any], units: Mapping[str, str], of: str) -> str:
    """Text on one side of the band: how many modes grow at the worst point, and the fastest."""
    settings = ", ".join(f"{n} {amount(v, units.get(n, ''))}" for n, v in worst["at"].items())
    setting_text = f" at {settings}, where growth is largest{of}" if settings else ""
    grow = "grow" if worst["count"] > 1 else "grows"
    fastest = "the fastest " if worst["count"] > 1 else ""
    how = f"{in_digits(worst['frequency_hz'])} Hz"
    how = how if worst.get("oscillates", True) else "without oscillation"
    return (
        f"{text} {plural(worst['count'], 'mode')} {grow}{setting_text}: {fastest}{how}, "
        f"{worst['growth_rate']:.3g} 1/s"
    )
