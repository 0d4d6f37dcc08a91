"""Integrators to compare with those that studies use, on the same modal systems."""

from squealstudy.motion.integrator import read_integrators

read_integrators(__name__)
