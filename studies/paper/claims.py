"""Claims of Vermot des Roches et al. 2010, each with what answers it on the coarse brake.

A claim is held against one setting of damping at a time; no number is written by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from found import DAMPING, SCALE, Answer, Found
from in_modes import (
    handed_on,
    most_sensitive,
    parts_of_the_mode,
    several_unstable,
    silent_by_group_damping,
    small_and_exact,
    target_stabilised,
)
from in_time import (
    another_takes_over,
    group_threshold,
    grows_and_saturates,
    handed_on_in_time,
    more_than_there_are,
    not_linear,
    quieter_not_silent,
    robust_to_the_start,
    same_shape,
)


@dataclass(frozen=True)
class Claim:
    """What is said in a figure of VdR 2010, and how that is looked up here."""

    figure: str
    text: str
    answer: Callable[[Found], Answer]


CLAIMS = (
    Claim("5", "At 12 bar the brake has several unstable modes.", several_unstable),
    Claim(
        "6",
        "The first of them, C44, is an interaction of disc, outer pad and caliper.",
        parts_of_the_mode,
    ),
    Claim("7", "Its growth is most sensitive to the modes of the caliper.", most_sensitive),
    Claim(
        "8, left",
        "Shifting caliper mode 13 alone can stabilise it ...",
        target_stabilised(SCALE, False, True),
    ),
    Claim("8, left", "... and hands the instability on to C42.", handed_on(SCALE, False, True)),
    Claim(
        "8, right",
        "Shifting modes 12 to 14 together does not fully stabilise it ...",
        target_stabilised(SCALE, True, False),
    ),
    Claim("8, right", "... and does not hand the instability on.", handed_on(SCALE, True, False)),
    Claim("9", "Damping mode 13 alone destabilises C42.", handed_on(DAMPING, False, True)),
    Claim(
        "10",
        "Damping modes 12 to 14 makes the brake stable from a level on.",
        silent_by_group_damping,
    ),
    Claim("11", "The torque diverges exponentially, then stays bounded.", grows_and_saturates),
    Claim("11", "The cycle does not depend on the start.", robust_to_the_start),
    Claim("section 3.2", "The cycle is not linear.", not_linear),
    Claim(
        "introduction",
        "Complex modes find more instabilities than there are.",
        more_than_there_are,
    ),
    Claim(
        "12, 13",
        "A caliper mode projected on the basis in time keeps its shape (MAC 1), with residual "
        "displacements on the outer pad.",
        same_shape,
    ),
    Claim(
        "14, above",
        "A little damping of mode 13 alone leads to another, quieter cycle.",
        quieter_not_silent,
    ),
    Claim("15", "More of it hands the instability on to another mode.", handed_on_in_time),
    Claim(
        "14, below; 16",
        "Damping modes 12 to 14 dissipates the energy of C44 from a threshold on ...",
        group_threshold,
    ),
    Claim("16", "... and another mode, C51, takes over.", another_takes_over),
    Claim("section 1.2", "The reduced model has the dynamics of the full one.", small_and_exact),
)


def compared(found: Mapping[str, Found]) -> list[tuple[Claim, dict[str, Answer]]]:
    """Each claim with its answer in every setting."""
    return [(claim, {name: claim.answer(one) for name, one in found.items()}) for claim in CLAIMS]
