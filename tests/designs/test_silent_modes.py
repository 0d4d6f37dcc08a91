"""Modes that one design silences are told from those that may only have another number there."""

from __future__ import annotations

import pandas as pd
import pytest
from made_results import made

from squealstudy.kinds.complex_modes.design_lines import DesignLine
from squealstudy.kinds.complex_modes.design_table import _onsets_by_mode
from squealstudy.kinds.complex_modes.silent_modes import silent_tracks
from squealstudy.screen import as_text

FRICTIONS, SCALES = (0.2, 0.4), (0.8, 1.0)
HZ = {1: 1000.0, 2: 2000.0, 3: 2060.0}


def ranked(track, onset):
    row = {"track": track, "kind": "mode", "threshold": onset, "threshold_kind": "refined"}
    row |= {f"frequency{end}_hz": HZ[track] for end in ("", "_min", "_max")}
    return row | {"max_growth_rate": 100.0 - track}


def grid_of_two(unstable, **changes):
    """Two designs of two frictions, the tracks that are unstable at the last, and their ranking.

    `changes` replace cells of track 2 at the second design's last point.
    """
    points = pd.DataFrame(
        [{"friction": f, "scale": s, "status": "ok"} for s in SCALES for f in FRICTIONS]
    )
    points.insert(0, "point_id", list("abcd"))
    modes = pd.DataFrame(
        {"point_id": p, "track": t, "track_ambiguous": False, "stability": "stable"}
        for p in "abcd"
        for t in HZ
    )
    for point, tracks in zip("bd", unstable, strict=True):
        at = (modes["point_id"] == point) & modes["track"].isin(tracks)
        modes.loc[at, "stability"] = "unstable"
    at = (modes["point_id"] == "d") & (modes["track"] == 2)
    for name, value in changes.items():
        if name == "status":
            points.loc[3, name] = value
        elif name == "absent":
            modes = modes[~at]
        else:
            modes.loc[at, name] = value
    lines = []
    for scale, tracks in zip(SCALES, unstable, strict=True):
        rows = {t: ranked(t, 0.3) for t in tracks}
        first = next(iter(rows.values()))
        lines.append(DesignLine({"scale": scale}, 1, 2, True, 0.3, "", first, first, rows))
    every = sorted({t for tracks in unstable for t in tracks})
    table = pd.DataFrame({"track": every, "family": every, "family_modes": 1})
    facts = {"sweeps": ["friction", "scale"], "parameters": ["friction", "scale"]}
    return made(facts=facts).with_tables(points=points, modes=modes), lines, table


def onsets(results, lines, table):
    silent = silent_tracks(results, lines, table)
    shown = _onsets_by_mode(["0.8", "1"], lines, {}, "", silent, "friction 0.4")
    return " ".join(as_text(shown).split())


def test_a_mode_that_is_stable_at_every_point_of_a_design_has_none():
    text = onsets(*grid_of_two([(1, 2), (1,)]))
    assert "0.8 0.3 0.3 1 0.3 none none: at this design the mode is stable at every point" in text
    assert text.endswith("up to friction 0.4")


@pytest.mark.parametrize(
    "doubt",
    [{"track_ambiguous": True}, {"stability": "uncertain"}, {"absent": True}, {"status": "failed"}],
)
def test_where_that_is_in_doubt_there_is_a_dash(doubt):
    text = onsets(*grid_of_two([(1, 2), (1,)], **doubt))
    assert "1 0.3 - -: at this design no onset is known of the mode" in text
    assert "none" not in text


def test_a_mode_that_grows_there_alone_may_be_the_same_of_another_number():
    """Of 2060 Hz in place of 2000 Hz; but not where both grow at the other design."""
    assert silent_tracks(*grid_of_two([(1, 2), (1, 3)])) == [set(), set()]
    assert silent_tracks(*grid_of_two([(1, 2, 3), (1, 3)])) == [set(), {2}]
    assert silent_tracks(*grid_of_two([(1, 2), (2,)])) == [set(), {1}]


def test_of_modes_that_swap_numbers_all_are_needed():
    results, lines, table = grid_of_two([(1, 2, 3), (1,)], absent=True)
    both = table.assign(family=[1, 2, 2])
    assert silent_tracks(results, lines, both)[1] == {2, 3}  # one mode of two numbers: one is there
    assert silent_tracks(results, lines, both.assign(family_modes=[1, 2, 2]))[1] == set()


def test_between_points_at_which_tables_bend_nothing_is_known_to_be_silent():
    results, *others = grid_of_two([(1, 2), (1,)])
    results.manifest["knots_between"] = {"friction": [0.3]}
    assert silent_tracks(results, *others) == [set(), set()]
