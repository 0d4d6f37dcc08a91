"""Screens of method-stability studies: outcomes, and how many are as predicted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from squealstudy.engine.kind_screen import KindScreen
from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    FAILED,
    RECOVERED,
    SLOW,
    WRONG,
)
from squealstudy.screen import facts
from squealstudy.wording import plural

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables
    from squealstudy.screen import Rows


RIGHT = (CONVERGED, SLOW, RECOVERED)  # outcomes of cells with a right result


class MethodStabilityScreen(KindScreen):
    """Where a method works, and where it fails."""

    tables = ("cells",)
    row_word = "cell"
    unfinished = False

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """The verdict, the knobs, the number of cells of each outcome, the predicted boundary."""
        manifest = results.manifest
        counts = manifest["counts"]
        outcomes = ", ".join(f"{k} {n}" for k, n in counts.items())
        outcomes += "; slow: right, but after many iterations" if counts.get(SLOW) else ""
        rows = [
            *_knobs(results),
            ("outcomes", outcomes),
            ("boundary", f"of theory: {manifest['boundary']}"),
        ]
        return [self.verdict(results), "", facts(rows)]

    def verdict(self, results: ResultTables) -> str:
        """How often the method is right, wrong without a warning, and as predicted."""
        manifest = results.manifest
        counts, n_silent, share = (manifest[k] for k in ("counts", "unflagged_wrong", "agreement"))
        right = sum(counts.get(outcome, 0) for outcome in RIGHT)
        n_others, helped = sum(counts.values()) - right, counts.get(RECOVERED, 0)
        title = str(manifest["title"])
        text = f"{title[:1].upper()}{title[1:]}: right in {right} of "
        text += plural(right + n_others, "cell")
        text += f", in {helped} of them thanks to a help that steps in." if helped else "."
        if n_others:
            warned = "and each says so" if n_others > 1 else "and says so"
            warned = f"{n_silent} of these without a warning" if n_silent else warned
            is_wrong, is_lost = counts.get(WRONG, 0) > 0, counts.get(FAILED, 0) > 0
            what = " or ".join(["is wrong"] * is_wrong + ["has no result"] * is_lost)
            text += f" In {n_others} it {what}, {warned}."
        cells = results.table("cells")
        flagged = cells.loc[cells["flagged"].to_numpy(bool), "outcome"]
        texts = [
            f"at {n} of those that are right{which if helped else ''}"
            for which, outcomes in (
                (" without help", (CONVERGED, SLOW)),
                (" with a help", (RECOVERED,)),
            )
            if (n := int(flagged.isin(outcomes).sum()))
        ]
        text += f" A warning also stands {' and '.join(texts)}." if texts else ""
        return text + _as_predicted(manifest, share, helped > 0) if share is not None else text


def _knobs(results: ResultTables) -> Rows:
    """A line for each axis of the map: range, number of values, meaning; then constant knobs."""
    cells, words = results.table("cells"), results.manifest["words"]
    rows = []
    for name in results.manifest["knobs"]:
        values, unit = cells[name], results.units.get(name, "")
        ends = dict.fromkeys(f"{end:.4g}" for end in (values.min(), values.max()))
        text = f"{' to '.join(ends)} {unit}".rstrip() + f", {plural(values.nunique(), 'value')}"
        rows.append((name, f"{text}: {words[name]}" if name in words else text))
    constant = ", ".join(
        f"{name} = {setting:g}" for name, setting in results.manifest.get("values", {}).items()
    )
    return [*rows, *([("constant", constant)] if constant else [])]


def _as_predicted(manifest: Mapping[str, Any], share: float, with_help: bool) -> str:
    """Sentence on how well theory predicts where the method is right."""
    judged, early = manifest["judged"], manifest.get("unpredicted_failures", 0)
    late = judged - round(share * judged) - early
    of = plural(judged, "cell")
    texts = [f" Of {of} that lie 2 % or more away from the boundary of theory "]
    texts[0] += f"{100 * share:.4g} % are as predicted"
    texts += ["those with a help count as predicted"] * with_help
    texts += [f"{late} {'is' if late == 1 else 'are'} right beyond it by themselves"] * bool(late)
    texts += [f"{early} {'is' if early == 1 else 'are'} not right within it"] * bool(early)
    return f"{'; '.join(texts)}."


SCREEN = MethodStabilityScreen()
