"""Colours that pictures and pages share."""

from __future__ import annotations

from squealstudy.wording import (
    CHANGING,
    GROWING,
    IF_KICKED,
    IRREGULAR,
    LIMIT_CYCLE,
    NEUTRAL,
    NO_CYCLE,
    SQUEALS,
    STABLE,
    UNDECIDED,
)

# by Okabe and Ito: colour-blind readers can tell them apart
COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F5F2A")
GREY = "#9A9A9A"
DARK = "#505050"
# fills of verdicts, with CIELAB distances of 20 or more in grey and for colour-blind readers
FILLS = {
    SQUEALS: "#C4500A",
    IF_KICKED: "#E89C1E",
    UNDECIDED: "#BDBDBD",
    NEUTRAL: "#8FB9E3",
    NO_CYCLE: "#F3F8F1",
}
RUN_FILLS = {  # fills of classes of runs in time, from the same five
    LIMIT_CYCLE: FILLS[SQUEALS],
    IRREGULAR: FILLS[IF_KICKED],
    GROWING: FILLS[NEUTRAL],
    UNDECIDED: FILLS[UNDECIDED],
    STABLE: FILLS[NO_CYCLE],
    CHANGING: DARK,
}
