"""Integrators that are compared with the product's own, on the same modal systems."""
