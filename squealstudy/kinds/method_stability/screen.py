"""Screens of method-stability studies: outcomes, and how many are as predicted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import RenderableType

from squealstudy.engine.kind_screen import KindScreen
from squealstudy.laboratory.method_stability.contract import CONVERGED, RECOVERED, SLOW
from squealstudy.screen import facts
from squealstudy.wording import plural

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables


RIGHT = (CONVERGED, SLOW, RECOVERED)  # outcomes of cells with a right answer


class MethodStabilityScreen(KindScreen):
    """Where a method works, and where it fails."""

    tables = ("cells",)
    row_word = "cell"
    unfinished = False

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """Outcomes, how many cells are as predicted, and how many are wrong without a warning."""
        manifest = results.manifest
        rows = [
            ("outcomes", ", ".join(f"{k} {n}" for k, n in manifest["counts"].items())),
            ("boundary", f"{manifest['boundary']}, as predicted"),
        ]
        return [self.verdict(results), "", facts(rows)]

    def verdict(self, results: ResultTables) -> str:
        """How often the method is right, whether it warns where it is not, and the prediction."""
        manifest = results.manifest
        counts, n_silent, share = (manifest[k] for k in ("counts", "unflagged_wrong", "agreement"))
        right = sum(counts.get(outcome, 0) for outcome in RIGHT)
        n_others, helped = sum(counts.values()) - right, counts.get(RECOVERED, 0)
        title = str(manifest["title"])
        text = f"{title[:1].upper()}{title[1:]}: right in {right} of "
        text += plural(right + n_others, "cell")
        text += f", {helped} of them by a help that steps in" if helped else ""
        if n_others:
            warned = f"{n_silent} of these without a word" if n_silent else "and says so each time"
            text += f"; in {n_others} it is wrong or fails, {warned}"
        cells = results.table("cells")
        flagged = cells["outcome"].isin((CONVERGED, SLOW)) & cells["flagged"].astype(bool)
        if n_flagged := int(flagged.sum()):
            are = "is" if n_flagged == 1 else "are"
            text += f"; of the right ones {n_flagged} {are} flagged, too"
        if share is None:
            return f"{text}."
        judged, early = manifest["judged"], manifest.get("unpredicted_failures", 0)
        late = judged - round(share * judged) - early
        text += f". {100 * share:.4g} % of {plural(judged, 'cell')} that are 2 % or more "
        text += "away from the predicted boundary are as predicted"
        others = f"in {late} it is right beyond the boundary" if late else ""
        others += " and " * bool(late and early)
        others += f"in {early} it is not right within it" if early else ""
        return f"{text}{'; ' * bool(others)}{others}."


SCREEN = MethodStabilityScreen()
