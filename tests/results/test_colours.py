"""Fills that carry a verdict are told apart by everybody: Machado, Oliveira and Fernandes 2009."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from squealstudy.colours import FILLS
from squealstudy.wording import IF_KICKED, NO_CYCLE, SQUEALS, VERDICTS

SEEN = {  # linear RGB as it is seen: all cones, without those of long, middle, short waves
    "all": np.eye(3),
    "protan": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deutan": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritan": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
XYZ = np.array(  # of linear sRGB
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
WHITE = np.array([0.95047, 1.0, 1.08883])


def lab(colour, seen):
    """CIELAB of a colour, lightness first."""
    c = np.array(to_rgb(colour))
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    t = XYZ @ np.clip(np.asarray(seen) @ linear, 0.0, 1.0) / WHITE
    f = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def test_lab_of_white_and_black():
    assert lab("white", np.eye(3)) == pytest.approx([100.0, 0.0, 0.0], abs=0.02)
    assert lab("black", np.eye(3)) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("seen", SEEN)
def test_verdicts_of_a_map_are_told_apart(seen):
    assert set(FILLS) == set(VERDICTS)
    places = {name: lab(colour, SEEN[seen]) for name, colour in FILLS.items()}
    for one, other in combinations(places, 2):
        assert np.linalg.norm(places[one] - places[other]) >= 20, (one, other)
    grey = [places[name][0] for name in (SQUEALS, IF_KICKED, NO_CYCLE)]
    assert (np.diff(grey) >= 15).all()  # in print, too
