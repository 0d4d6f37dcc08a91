"""Texts of study files of methods, to start from."""

from __future__ import annotations

WORK_PRECISION = """\
# A work_precision study: error against time of methods, on runs of the model {model}.
# squealstudy schema --kind work_precision says what else it may have.

[study]
name = "{name}"
kind = "work_precision"
# description = ""

[work_precision]
#   study file, relative to this one, that all methods solve
base = "{base}"
#   design points at random in the swept box of the base study, where errors are measured; 0 for the
#   base study's own points
points = 2
#   what the chart judges
quantities = ["torque_rms"]

#   what errors are measured against
[reference]
integrator = "dop853"
options = {{rtol = 1e-10}}

#   lines of the chart: a method each, over the values of its knob
[[method]]
name = "exponential"
default = true
knob = "transient.step"
values = [1e-5, 2e-5, 4e-5]

[[method]]
name = "Newmark"
set.transient.method = "newmark"
knob = "transient.step"
values = [1e-5, 2e-5, 4e-5]
"""
METHOD_STABILITY = """\
# A method_stability study: where a method fails, on a minimal model of its own.
# squealstudy schema --kind method_stability says what else it may have.

[study]
name = "{name}"
kind = "method_stability"
# description = ""

[method_stability]
#   method whose limits are mapped: perturbation of a mode beside a lock-in
case = "coalescence"

#   the two axes of the map
[[knob]]
name = "anchor"
start = 0.0
stop = 0.6
num = 20

[[knob]]
name = "step"
start = 0.0001
stop = 1.0
num = 20
scale = "log"
"""
