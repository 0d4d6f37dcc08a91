"""Modes followed from one design point to the next; onsets of instability on them."""
