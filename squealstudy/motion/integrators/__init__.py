"""Integrators of the batched kernel, one a file: what is here is known to studies by its name."""
