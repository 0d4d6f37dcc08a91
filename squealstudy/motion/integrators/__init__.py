"""Integrators of the batched kernel: what is here is known to studies by its name."""
