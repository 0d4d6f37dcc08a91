"""What `run` and `check` say of the settings that [fidelity] chose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def facts(found: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """The choice with its cost and error, its neighbours, and the audit; nothing without one."""
    if found is None:
        return []
    rows = [("fidelity", f"{_setting(found['chosen'])}: {found['reason']}")]
    rows += [(f"  next {name}", _setting(found[name])) for name in ("cheaper", "dearer")]
    audit = found.get("audit")
    if audit is not None and audit["error"] is not None:
        verdict = "passed" if audit["passed"] else "MISSED"
        points = len(audit["points"])
        rows.append(
            (
                "  audit",
                f"{verdict}: error {audit['error']:.1e} of {found['tolerance']:g} allowed, at "
                f"{points} random point{'' if points == 1 else 's'} against {audit['against']}",
            )
        )
    return rows


def _setting(one: Mapping[str, Any]) -> str:
    seconds = one["seconds"]
    if seconds is None:
        return f"{one['settings']}: {one['reason']}" if one["settings"] else one["reason"]
    time = f"{seconds:.3g} s" if seconds < 120 else f"{seconds / 60:.3g} min"
    return f"{one['settings']}; estimated error {one['estimated_error']:.1e}, about {time}"
