"""Linearised dynamics about working points, and the same brake in time; a room a subject."""
