"""Integrators of the batched kernel; studies know every integrator in this folder by its name."""
