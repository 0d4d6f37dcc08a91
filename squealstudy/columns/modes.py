"""The columns of tables of complex modes and sensitivities: their definitions and errors."""

from __future__ import annotations

from squealstudy.columns.column import Tables, count, flag, number, text
from squealstudy.columns.everywhere import ENERGY_SHARES, MAIN_COMPONENT, MODE, POINT

EXACT_CHECK = "It is itself an error, found by a sparse solution of the unreduced equations."
ROOT = (
    number(
        "frequency_hz",
        "abs(lambda) / 2 pi of the root lambda; Im lambda / 2 pi is sqrt(1 - damping_ratio^2) of "
        "it.",
        "error_estimate",
    ),
    number("growth_rate", "Real part of the root; above zero the mode grows.", "error_estimate"),
    number(
        "damping_ratio",
        "Minus the real part of the root over its modulus; its error is error_estimate over "
        "2 pi frequency_hz.",
        "error_estimate",
    ),
)
ERRORS = (
    number(
        "error_rung",
        "Estimated error of the root by the method of solution.",
        leaves_out="It is itself an error; missing where the method has no estimate.",
    ),
    number(
        "error_reduction",
        "Estimated error of the root by the component-mode model, against the unreduced one.",
        leaves_out="It is itself an error: an estimate from samples, carried to other points.",
    ),
    number(
        "error_estimate",
        "Sum of error_rung and error_reduction.",
        leaves_out="It is itself an error; that of the mesh and of the inputs is not in it.",
    ),
)
RESIDUAL = number(
    "residual",
    "Residual of the eigenvalue equation of the mode, relative.",
    leaves_out="It is itself an error, of the eigenvalue solver.",
)
MODES = (
    MODE,
    count("track", "Number of the mode as followed over design points; -1 where it is not."),
    number(
        "track_mac",
        "MAC of the mode's shape with that of its track at the neighbouring design point.",
        leaves_out="It measures likeness; track_ambiguous tells where it does not decide.",
    ),
    flag("track_ambiguous", "Whether another mode would continue the track about as well."),
    *ROOT,
    flag("unstable", "Whether the damping ratio is below minus the tolerance."),
    text("stability", "unstable, stable, or uncertain where growth is within its error."),
    flag("overdamped", "Whether the root is real: the mode does not oscillate."),
    RESIDUAL,
    *ERRORS,
    ENERGY_SHARES,
)
ONSETS = (
    count("track", "Number of the track that changes its stability here."),
    number("onset", "Value of the parameter at which the mode turns.", "error_estimate"),
    number(
        "bracket_(low|high)",
        "Values of the parameter between which the onset lies.",
        leaves_out="They are bounds.",
    ),
    number(
        "frequency_hz",
        "Modulus of the mode's root over 2 pi at the onset.",
        "error_estimate",
    ),
    number(
        "error_estimate",
        "Error of the onset, in the parameter's unit.",
        leaves_out="It is itself an error; that of the reduction and of the mesh is not in it.",
    ),
    count("evaluations", "Design points that were solved for the onset alone."),
)
COMPLEX_POINTS = (
    *POINT,
    count("n_modes", "Roots in the band at the design point, real ones included."),
    number(
        "n_unstable",
        "Modes of the band whose damping ratio is below minus the tolerance.",
        "n_unstable_low",
        "n_unstable_high",
    ),
    count("n_unstable_(low|high)", "Unstable modes without, or with, all that are uncertain."),
    count("n_overdamped", "Real roots in the band."),
    count(
        "n_unstable_(below|above)",
        "Unstable modes below, or above, the band; missing where none were sought.",
    ),
    number(
        "growth_outside",
        "Growth rate of the fastest of these modes.",
        leaves_out="The error of the reduced model, which is made for the band.",
    ),
    number(
        "frequency_outside_hz",
        "Frequency of that mode, |lambda|/2 pi; one that does not oscillate has one, too.",
        leaves_out="The error of the reduced model, which is made for the band.",
    ),
    number(
        "reference_(frequency|damping)_error",
        "Largest difference of a light mode to the unreduced model: relative frequency, or "
        "damping ratio.",
        leaves_out=EXACT_CHECK,
    ),
)
SENSITIVITIES = (
    MODE,
    *(
        number(c.name, c.definition, leaves_out="The error of the reduced model, and of the mesh.")
        for c in (
            number("frequency_hz", "abs(lambda) / 2 pi of the root."),
            number("growth_rate", "Real part of the root; above zero the mode grows."),
            number("damping_ratio", "Minus the real part of the root over its modulus."),
        )
    ),
    MAIN_COMPONENT,
    number(
        "condition",
        "How many times more sensitive to changes the root is than an isolated one.",
        leaves_out="It tells how far derivatives may be trusted, and needs no error.",
    ),
    RESIDUAL,
    number(
        "biorthogonality",
        "Largest product of the left vector with other right vectors, relative.",
        leaves_out="It is itself an error, of the left vector.",
    ),
    count("component_mode", "Number of the component mode that the parameter changes; 0: none."),
    number(
        "component_frequency_hz",
        "Free-free frequency of that component mode, with the scale in force.",
        leaves_out="The error of the mesh.",
    ),
    number("value", "Value of the parameter.", leaves_out="It is given, not computed."),
    number(
        r"d_(growth_rate|frequency_hz|damping_ratio)",
        "Derivative of this figure of the mode by the parameter.",
        "disagreement",
        "validity_range",
    ),
    number(
        r"(growth|frequency|damping)_per_percent",
        "What a hundredth of the parameter's reference changes, to first order.",
        "disagreement",
        "validity_range",
    ),
    number("change", "Finite change that is made.", leaves_out="It is chosen, not computed."),
    number(
        r"predicted_(growth|frequency|damping)_change",
        "What the derivative predicts for the finite change.",
        "disagreement",
    ),
    number(
        r"finite_(growth|frequency|damping)_change",
        "What the finite change does, by solving again.",
        leaves_out="The error of the reduced model; match tells whether it is the same mode.",
    ),
    number(
        "disagreement",
        "Difference of predicted and finite change of the root, relative to the latter.",
        leaves_out="It is itself an error, of the derivative over the finite change.",
    ),
    number(
        "match",
        "Likeness of the mode before and after the finite change, 1 for the same.",
        leaves_out="It tells how far finite changes may be trusted.",
    ),
    number(
        "validity_range",
        "Change of the parameter at which the second order is a quarter of the first.",
        leaves_out="It is an estimate from the nearest modes, and a range itself.",
    ),
    flag(
        "near_coalescence",
        "Whether modes merge so near that the derivative does not hold over the finite change.",
    ),
)
SENSITIVITY_POINTS = (
    *POINT,
    count("n_modes", "Modes that have sensitivities."),
    number(
        "max_growth_rate",
        "Largest growth rate of these modes.",
        leaves_out="The error of the reduced model.",
    ),
)
COMPLEX_MODES: Tables = {"points": COMPLEX_POINTS, "modes": MODES, "onsets": ONSETS}
SENSITIVITY: Tables = {"points": SENSITIVITY_POINTS, "sensitivities": SENSITIVITIES}
