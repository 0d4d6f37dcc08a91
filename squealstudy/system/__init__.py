"""Structures with contact as terms times weights: one linearisation in any coordinates."""
