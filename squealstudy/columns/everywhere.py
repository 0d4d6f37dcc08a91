"""Columns that mean the same in the tables of several kinds of study."""

from __future__ import annotations

from squealstudy.columns.column import count, flag, number, text

OF_SAME_MODEL = "It is exact for the model as it is computed; the model's own error is not in it."
HEAD = (
    text("point_id", "Id of the design point: a hash of all that its row depends on."),
    text("status", "ok, or why the row has no results."),
    text("message", "What went wrong or was noted, in words."),
    number(
        "wall_s",
        "Time by the clock that the row took.",
        leaves_out="What rows share (models, bases) is not in it, and the machine's load is.",
    ),
)
WORKING_POINT = (
    number(
        "working_point_residual",
        "Largest imbalance of a gap in steady sliding, over the largest gap plus its movement.",
        leaves_out="It is itself an error, of the static solution.",
    ),
    number(
        "open_share",
        "Share of the contact area that is open in steady sliding.",
        leaves_out="The error of the static solution, which working_point_residual tells, and of "
        "the mesh.",
    ),
    number(
        "contact_pressure_(min|max)",
        "Least or largest contact pressure of all contact points in steady sliding.",
        leaves_out="The error of the static solution, which working_point_residual tells, and of "
        "the mesh: edges press the harder the finer it is.",
    ),
)
VALIDITY = (
    flag("valid", "Whether all assumptions of the method hold; missing without results."),
    text("invalid_reason", "Which assumptions do not hold, and by how much."),
)
POINT = (*HEAD, *WORKING_POINT, *VALIDITY)
MODE = count("mode", "Number of the mode at its design point, by frequency, from 1.")
MAIN_COMPONENT = text("main_component", "Component with the largest share of elastic energy.")
ENERGY_SHARES = number(
    r"energy_\w+",
    "Share of the mode's elastic energy in this component, or in the interfaces.",
    leaves_out="The error of the mode's shape, which is not estimated.",
)
