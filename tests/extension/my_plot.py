"""A plot of one's own: how many modes of each frequency band are unstable."""

import numpy as np
from matplotlib.figure import Figure

from squealstudy import Results, register_plot


@register_plot(modes=("frequency_hz", "unstable"))
def unstable_by_band(results: Results, width: float = 1000.0) -> Figure:
    """Number of unstable modes over all design points in bands of frequency.

    Parameters
    ----------
    results : Results
        Of a complex-mode study.
    width : float
        Of a band [Hz].
    """
    modes = results.modes[results.modes["unstable"]]
    figure = Figure(layout="constrained")
    axes = figure.add_subplot()
    edges = np.arange(0.0, modes["frequency_hz"].max() + 2 * width, width)
    axes.hist(modes["frequency_hz"], edges.tolist())
    axes.set(xlabel="Frequency [Hz]", ylabel="Unstable modes")
    return figure
