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
        share, n_silent = manifest["agreement"], manifest["unflagged_wrong"]
        agreed = "-" if share is None else f"{100 * share:.2f} % of {manifest['judged']}"
        rows = [
            ("case", manifest["title"]),
            ("boundary", manifest["boundary"]),
            ("outcomes", ", ".join(f"{k} {n}" for k, n in manifest["counts"].items())),
            ("as predicted", f"{agreed} cells that are 2 % or more away from the boundary"),
            ("wrong, unflagged", str(n_silent) if n_silent else "none"),
        ]
        return [self.verdict(results), "", facts(rows)]

    def verdict(self, results: ResultTables) -> str:
        """How often the method is right, and whether it warns where it is not."""
        manifest = results.manifest
        counts, n_silent, share = (manifest[k] for k in ("counts", "unflagged_wrong", "agreement"))
        right = sum(counts.get(outcome, 0) for outcome in RIGHT)
        n_others = sum(counts.values()) - right
        text = f"The method is right in {right} of {plural(right + n_others, 'cell')}"
        if n_others:
            warned = f"{n_silent} of these without a word" if n_silent else "and says so each time"
            text += f"; in {n_others} it is wrong or fails, {warned}"
        if share is None:
            return f"{text}."
        return f"{text}. {100 * share:.0f} % of the cells off the boundary are as predicted."


SCREEN = MethodStabilityScreen()
