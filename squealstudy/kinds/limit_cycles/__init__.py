"""Limit cycles of every design point and mode family, with a verdict each."""
