"""Integrators that are compared with the product's own, on the same modal systems."""

from squealstudy.motion.integrator import read_integrators

read_integrators(__name__)
