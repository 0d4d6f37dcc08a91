"""Small design studies of the coarse brake and of an oscillator, drawn at random, for proofs.py.

Those of the brake are of component modes' dampings and frequencies, of damping and contact, or of
what is built: a layer, a material, a mass. The ends of the pressure are the same in all, so that
reductions serve several. What of a proof is no motion is left small: starts, scan, full order.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

OSCILLATOR = Path(__file__).parents[1] / "kicked_design.toml"

VARIABLES = (  # in which kinds of studies, what may change, low and high
    ("targets surface built", "damping_ratio", 0.0, 0.03),
    ("targets", "caliper.modes[7-12].damping_ratio", 0.0, 0.1),
    ("targets", "outer_pad.modes[7-12].damping_ratio", 0.0, 0.15),
    ("targets", "inner_pad.modes[7-12].damping_ratio", 0.0, 0.15),
    ("targets", "caliper.modes[7-9].frequency_scale", -0.15, 0.15),
    ("targets", "outer_pad.modes[7-8].frequency_scale", -0.15, 0.15),
    ("surface", "contact.lambda", -2e5, 2e5),
    ("surface", "stiffness_damping", 0.0, 4e-7),
    ("built", "pad.lining_young_modulus_z", -3e8, 3e8),
    ("built", "piston.stiffness", -2e10, 2e10),
    ("built", "fingers.stiffness", -5e10, 5e10),
)
MASS = 'added_mass = {on = "caliper.BRIDGE", max = "50 g"}'
STUDY = """[study]
name = "{name}"
kind = "design"
[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2
[parameters]
sliding_speed = 0.5
friction = 0.5
pressure = 12e5
[[sweep]]
parameter = "friction"
values = {friction}
[[sweep]]
parameter = "pressure"
values = {pressure}
[modes]
band = [500.0, 6000.0]
[goal]
margin = {{damping_ratio = {margin}}}
starts = 3
scan = 6
full_order = 0
in_time = 2
"""


def brake(name: str, rng: np.random.Generator, most: float = 0.03) -> str:
    """A design study: of targets, of damping and contact, or of what is built.

    Uniform damping may rise by `most`; where that is little, others must change, too.
    """
    friction = np.sort(rng.uniform([0.35, 0.5, 0.4], [0.45, 0.6, 0.55])[: rng.integers(2, 4)])
    pressure = [5e5, *np.round(rng.uniform(8e5, 16e5, rng.integers(2)), -3).tolist(), 20e5]
    margin = round(rng.uniform(3e-4, 2e-3), 5)
    text = STUDY.format(
        name=name, friction=np.round(friction, 3).tolist(), pressure=pressure, margin=margin
    )
    kind = rng.choice(["targets", "surface", "built"], p=[0.5, 0.35, 0.15])
    pool = [v for v in VARIABLES if kind in v[0]]
    kept = 1  # the uniform damping is always among them: others alone seldom suffice
    more = {"targets": 2, "surface": int(rng.integers(1, 3)), "built": 1}[str(kind)]
    chosen = [*range(kept), *(kept + rng.permutation(len(pool) - kept)[:more])]
    what = [
        f'parameter = "{p}"\nbounds = [{a:.4g}, {most if p == "damping_ratio" else b:.4g}]'
        for _, p, a, b in map(pool.__getitem__, chosen)
    ]
    if kind == "built" and rng.random() < 0.5:
        what[1] = MASS
    return text + "".join(
        f"[[variable]]\n{one}\ncost = {rng.uniform(0.3, 2.0):.3g}\n" for one in what
    )


def oscillator(name: str, rng: np.random.Generator) -> str:
    """Hoffmann's oscillator of `kicked_design`, whose softening contact squeals if kicked."""
    text = OSCILLATOR.read_text()
    k2, force = 1.31e6 * rng.uniform(1.0, 1.05), rng.uniform(700.0, 1300.0)
    friction = np.round(np.sort(rng.uniform(0.4, 0.95, rng.integers(2, 4))), 3).tolist()
    given = {
        "name": f'"{name}"',
        "k2": f"{k2:.4g}",
        '"contact.cubic_stiffness"': f"{-rng.uniform(2e17, 6e17):.3g}",
        "normal_force": f"{force:.4g}",
        "values": str(friction),
        "margin": f"{{damping_ratio = {rng.uniform(1e-3, 6e-3):.3g}}}",
    }
    for key, value in given.items():
        text = re.sub(rf"^{re.escape(key)} = .*", f"{key} = {value}", text, count=1, flags=re.M)
    text = text[: text.index("[[variant]]")]
    if rng.random() < 0.5:
        text += f'[[variable]]\nparameter = "k2"\nbounds = [{-0.04 * k2:.4g}, {0.04 * k2:.4g}]\n'
    return text


DRAWN = {"brake": brake, "little_damping": partial(brake, most=0.012), "oscillator": oscillator}


def random_studies(seed: int, of: str) -> Iterator[tuple[str, str]]:
    """Names and texts of studies of a model of `DRAWN`, without end."""
    draw = DRAWN[of]
    for number in itertools.count():
        name = f"{of}_{seed}_{number:02}"
        yield name, draw(name, np.random.default_rng([seed, number]))
