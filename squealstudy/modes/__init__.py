"""Complex modes of design points: the rungs of reanalysis and what they have in common."""
