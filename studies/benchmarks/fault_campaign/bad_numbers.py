"""Parameters of the generated brake that are no numbers, or too large: refused, or a point's words.

The other point of each study, with the default in that place, must have its modes.
"""

from __future__ import annotations

import functools
import os
import random
import re
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from fault_campaign.copies import Judged, in_a_copy
from fault_campaign.finding import Finding

PART = "bad numbers"
SCENES = ("disc_brake",)
PATIENCE_S = 300
VALUES = ("nan", "inf", "-inf", "1e308", "-1e308", "1e155", "1e-308", "5e-324", "0.0", "-1.0")
STUDY = """\
[study]
name = "bad"
kind = "complex_modes"
[model]
name = "{model}"
{mesh}
[[sweep]]
parameter = "{parameter}"
values = [{values}]
[modes]
band = [500.0, 3000.0]
reference_points = 0
"""
UNFORESEEN = re.compile(r"\b[A-Z]\w+Error\b")  # of a message: no words of ours


def run(count: int, seed: int, work: Path, names: tuple[str, ...] = SCENES) -> Iterator[Finding]:
    """Try `count` values of parameters; a finding for each."""
    from squealstudy.face import read_study

    folder = work / "bad_numbers"
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        name = rng.choice(names)
        mesh = 'mesh = "coarse"' if name == "disc_brake" else ""
        path = folder / f"{name}{number}.toml"
        text = STUDY.format(model=name, mesh=mesh, parameter="friction", values="0.4")
        path.write_text(text)
        parameters = {p.name: p for p in read_study(path).resolved.model.parameters}
        chosen = parameters[rng.choice(sorted(parameters))]
        value = rng.choice(VALUES)
        values = ", ".join(sorted({repr(float(chosen.default)), value}, key=float))
        path.write_text(STUDY.format(model=name, mesh=mesh, parameter=chosen.name, values=values))
        judge = functools.partial(_judged, path, folder, float(chosen.default), chosen.name)
        verdict, text = in_a_copy(judge, PATIENCE_S, resource.RLIM_INFINITY)
        yield Finding(PART, number, f"{name}: {chosen.name} = {value}", verdict, text)


def _judged(path: Path, folder: Path, default: float, parameter: str) -> Judged:
    import squealstudy as sq
    from squealstudy.errors import SquealstudyError

    os.environ["SQUEALSTUDY_CACHE"] = str(folder / "cache")
    try:
        found = sq.run(path, folder / path.stem, jobs=1, yes=True, warn=lambda text: None)
    except SquealstudyError as error:
        words = str(error)
        return ("internal error" if UNFORESEEN.search(words) else "message"), words
    points, modes = found.points, found.modes
    own = np.isclose(points[parameter], default)
    if (points["status"][own] != "ok").any():
        return "differs", f"the default fails too: {points['message'].tolist()}"
    if not np.isfinite(modes[["frequency_hz", "growth_rate"]].to_numpy()).all():
        return "silent", "modes that are no numbers"
    failed = points[points["status"] != "ok"]
    for text in failed["message"]:
        if not text or UNFORESEEN.search(text):
            return "internal error", text
    return ("message", "; ".join(failed["message"])) if len(failed) else ("ok", "")
