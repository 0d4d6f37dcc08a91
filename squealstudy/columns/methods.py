"""The columns of tables of studies that measure methods: their definitions and errors."""

from __future__ import annotations

from squealstudy.columns.column import Tables, count, number, text

TIME_SCATTER = "The scatter of a loaded machine: see seconds_min and seconds_max."
CPU_SECONDS = "Seconds of the processor"
MEASUREMENTS = (
    number("number", "Value of the varied setting, where it is a number.",
           leaves_out="It is given."),
    number("seconds_median", f"{CPU_SECONDS} a design point, median of the rounds.",
           "seconds_min", "seconds_max"),
    number("seconds_(min|max)", "Least, or largest, of the rounds.", leaves_out="It is a bound."),
    count("rounds", "How often it was measured."),
    number("setup_seconds", f"{CPU_SECONDS} for what design points share.",
           leaves_out=TIME_SCATTER),
    number("reduction_seconds", f"{CPU_SECONDS} for reductions.", leaves_out=TIME_SCATTER),
    number("cost", "seconds_median with the design point's share of the set-up.",
           leaves_out=TIME_SCATTER),
    number("onset_seconds", f"{CPU_SECONDS} for one onset.", leaves_out=TIME_SCATTER),
    number("cost_onset", "onset_seconds with its share of the set-up.", leaves_out=TIME_SCATTER),
    number("memory_mb", "Largest memory while it ran, above that before.",
           leaves_out="What other processes do at the same time."),
    number("iterations", "Evaluations of contact forces a step.", leaves_out="It is counted."),
    count("n_coordinates", "Coordinates of the model; degrees of freedom at full order."),
    count("n_failed", "Design points without a result."),
    count("missed|spurious", "Unstable modes of the reference that were missed, or made up."),
    number(r"error_\w+", "Largest error against the reference: relative, but of ratios.",
           leaves_out="That of the reference; low_ and high_ columns of the quantity bound it."),
    number(r"(low|high)_\w+", "Bound of the largest error.", leaves_out="It is a bound."),
    number(r"median_\w+", "Median error of this quantity.", leaves_out="That of the reference."),
    number(r"chance_\w+", "Part of the largest error that the intervals of both explain.",
           leaves_out="It is made of bounds."),
)  # fmt: skip
ERRORS = (
    count("point", "Measured design point."),
    count("mode", "Number of the mode; 0 where the quantity is of the run."),
    number("value", "Result of the method.", "error"),
    number("truth", "Result of the reference.", leaves_out="Its own error."),
    number("error", "Difference of both; relative, except of shares and ratios.", "low", "high"),
    number("low|high", "Bound of the error.", leaves_out="It is a bound."),
    number(
        "chance",
        "Part of the error that the intervals of both results explain.",
        leaves_out="It is made of bounds.",
    ),
)
CELLS = (
    number(
        "predicted",
        "A number of the theory: the method is predicted to work where it is below 1.",
        leaves_out="Limits of the theory.",
    ),
    number(
        "measured", "A measured number, as the case defines it.", leaves_out="It is not estimated."
    ),
    number(
        "error",
        "Error of the method's result, as the case defines it.",
        leaves_out="That of the reference.",
    ),
    number("cost", "Iterations, evaluations or points that it took.", leaves_out="It is counted."),
)
COMMON = (
    text("status", "ok, or why there is no result."),
    number("wall_s", "Time by the clock that the row took.", leaves_out="The machine's load."),
)
WORK_PRECISION: Tables = {"measurements": (*COMMON[:1], *MEASUREMENTS), "errors": ERRORS}
METHOD_STABILITY: Tables = {"cells": (*COMMON, *CELLS)}
