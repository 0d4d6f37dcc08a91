"""What is shown of method-stability studies: outcomes, and how far they are as predicted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import RenderableType

from squealstudy.engine.kind_screen import KindScreen
from squealstudy.screen import facts

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables


class MethodStabilityScreen(KindScreen):
    """Where a method works, and where it fails."""

    tables = ("cells",)
    row_word = "cell"
    unfinished = False

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """Outcomes, how many cells are as predicted, and the cells that nothing warns of."""
        manifest = results.manifest
        share, silent = manifest["agreement"], manifest["unflagged_wrong"]
        agreed = "-" if share is None else f"{100 * share:.2f} % of {manifest['judged']}"
        rows = [
            ("case", manifest["title"]),
            ("boundary", manifest["boundary"]),
            ("outcomes", ", ".join(f"{k} {n}" for k, n in manifest["counts"].items())),
            ("as predicted", f"{agreed} cells that are 2 % or more away from the boundary"),
            ("wrong, unflagged", str(silent) if silent else "none"),
        ]
        return [facts(rows)]


SCREEN = MethodStabilityScreen()
