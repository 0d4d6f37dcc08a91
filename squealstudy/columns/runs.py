"""The columns of tables of runs in time: their definitions and errors."""

from __future__ import annotations

from squealstudy.columns.column import Column, Tables, count, flag, number, text
from squealstudy.columns.everywhere import ENERGY_SHARES, HEAD, VALIDITY

STEPS = "It tells how the integration went, and needs no error."
BASIS = "The error of the basis, where modes were left out."
STEPPED = "The step's error."
OF_ITS_TIME = "The step's error; motion that has not settled has another share later: see settled."
AT_ROWS = "The step's error; it is of this instant alone."


def bounded(name: str, definition: str) -> tuple[Column, Column]:
    """A level with columns of its bounds."""
    return (
        number(name, definition, f"{name}_low", f"{name}_high"),
        number(rf"{name}_(low|high)", f"Bound of {name}.", leaves_out="It is a bound."),
    )


FORECAST = (
    count("n_unstable", "Predicted unstable modes in the band."),
    count("n_unstable_(above|below)", "Predicted unstable modes above, or below, the band."),
    number(
        "predicted_frequency_hz",
        "Modulus of the root, over 2 pi, of the fastest growing mode of the linearised run.",
        leaves_out=BASIS,
    ),
    number(
        "predicted_growth_rate",
        "Growth rate of the fastest growing mode of the linearised run.",
        leaves_out=BASIS,
    ),
)
GROWTH_OF_POINT = (
    number(
        "growth_rate",
        "Growth of small motion as fitted to the run; growth_method says how, or why not.",
        "growth_rate_low",
        "growth_rate_high",
        "growth_rate_step_error",
    ),
    number("growth_rate_(low|high)", "Bound of growth_rate.", leaves_out="It is a bound."),
    number(
        "growth_rate_step_error",
        "By how much the fastest mode grows too fast at the run's step; part of the bounds.",
        leaves_out="It is itself an error.",
    ),
    number(
        "onset_time",
        "When the fitted exponential reaches a tenth of the final amplitude.",
        leaves_out="The fit's error, which the bounds of growth_rate tell.",
    ),
    number(
        "undecided_until",
        "Duration that would decide an undecided run; infinite where none up to 100 times as long "
        "is known to.",
        leaves_out="It is an estimate without an error.",
    ),
    flag(
        "settled",
        "Whether the levels of the judged part of the run agree, and their RMS is known to 5 %.",
    ),
    number(
        "settled_time",
        "Earliest time from which levels are those of the end.",
        leaves_out="It is as coarse as the windows in which levels are compared.",
    ),
)
LEVELS = (
    number(
        "torque_static",
        "Torque of friction in steady sliding.",
        leaves_out="The error of the static solution and of the mesh.",
    ),
    *bounded("torque_mean", "Mean of the torque over the judged part of the run."),
    *bounded("torque_rms", "RMS of the torque about its mean over the judged part of the run."),
    number(
        "torque_rms_(window|step|rows)",
        "Part of the half width of torque_rms' bounds: by scatter, by the step, by rows.",
        leaves_out="It is itself an error.",
    ),
    *bounded("torque_peak_to_peak", "Largest less least torque over the judged part of the run."),
    Column("bounds_reason", "Why bounds of levels are missing, or which part they leave out."),
    number(
        "swing_spread",
        "Difference of the peak-to-peak values of single periods, over their mean.",
        leaves_out="It is of the periods of the judged part alone.",
    ),
    number(
        "frequency_hz",
        "The motion's own frequency: its fundamental, after one period of which it repeats.",
        "frequency_error",
    ),
    number(
        "frequency_error",
        "Relative error of frequency_hz, by what is left after a period and by the step.",
        leaves_out="It is itself an error.",
    ),
    number(
        "torque_line_hz",
        "Frequency of the strongest line of the torque, often a harmonic of frequency_hz.",
        leaves_out="It is as fine as the judged part of the run is long.",
    ),
    number(
        "dominant_level",
        "RMS of the torque within 1.5 % of its strongest line.",
        leaves_out="Leakage of the window, and all that bounds of torque_rms hold.",
    ),
    number(
        "harmonic_(2|3)_level",
        "RMS of the torque about twice, or three times, the frequency of its strongest line.",
        leaves_out="Leakage of the window, and all that bounds of torque_rms hold.",
    ),
)
MODES_OF_POINT = (
    count("dominant_mode", "Real mode with most energy over the judged part; 0: none."),
    number("dominant_share", "Its share of the energy.", leaves_out="Its scatter: see modes."),
    count("transfer_(from|to)", "Real mode that leads at first, or at the end; 0: none."),
    number(
        "transfer_time",
        "When the mode that leads at the end took over for good.",
        leaves_out="It is as coarse as a fiftieth of the run.",
    ),
    number(
        "energy_outside_share",
        "Share of the energy in modes outside the band of the sensors.",
        leaves_out="Its scatter over the window.",
    ),
    number(
        "energy_balance",
        "Energy that the integrator gains or loses in the whole run, over the work of friction.",
        leaves_out="It is itself an error, of the step.",
    ),
)
CONTACT = (
    number(
        "stick_share",
        "Share of contact area and time in which contact sticks: friction is below its bound. "
        "Contacts without friction, and with a state, count in no share.",
        leaves_out=OF_ITS_TIME,
    ),
    number("stick_share_max", "Largest share of the area that sticks at once.", leaves_out=STEPPED),
    number(
        "stick_creep",
        "Largest sliding speed of a point that sticks, over that of steady sliding there.",
        leaves_out=STEPPED,
    ),
    number(
        "open_share",
        "Share of contact area and time in which the pressure is below a hundredth of the mean "
        "of the design point's own steady sliding.",
        leaves_out=OF_ITS_TIME,
    ),
    number("open_share_max", "Largest share of the area that is open at once.", leaves_out=STEPPED),
)
INTEGRATION = (
    number("iterations_mean", "Evaluations of contact forces a step, mean.", leaves_out=STEPS),
    count("iterations_max", "Evaluations of contact forces in a step, at most."),
    count("halvings", "How often a step was halved because it failed."),
    count("newton_steps", "Steps that Newton's method had to solve."),
    number("contraction", "Largest ratio of residuals over a first correction.", leaves_out=STEPS),
    number(
        "stick_number",
        "Half the step times the fastest decay of sticking friction.",
        leaves_out=STEPS,
    ),
    number("time_reached", "Simulated time.", leaves_out="It is exact."),
    count("n_coordinates", "Coordinates that were integrated."),
    count("n_contact_points", "Contact points of the model."),
    number(
        "perturbation",
        "Largest velocity at a contact point with which the run starts.",
        leaves_out="It is given.",
    ),
)
POINTS = (
    *HEAD,
    text(
        "class",
        "Outcome: stable, limit_cycle, irregular, growing, undecided, changing or failed.",
    ),
    text("growth_method", "How growth was fitted: left_vector, energy, too_short, or why not."),
    *FORECAST,
    *GROWTH_OF_POINT,
    *LEVELS,
    *MODES_OF_POINT,
    *CONTACT,
    *INTEGRATION,
    *VALIDITY,
)
MODES = (
    count("mode", "Number of the real mode at the working point, by frequency, from 1."),
    number("frequency_hz", "Its frequency without friction.", leaves_out=BASIS),
    *bounded("energy_share", "Its share of the energy over the judged part of the run."),
    number("energy_mean", "Its mean energy there.", leaves_out="Its scatter: see energy_share."),
    number(
        "first_share",
        "Its share of the energy in the first part of the run.",
        leaves_out="Its scatter.",
    ),
    ENERGY_SHARES,
)
GROWTH = (
    count("mode", "Number of the followed complex mode, fastest growth first."),
    number("frequency_hz", "Modulus of its root over 2 pi.", leaves_out=BASIS),
    number("growth_rate", "Its predicted growth rate.", leaves_out=BASIS),
    number("damping_ratio", "Its predicted damping ratio.", leaves_out=BASIS),
    flag("unstable", "Whether it is predicted to grow."),
    number(
        "fitted_growth_rate",
        "Its growth as fitted to its amplitude in the run.",
        "fitted_low",
        "fitted_high",
        "step_error",
    ),
    number(
        "step_error",
        "By how much the mode grows too fast at the run's step; part of the bounds.",
        leaves_out="It is itself an error.",
    ),
    text("fit_status", "ok, or why no growth rate was fitted."),
    number("fitted_(low|high)", "Bound of fitted_growth_rate.", leaves_out="It is a bound."),
    number("fit_(start|stop)", "Where the fitted part begins, or ends.", leaves_out="Chosen."),
    number(
        "level_share",
        "Its share of the energy of the vibration that lasts.",
        leaves_out="Its scatter over the window.",
    ),
    flag("expressed", "Whether it is in the vibration that lasts; missing where unknown."),
)
OF_WINDOW = "The step's error; it is of this window alone."
WINDOWS = (
    count("window", "Number of the window, from 1: parts of equal length of the run."),
    number("time_(start|stop)", "When the window begins, or ends.", leaves_out="It is exact."),
    number(
        "sliding_speed_(start|stop)",
        "Imposed sliding speed there; negative where it is reversed.",
        leaves_out="It is given.",
    ),
    number(
        "pressure_(start|stop)",
        "Brake pressure there; missing where it does not change.",
        leaves_out="It is given.",
    ),
    text("class", "What the torque does in the window: quiet, stick_slip, vibrates."),
    *bounded("torque_mean", "Mean of the torque over the window."),
    *bounded("torque_rms", "RMS of the torque about a straight line through the window."),
    *bounded("torque_peak_to_peak", "Largest less least torque in the window."),
    number(
        "frequency_hz",
        "The motion's own frequency; missing where it does not repeat in the window.",
        leaves_out=OF_WINDOW,
    ),
    number(
        "torque_line_hz",
        "Frequency of the strongest line of the torque, often a harmonic of frequency_hz.",
        leaves_out="It is as fine as the window is long, and its mean where it changes.",
    ),
    number(
        "dominant_level",
        "RMS of the torque within 1.5 % of its strongest line.",
        leaves_out=OF_WINDOW,
    ),
    number("energy_mean", "Mean energy of all modes.", leaves_out=OF_WINDOW),
    number(
        "(stick|open)_share",
        "Share of contact area and time in this state, as in points.",
        leaves_out=OF_WINDOW,
    ),
    number("(stick|open)_share_max", "Largest share of the area at once.", leaves_out=OF_WINDOW),
)
HISTORIES = (
    number("time", "Simulated time of the row.", leaves_out="It is exact."),
    number("torque", "Torque of friction at the row.", leaves_out=AT_ROWS),
    number("normal_force", "Normal force of contact with friction.", leaves_out=AT_ROWS),
    number(
        "sliding_speed|pressure", "As imposed; only where one changes.", leaves_out="It is given."
    ),
    number("stick|slip|open", "Share of the contact area in this state.", leaves_out=AT_ROWS),
    number("energy", "Kinetic and elastic energy of all modes.", leaves_out=AT_ROWS),
    number(
        "energy_outside",
        "The part of it in modes outside the band of the sensors.",
        leaves_out=AT_ROWS,
    ),
    number(r"energy_mode_\d+", "The part of it in this real mode.", leaves_out=AT_ROWS),
    number(
        r"amplitude_mode_\d+",
        "Amplitude of a free vibration of this real mode with its energy.",
        leaves_out=AT_ROWS,
    ),
    number(
        "torque_(mean|rms|min|max)",
        "Of the torque, over all steps since the row before.",
        leaves_out=STEPPED,
    ),
    number(
        "(stick|open)_(mean|max)",
        "Of the share of the contact area in this state, over all steps since the row before.",
        leaves_out=STEPPED,
    ),
)
TRANSIENT: Tables = {
    "points": POINTS,
    "modes": MODES,
    "growth": GROWTH,
    "windows": WINDOWS,
    "histories": HISTORIES,
}
