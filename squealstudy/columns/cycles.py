"""The columns of tables of limit cycles: their definitions and errors."""

from __future__ import annotations

from squealstudy.columns.column import LISTS, Column, Tables, count, flag, number, same_in, text
from squealstudy.columns.everywhere import POINT

SERIES = "It has the error of the series, which level_error tells for the torque's RMS."
PEAK = "It is a peak, to which a series converges more slowly: see velocity_error."
BALANCE = "It is itself an error: what the balance of harmonics leaves."
NOT_BOUNDED = "The error of the series and of the basis; it is not bounded here."
LEVEL = (
    number(
        "torque_rms",
        "RMS of the torque about its mean, of the loudest found: stable cycle or lasting run.",
        "level_error",
        "regularisation_error",
    ),
    number(
        "regularisation_error",
        "Relative change of torque_rms that friction without a corner at zero sliding would make.",
        leaves_out="It is itself an error, estimated; missing where it is not known.",
    ),
    number(
        "level_error",
        "Relative error of torque_rms.",
        leaves_out="It is itself an error; that of the model and of its mesh is not in it.",
    ),
    number(
        "torque_line_hz",
        "Frequency of the strongest line of that motion's torque.",
        leaves_out="It is a multiple of the motion's frequency, whose error it has.",
    ),
)
THRESHOLD = (
    number(
        "threshold_velocity",
        "Contact velocity of the unstable cycle, which a kick along it must exceed.",
        "threshold_error",
    ),
    number(
        "threshold_share",
        "threshold_velocity over the contact velocity of the stable cycle.",
        leaves_out="The errors of both velocities.",
    ),
)
POINTS = (
    *POINT,
    text("verdict", "squeals, squeals_if_kicked, undecided, neutral or no_cycle_found."),
    text("reason", "Why, in words."),
    count(
        "n_families", "Modes with a verdict: followed over amplitude, or unstable and not followed."
    ),
    count("n_left_out", "Modes of the band that were not followed."),
    flag("unstable_outside", "Whether a mode outside the band grows."),
    count("n_unstable", "Unstable modes among those with a verdict."),
    count("n_cycles", "Different cycles that were found, unstable ones included."),
    number(
        "max_growth_rate",
        "Largest growth rate of the modes with a verdict.",
        leaves_out="The error of the reduced model.",
    ),
    *LEVEL,
    number(
        "frequency_hz",
        "Frequency of that motion: its fundamental.",
        "frequency_error",
    ),
    number(
        "frequency_error",
        "Relative error of frequency_hz.",
        leaves_out="It is itself an error; that of the model and of its mesh is not in it.",
    ),
    number(
        "threshold_velocity",
        "Least contact velocity of an unstable cycle, which a kick along it must exceed.",
        leaves_out="Kicks of other shapes, which may need less; threshold_error of the verdict.",
    ),
    THRESHOLD[1],
)
VERDICTS = (
    count("mode", "Number of the mode in the band, by frequency, from 1."),
    number(
        "frequency_hz",
        "Modulus of its root over 2 pi, of small motion.",
        leaves_out="The error of the reduced model.",
    ),
    number(
        "growth_rate",
        "Real part of the root of small motion along the mode.",
        leaves_out="The error of the reduced model.",
    ),
    number(
        "damping_ratio",
        "Damping ratio of small motion along the mode.",
        leaves_out="The error of the reduced model.",
    ),
    flag("unstable", "Whether small motion grows."),
    text("verdict", "As in points, of this mode alone."),
    count("n_cycles", "Cycles on its curve."),
    count("n_lost", "Zeros of its curve that more harmonics did not confirm."),
    number(
        "reached_velocity",
        "Largest contact velocity of its curve.",
        leaves_out="It tells how far the curve was followed.",
    ),
    *LEVEL,
    number(
        "cycle_frequency_hz",
        "Frequency of the motion whose level is told: its fundamental.",
        "cycle_frequency_error",
    ),
    number(
        "cycle_frequency_error",
        "Relative error of cycle_frequency_hz.",
        leaves_out="It is itself an error; that of the model and of its mesh is not in it.",
    ),
    *THRESHOLD,
    number(
        "threshold_error",
        "Relative error of threshold_velocity.",
        leaves_out="It is itself an error.",
    ),
    number(
        "threshold_energy",
        "Mean energy of the unstable cycle.",
        leaves_out="Twice the relative error of its velocity, about.",
    ),
    number(
        "kick_velocity",
        "Contact velocity of the least kick along the mode, of eight phases, that leads to a "
        "lasting motion.",
        "kick_error",
    ),
    number("kick_phase", "Phase of the mode at that kick.", leaves_out="One of eight were tried."),
    number("kick_energy", "Energy of that kick.", "kick_error"),
    number(
        "kick_error",
        "Relative width of the bracket of kick_velocity.",
        leaves_out="It is itself an error; that of the phases between the eight is not in it.",
    ),
)
OF_A_CYCLE = (
    number("frequency_hz", "Its frequency.", "frequency_error"),
    number("torque_rms", "RMS of its torque about the mean.", "level_error"),
    number(
        "contact_velocity",
        "Largest relative velocity of a contact point over the period, steady sliding off.",
        "velocity_error",
    ),
    number("torque_mean", "Mean of its torque.", leaves_out=SERIES),
    number("torque_peak", "Largest distance of its torque from the mean.", "torque_peak_error"),
    number("normal_force_rms", "RMS of the normal force about its mean.", leaves_out=SERIES),
    number(
        "energy",
        "Mean of kinetic energy and that in the reference stiffness.",
        leaves_out=SERIES,
    ),
    number(
        "friction_power",
        "Mean power that friction dissipates, and dampers of third power.",
        leaves_out=SERIES,
    ),
    number("damping_power", "Mean power that damping dissipates.", leaves_out=SERIES),
    number("belt_power", "Mean power of the imposed sliding.", leaves_out=SERIES),
    number("radiated_power", "Equivalent power that surfaces radiate.", leaves_out=SERIES),
    number(
        "power_imbalance",
        "Power put in and not dissipated, over damping_power or the power beyond steady sliding's.",
        leaves_out="It is itself an error, of the balance.",
    ),
    number(
        "stick_share",
        "Share of contact area and period in which contact sticks. "
        "Contacts without friction, and with a state, count in no share.",
        leaves_out=NOT_BOUNDED,
    ),
    number(
        "open_share",
        "Share of contact area and period in which the pressure is below a hundredth of the "
        "mean of the design point's own steady sliding.",
        leaves_out=NOT_BOUNDED,
    ),
    number(
        "(stick|open)_share_max",
        "Largest share of the contact area in that state at once.",
        leaves_out=NOT_BOUNDED,
    ),
)
STABLE = (
    flag("stable", "Whether motions near it come to it; missing where that is not known."),
    count("n_unstable", "Floquet multipliers outside the unit circle by more than they err."),
    number("multiplier", "Modulus of the Floquet multiplier that decides.", "multiplier_error"),
    number("multiplier_error", "Error of multiplier.", leaves_out="It is itself an error."),
)
N_HARMONICS = count("n_harmonics", "Harmonics of its series.")
TAIL = number(
    "harmonic_tail",
    "Share of the last harmonics in the series.",
    leaves_out="It is itself a measure of error, of the series.",
)
BASIS_ERROR = number(
    "basis_error",
    "Relative error of the level by the basis of a projected model.",
    leaves_out="It is itself an error.",
)
RESIDUAL = number("balance_residual", "Imbalance of the harmonics, relative.", leaves_out=BALANCE)
CYCLES = (
    count("mode", "Number of the mode that led to it."),
    *OF_A_CYCLE,
    *same_in(LEVEL, "torque_line_hz"),
    number(
        "growth_rate",
        "Growth of the deviation that decays most slowly, or grows, from the multiplier.",
        "multiplier_error",
    ),
    *STABLE,
    N_HARMONICS,
    TAIL,
    BASIS_ERROR,
    RESIDUAL,
    Column(
        "torque_harmonics",
        "Amplitudes of its torque's harmonics, from the first on.",
        leaves_out=SERIES,
        holds=LISTS,
    ),
    number(
        "(level|velocity|torque_peak|frequency)_error",
        "Relative error of torque_rms, contact_velocity, torque_peak or frequency_hz.",
        leaves_out="It is itself an error, from other harmonics and samples; regularisation is not "
        "in it.",
    ),
    count("n_vectors", "Size of the basis on which it was balanced."),
)
ALONG = (
    count("n_step", "Number of the point on the curve."),
    number(
        "contact_velocity",
        "Largest relative velocity of a contact point, steady sliding off.",
        leaves_out=PEAK,
    ),
    number("frequency_hz", "Frequency of the motion.", leaves_out=NOT_BOUNDED),
    RESIDUAL,
)
ALONG_RMS = number("torque_rms", "RMS of its torque about the mean.", leaves_out=NOT_BOUNDED)
CURVES = (
    count("mode", "Number of the mode whose curve it is."),
    *ALONG,
    number(
        "added_damping",
        "Damping that must be added for the motion to be periodic; below zero it grows.",
        "balance_residual",
    ),
    BASIS_ERROR,
)
BRANCHES = (
    count("mode", "Number of the mode whose cycle the branch begins with."),
    *ALONG,
    *same_in(OF_A_CYCLE, "torque_rms"),
    number(
        "level_error",
        "Relative error of torque_rms; missing at Hopf points, of projected models, and where "
        "more harmonics do not converge.",
        leaves_out="It is itself an error, from other harmonics and samples; regularisation is not "
        "in it.",
    ),
    number("value", "Value of the parameter along which the branch goes.", "value_error"),
    number(
        "value_error",
        "Error of value at an event; missing where it is not known.",
        leaves_out="It is itself an error.",
    ),
    number(
        "open_share_max",
        "Largest share of the contact area that is open at once.",
        leaves_out=NOT_BOUNDED,
    ),
    *STABLE,
    N_HARMONICS,
    TAIL,
    BASIS_ERROR,
)
BORDERS = (
    *ALONG,
    ALONG_RMS,
    number(
        "value",
        "Value of the first parameter on the border.",
        "line_difference",
    ),
    number(
        "over_value",
        "Value of the second parameter on the border.",
        leaves_out="It is chosen.",
    ),
    number(
        "line_difference",
        "Value of the border less that of the branch which meets it.",
        leaves_out="It is itself an error.",
    ),
    N_HARMONICS,
)
VELOCITIES = (
    count("mode", "Number of the mode that led to the cycle."),
    number(
        "velocity_(rms|peak)",
        "RMS, or largest, velocity of the named point over the period.",
        leaves_out=SERIES,
    ),
    number(
        "distance",
        "Distance of the named place from the nearest node.",
        leaves_out="It is exact.",
    ),
)
LIMIT_CYCLES: Tables = {
    "points": POINTS,
    "verdicts": VERDICTS,
    "cycles": CYCLES,
    "curves": CURVES,
    "branches": BRANCHES,
    "borders": BORDERS,
    "velocities": VELOCITIES,
}
