"""Linearised dynamics about working points: complex modes, energies, tracking, ranking."""
