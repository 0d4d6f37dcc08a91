"""Periodic motions without time stepping: harmonic balance, continuation, Floquet multipliers."""
