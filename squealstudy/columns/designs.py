"""The columns of tables of design searches: their definitions and errors."""

from __future__ import annotations

from squealstudy.columns.column import Tables, count, flag, number
from squealstudy.columns.everywhere import MAIN_COMPONENT, MODE, POINT

REDUCED = "The error of the reduced model; the proof checks designs at full order."
LEAST_DAMPING_COLUMNS = (
    number("min_damping_ratio", "Least damping ratio of a mode of the band.", leaves_out=REDUCED),
    number("frequency_hz", "Frequency of that mode.", leaves_out=REDUCED),
    MAIN_COMPONENT,
)
POINTS = (
    *POINT,
    count("design", "Number of the design; today's is 0."),
    number(
        "occurrence",
        "How often the operating point occurs, as a share of all.",
        leaves_out="It is given, not computed.",
    ),
    count("n_modes", "Modes of the band that oscillate; of runs in time, starts that were run."),
    count("n_unstable", "Unstable modes; of runs in time, starts that do not decay."),
    number("max_growth_rate", "Largest growth rate in the band.", leaves_out=REDUCED),
    *LEAST_DAMPING_COLUMNS,
    number(
        "missing_damping",
        "Damping ratio that must be added to silence vibration that lasts when kicked.",
        leaves_out="It is an estimate that the next round tries.",
    ),
)
DESIGNS = (
    count("design", "Number of the design; today's is 0."),
    count("round", "Round of the search that evaluated it."),
    number("cost", "Weighted change from today's design.", leaves_out="It is exact."),
    count("n_(points|failed|unstable)", "Operating points solved, failed, or with instability."),
    number(
        "unstable_share",
        "Share of the operating points, by how often they occur, with an unstable mode.",
        leaves_out=REDUCED,
    ),
    *LEAST_DAMPING_COLUMNS,
    number(
        "margin",
        "Least damping ratio at the solved operating points, less the one that is asked for.",
        leaves_out=REDUCED,
    ),
    flag("meets_margin", "Whether the design meets the demands; missing where too few are solved."),
)
MARGINS = (
    count("design", "Number of the design; today's is 0."),
    MODE,
    number("frequency_hz", "abs(lambda) / 2 pi of the mode's root.", leaves_out=REDUCED),
    number("growth_rate", "Real part of the mode's root.", leaves_out=REDUCED),
    number("damping_ratio", "Minus the real part of the root over its modulus.", "damping_error"),
    number(
        "damping_error",
        "Error of damping_ratio by the eigenvalue solver.",
        leaves_out="It is itself an error; that of the reduction is not in it.",
    ),
    MAIN_COMPONENT,
    number("main_share", "Share of its elastic energy there.", leaves_out=REDUCED),
    number(
        "pair_(first|second)_hz",
        "Frequencies of the two real modes that it is mostly made of.",
        leaves_out=REDUCED,
    ),
    number("pair_share", "Share of the mode that these two make up.", leaves_out=REDUCED),
    number(
        "damping_without_friction",
        "Damping ratio that it would have without the coupling by friction.",
        leaves_out="It is of the two real modes alone.",
    ),
)
SLOPES = (
    MODE,
    number(
        "d_(damping_ratio|growth_rate|frequency_hz)",
        "Derivative of this figure of the mode by the parameter.",
        leaves_out="It is of first order; steps of the search are tried by solving again.",
    ),
)
PROOF = (
    count("round", "Round of the search in which the check was made."),
    count("design", "Number of the design that was checked."),
    flag("passed", "Whether it passed; missing where that cannot be told."),
    count("n_points", "Design points that the check solved."),
    number(
        "value",
        "What the check found, as its text says.",
        leaves_out="Its meaning and its error are the check's: see text.",
    ),
)
VARIANTS = (
    count("n_operating_points", "Operating points at which the alternative was searched."),
    count("n_unstable", "Operating points among these with an unstable mode, after the change."),
    number(
        "today_damping_ratio",
        "Least damping ratio before the change.",
        leaves_out=REDUCED,
    ),
    *LEAST_DAMPING_COLUMNS[:2],
    number("change_cost", "Weighted change from the alternative's own start.", leaves_out="Exact."),
    number("cost", "change_cost plus the cost of choosing the alternative.", leaves_out="Exact."),
    count("n_designs", "Designs that were evaluated."),
)
VARIABLE = number(
    ".+",
    "Value of this variable of the design.",
    leaves_out="It is chosen by the search, not computed.",
)
DESIGN: Tables = {
    "points": POINTS,
    "designs": DESIGNS,
    "margins": MARGINS,
    "slopes": SLOPES,
    "proof": PROOF,
    "variants": VARIANTS,
}
