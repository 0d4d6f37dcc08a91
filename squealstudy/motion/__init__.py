"""Runs in time of design points: their start, integration and outcome."""
