"""What a file says never steers a terminal or a spreadsheet."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from squealstudy import screen
from squealstudy.cli.run import fidelity
from squealstudy.kinds.limit_cycles.screen import footnotes, levels_in_words, merged_reasons
from squealstudy.plots.style import signed
from squealstudy.wording import (
    CHANGING,
    CLASS_LETTERS,
    FAILED,
    LASTING,
    STABLE,
    UNDECIDED,
    VERDICT_LETTERS,
    VERDICTS,
    amount,
    by_ranges,
    plural,
    with_error,
)

HOSTILE = "ok\x1b]0;title\x07\x1b[2J\u202emoc.live\x9b31m\u200b"


def test_control_characters_are_escapes_everywhere(capsys):
    table = screen.grid("word:name", rows=[[HOSTILE]])
    parts = (HOSTILE, table, screen.facts([(HOSTILE, HOSTILE)]), screen.notes(HOSTILE))
    text = screen.as_text(parts[1:]) + screen.plain(HOSTILE)
    screen.warning(HOSTILE)
    text += capsys.readouterr().err
    assert not {c for c in HOSTILE if not c.isprintable()} & set(text)
    assert "\\x1b]0;title\\x07" in text


def test_what_is_printable_stays():
    text = "mu = 0.5 \N{MULTIPLICATION SIGN}\N{NO-BREAK SPACE}2\n\N{GREEK SMALL LETTER MU}"
    assert screen.plain(text) == text


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("=HYPERLINK(1)", "'=HYPERLINK(1)"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("+cmd|' /C calc'!A0", "'+cmd|' /C calc'!A0"),
        ("-0.5, 1e-3", "-0.5, 1e-3"),
        ("disc 46 %", "disc 46 %"),
    ],
)
def test_texts_in_csv_are_no_formulas(text, told, capsys):
    screen.show_csv(pd.DataFrame({"name": [text], "growth_rate": [-1.5]}))
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].replace('"', "") == f"{told},-1.5"
    screen.show_csv(pd.DataFrame({text: [-1.5]}))
    assert capsys.readouterr().out.replace('"', "") == f"{told}\n-1.5\n"


def test_what_holds_where_is_told_by_ranges_of_one_parameter():
    words = ["squeals", "silent", "silent", "squeals"]
    assert by_ranges("speed", "m/s", [3.0, 1.0, 0.5, 2.0], words) == (
        "silent at speed 0.5 to 1 m/s (2 points), squeals at speed 2 to 3 m/s (2 points)"
    )
    assert by_ranges("load", "N", [2e3], ["silent"]) == "silent at load 2 kN"
    assert by_ranges("speed", "", [1.0, 1.0], ["a", "b"]) == ""  # of one value two
    assert by_ranges("speed", "", [float("nan"), 1.0], ["a", "a"]) == ""
    assert by_ranges("speed", "", [*range(8)], ["a", "b"] * 4) == ""  # too many to read
    assert by_ranges("speed", "", [], []) == ""


def test_a_grid_of_two_parameters_is_a_map_of_letters():
    x, y = [0.1, 0.2, 0.3, 0.1, 0.2, 0.3], [5.0, 5.0, 5.0, 10.0, 10.0, 10.0]
    words = ["stable", "stable", "limit_cycle", "stable", "failed", "limit_cycle"]
    told = screen.as_text(screen.letter_map(("mu", "load N"), (x, y), words, CLASS_LETTERS))
    assert told.splitlines() == [
        "load N",
        "10  . x L",
        " 5  . . L",
        "to the right: mu, 0.1 to 0.3 (3 values)",
        "L limit cycle, . stable, x failed",
    ]
    assert screen.letter_map(("mu", "load N"), (x[1:], y[1:]), words[1:], CLASS_LETTERS) == []
    strange = [*words[:-1], "strange"]  # of a version to come
    assert screen.letter_map(("mu", "load N"), (x, y), strange, CLASS_LETTERS) == []


def test_a_grid_is_no_wider_than_the_screen_and_breaks_no_number_and_no_name():
    titles = ("sliding_speed m/s", "word:class", "growth 1/s", "text:where most of the energy is")
    rows = [["0.25", "limit cycle", "-0.0002182", "interfaces 46 %, outer_pad.layers 36 %"]] * 2
    shown = screen.grid(*titles, rows=rows)
    wide = screen.as_text([shown])
    assert len(wide.splitlines()) == 3
    assert "where most of the energy is" in wide
    for width in range(52, 80):
        lines = screen.as_text([shown], width).splitlines()
        assert max(map(len, lines)) <= width
        for whole in ("0.25", "limit cycle", "-0.0002182", "growth", "outer_pad"):
            assert any(whole in line for line in lines), (whole, width)
    heads = screen.grid("value:sliding_speed m/s", "value:growth 1/s", rows=[["1", "-2"]])
    for width, first in ((25, "sliding_speed"), (21, "sliding_speed  growth"), (20, "sliding_")):
        assert screen.as_text([heads], width).splitlines()[0].strip() == first
    names = screen.as_text([screen.grid("text:name", rows=[["a.long_name_of_a_parameter"]])], 12)
    assert names.splitlines()[1:] == ["a.long_name_", "of_a_", "parameter"]
    wider = screen.as_text([screen.grid(*"abcdefgh", rows=[["-0.0002182"] * 8])], 40)
    assert wider.splitlines()[1].split() == ["-0.0002182"] * 8  # beyond the screen, never cut


def test_a_number_is_not_parted_from_its_unit():
    cell = screen.held_together(["0.56", "674.7 kPa", "528700 1/m"])
    shown = screen.as_text([screen.grid("text:worst at", rows=[[cell]])], 12)
    assert shown.splitlines() == ["worst at", "0.56,", "674.7 kPa,", "528700 1/m"]
    assert screen.as_text([screen.grid("text:worst at", rows=[[cell]])]).splitlines()[1] == (
        "0.56, 674.7 kPa, 528700 1/m"
    )


def test_every_class_and_verdict_has_a_letter_of_its_own():
    for letters, names in (
        (VERDICT_LETTERS, VERDICTS),
        (CLASS_LETTERS, (*LASTING, STABLE, CHANGING)),
    ):
        assert set(letters) == {*names, UNDECIDED, FAILED}
        assert len(set(letters.values())) == len(letters)


def test_a_reason_that_stands_often_is_a_footnote():
    long = "mode 1: steady sliding is stable, and so is a cycle beside it"
    assert footnotes([long, "short", long]) == {long: "a", "short": "b"}
    assert footnotes([long, "another"]) == {long: long, "another": "another"}
    assert footnotes(["short", "short"]) == {"short": "short"}


def test_reasons_that_differ_by_numbers_alone_are_one_with_their_ranges():
    def reason(mode, speed, extra="; cycles apart were not searched"):
        return f"mode {mode}: no cycle up to {speed} m/s, checked at 6 amplitudes{extra}"

    told = [reason(1, speed) for speed in ("0.293", "1e+03", "0.0282")]
    one = reason(1, "0.0282 to 1e+03")
    assert merged_reasons([told[0], *told, "else"]) == {**dict.fromkeys(told, one), "else": "else"}
    apart = [reason(1, "0.5"), reason(2, "0.5"), reason(1, "0.5", "")]
    assert merged_reasons(apart) == {text: text for text in apart}


def test_levels_and_kicks_are_told_in_words():
    points = pd.DataFrame(
        {
            "torque_rms": [np.nan, 23.54, 127.9, 262.6],
            "frequency_hz": [np.nan, 223.9, np.nan, 217.7],
            "torque_line_hz": [np.nan, 223.9, 219.9, 217.7],
            "threshold_velocity": [np.nan, 0.7886, 1.153, np.nan],
            "threshold_share": [np.nan, 0.92, 0.19, np.nan],
            "verdict": ["no_cycle_found", "squeals_if_kicked", "squeals_if_kicked", "squeals"],
        }
    )
    assert levels_in_words(points, "N") == (
        " RMS of the force of friction in what was seen to last: 23.5 to 262.6 N, at 217.7 to "
        "223.9 Hz. Where it squeals if kicked, a kick along the unstable cycle by 0.79 to 1.15 m/s "
        "at a contact point starts it (19 to 92 % of the speed in the cycle); kicks of "
        "other shapes may need less."
    )
    unknown = points.assign(threshold_velocity=[np.nan, 0.7886, np.nan, np.nan])
    told = levels_in_words(unknown, "N")  # of a cycle continued from another design
    assert ". At 1 of the 2 that squeal if kicked, a kick along the unstable cycle by 0.79" in told
    assert levels_in_words(points[2:3].assign(threshold_velocity=np.nan), "N m") == (
        " RMS of the torque in what was seen to last: 127.9 N m, at 219.9 Hz."
    )
    assert levels_in_words(points[:1], "N") == ""
    # two motions that beat repeat together after 131 of the cycles that are heard
    beating = points.assign(frequency_hz=[np.nan, 223.9, 4.954, 217.7], torque_line_hz=649.0)
    assert "N, at 217.7 to 649.0 Hz." in levels_in_words(beating, "N")


def test_a_number_has_two_digits_of_its_error():
    told = {
        (165.16, 4.63): "165.2 +- 4.6",
        (1124.98, 143.5): "1120 +- 140",
        (39.53, 0.9996): "39.5 +- 1.0",
        (114.03, 0.015): "114",
        (114.03, float("nan")): "114 (error not known)",
        (114.03, float("inf")): "114 (error not known)",
        (1.4798e-5, 3.1e-7): "1.48e-05 +- 3.1e-07",
    }
    assert {numbers: with_error(*numbers) for numbers in told} == told


def test_growth_of_thousands_is_written_out():
    """A bar had +1.38e+03 1/s, the screen beside it 1380.6."""
    told = {1380.6: "+1381", -2500.0: "-2500", 999.94: "+1000", 45.46: "+45.5", 0.00702: "+0.00702"}
    assert {number: signed(number) for number in told} == told


def test_a_prefix_leaves_a_number_that_can_be_read():
    assert amount(1.2e6, "Pa") == "1.2 MPa"
    assert amount(5e11, "Pa/m") == "500 GPa/m"
    assert amount(-5.4e17, "Pa/m3") == "-5.4e+17 Pa/m3"


def test_sentences_in_a_pipe_have_short_lines_and_paths_stay_whole(capsys, monkeypatch):
    monkeypatch.setattr(screen, "WIDTH_OF_SENTENCES", 100)
    sentence = "Over both designs two modes are unstable and grow faster with friction. " * 3
    path = "/results/with blanks/" + "a folder " * 12
    screen.show(sentence, screen.facts([("name", "value")]))
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 3
    assert max(map(len, lines)) <= 100
    assert not any(line.endswith(" ") for line in lines)
    assert " ".join(lines[:-1]).split() == sentence.split()
    screen.show(path.strip(), "x" * 150 + " y", unbroken=True)
    assert capsys.readouterr().out.splitlines() == [path.strip(), "x" * 150 + " y"]
    screen.show("x" * 150 + " y")
    assert capsys.readouterr().out == "x" * 150 + " y\n"


def test_a_distance_has_its_prefix():
    assert amount(10e3, "m") == "10 km"
    assert (amount(0.15, "m"), amount(0.0, "m"), amount(20.0, "m/s")) == ("0.15 m", "0 m", "20 m/s")


def test_an_error_that_is_zero_is_no_power_of_ten():
    chosen = {"settings": "dense", "estimated_error": 0.0, "seconds": 2.0, "reason": "exact"}
    none = {"settings": "", "seconds": None, "reason": "there is none"}
    other = chosen | {"estimated_error": 2.5e-5}
    audit = {"passed": True, "error": 0.0, "points": [1], "against": "exact solves"}
    told = fidelity(
        {"chosen": chosen, "cheaper": none, "dearer": other, "tolerance": 1e-3, "audit": audit}
        | {"reason": "meets the tolerance"}
    )
    assert [text for _, text in told] == [
        "dense; estimated error 0, about 2 s: meets the tolerance",
        "there is none",
        "dense; estimated error 2.5e-05, about 2 s",
        "passed: error 0 of 0.001 allowed, at 1 random point against exact solves",
    ]


def test_counts_have_their_thousands_apart():
    assert [plural(n, "point") for n in (1, 0, 999, 20_000)] == [
        "1 point",
        "0 points",
        "999 points",
        "20,000 points",
    ]
