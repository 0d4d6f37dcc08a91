"""Transient studies: batches of design points in time, their rows, histories and tables."""
